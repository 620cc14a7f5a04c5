"""Power spectral densities by Welch's method: means over Hann windows that overlap by half. That of
scipy takes longer to load than a page to draw."""

import numpy as np

from ..typing import Array


def segments(values: Array, length: int) -> Array:
    """(m, k, length) stretches of the columns (n, k), each half over the one before."""
    every = np.lib.stride_tricks.sliding_window_view(values, length, axis=0)
    return every[:: length - length // 2]


def power_spectrum(parts: Array, rate: float) -> tuple[Array, Array]:
    """(frequencies (q,), Hz; one-sided power spectral densities (q, k)) of segments (m, k, length) of
    samples at `rate`, Hz."""
    length = parts.shape[2]
    window = np.hanning(length + 1)[:-1]
    lines = np.fft.rfft(parts * window, axis=2)
    density = 2 * np.mean(np.abs(lines) ** 2, axis=0).T / (rate * np.square(window).sum())
    density[0] /= 2  # these have no negative twin
    if length % 2 == 0:
        density[-1] /= 2
    last = (len(density) - 1) * rate / length
    return np.linspace(0.0, last, len(density)), density
