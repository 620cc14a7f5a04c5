"""Calibration by strength alone: |M (y - b)| is the same in every direction, for gravity at rest
and for the Earth's magnetic field.

M is symmetric: scale and non-orthogonality without a turn, which strength cannot show. An algebraic
fit of a quadric is the start of least squares on the strength itself (Gander, Golub & Strebel 1994;
for magnetometers Renaudin, Afzal & Lachapelle 2010, Journal of Sensors 967245). What the directions
do not determine is held at identity and named. The fit is in units of the strength, so that misfits
are relative.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..typing import Array, Mask
from ..units.constants import MEDIAN_OF_NORMAL

ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
ELLIPSOID_PARAMETERS = (
    "scale x",
    "scale y",
    "scale z",
    "misalignment xy",
    "misalignment xz",
    "misalignment yz",
    "bias x",
    "bias y",
    "bias z",
)
WEAKEST = 0.02
"""Least singular value of the Jacobian (rms over its rows, all in units of the strength) at
which a parameter counts as determined: a misfit of 0.5 % that happens to have the worst pattern
then makes an error of 25 %."""
OUTLIER = 5.0
"""Misfits beyond this many standard deviations, robustly estimated, are left out."""
STEPS, DONE = 200, 1e-13


class EllipsoidFit(NamedTuple):
    """Result of a fit: calibrated = matrix @ (y - bias)."""

    bias: Array  # (3,) unit of y
    matrix: Array  # (3, 3)
    covariance: Array  # (12, 12) of bias and of the rows of the matrix
    residuals: Array  # (n, 3) unit of y; NaN where a sample was not used
    used: Mask  # (n,) bool
    weakest: float  # least singular value, see `WEAKEST`
    held: tuple[str, ...] = ()  # names of parameters held at identity
    missing: tuple[
        str, ...
    ] = ()  # names of parameters that were not determined and could not be held


def ellipsoid(y: Array, strength: float, std: float = 0.0) -> EllipsoidFit:
    """The EllipsoidFit of y (n, 3) to one strength; rows with NaN are left out.

    std: standard deviation of the strength of a row, where it is known beforehand; the covariance
    assumes no less.
    """
    known = np.all(np.isfinite(y), axis=1)
    z = np.where(known[:, None], y, 0) / strength
    p, free = start(z[known]), np.ones(9, bool)
    p, free, weakest = _hold_weakest(p, free, z[known])
    while True:
        p, used = _robust(z, known, p, free)
        before = free.sum()
        p, free, weakest = _hold_weakest(p, free, z[used])
        if free.sum() == before:
            return _fit(z, used, p, free, weakest, strength, std)


def _hold_weakest(p: Array, free: Mask, z: Array) -> tuple[Array, Mask, float]:
    """(p, free, weakest): entries of M held at identity until the directions of z determine the
    rest, those with most part in the weakest first.

    Misalignment goes before scale: it is the smaller of the two in most sensors.
    """
    p, free = p.copy(), free.copy()
    while True:
        J = _misfit(p, z)[1][:, free]
        weakest, pattern = weakest_direction(J.T @ J / len(z))
        entries = np.flatnonzero(free[:6])
        if weakest >= WEAKEST or not len(entries):
            return p, free, weakest
        k = entries[np.argmax(np.abs(pattern[: len(entries)]) * np.where(entries < 3, 1, 3))]
        free[k], p[k] = False, float(k < 3)
        if not free[:6].all():
            p[6:] = start(z, sphere=True)[6:]


def start(z: Array, sphere: bool = False) -> Array:
    """(9,) entries of M and b in units of the strength: of the quadric through z (n, 3), else,
    or where `sphere`, identity and its centre."""
    x, y, w = z.T
    quadric, rest, _, values = np.linalg.lstsq(
        np.c_[x * x, y * y, w * w, 2 * x * y, 2 * x * w, 2 * y * w, 2 * z],
        np.ones(len(z)),
        rcond=None,
    )
    Q = quadric[[0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(3, 3)
    if not sphere and len(z) >= 9 and values[-1] > 1e-6 * values[0]:
        b = -np.linalg.solve(Q, quadric[6:])
        sizes, turn = np.linalg.eigh(Q / (1 + b @ Q @ b))
        if sizes[0] > 0.01 and sizes[-1] < 100:
            M = turn @ np.diag(np.sqrt(sizes)) @ turn.T
            return np.r_[[M[i] for i in ENTRIES], b]
    middle = z.mean(axis=0)
    centre = np.linalg.lstsq(
        np.c_[2 * (z - middle), np.ones(len(z))],
        np.einsum("ij,ij->i", z - middle, z - middle),
        rcond=1e-4,
    )[0][:3]
    return np.r_[1, 1, 1, 0, 0, 0, middle + (centre if np.linalg.norm(centre) < 3 else 0)]


def unpack_parameters(p: Array) -> tuple[Array, Array]:
    """(M (3, 3), b (3,)) of the nine parameters."""
    M = np.empty((3, 3))
    for value, (i, j) in zip(p, ENTRIES):
        M[i, j] = M[j, i] = value
    return M, p[6:]


def _misfit(p: Array, z: Array) -> tuple[Array, Array]:
    """(|M (z - b)| - 1 (n,), its Jacobian (n, 9))."""
    M, b = unpack_parameters(p)
    d = z - b
    m = d @ M
    size = np.maximum(np.linalg.norm(m, axis=1), 1e-9)
    u = m / size[:, None]
    J = [u[:, i] * d[:, j] + (u[:, j] * d[:, i] if i != j else 0) for i, j in ENTRIES]
    return size - 1, np.c_[np.stack(J, axis=1), -u @ M]


def _robust(z: Array, used: Mask, p: Array, free: Mask) -> tuple[Array, Mask]:
    """(p, used): weighted least squares with weights that fall with the misfit, then plain ones
    without outliers."""
    p = levenberg(lambda p: _misfit(p, z[used]), p, free, robust=True)
    known = used
    for _ in range(5):
        r = _misfit(p, z)[0]
        kept = known & (np.abs(r) <= max(OUTLIER * robust_std(r[known]), 1e-9))
        if not kept.any():
            break
        p, same = levenberg(lambda p: _misfit(p, z[kept]), p, free), np.array_equal(kept, used)
        used = kept
        if same:
            break
    return p, used


def levenberg(
    function: Callable[[Array], tuple[Array, Array]], p: Array, free: Mask, robust: bool = False
) -> Array:
    """The parameters p (k,) that minimise the squares of function(p) = (r (n,), J (n, k)),
    moving only the `free` ones; Levenberg-Marquardt."""
    p, damping = p.copy(), 1e-3
    cost = None
    for _ in range(STEPS):
        r, J = function(p)
        J = J[:, free]
        scale = 3 * max(robust_std(r), 1e-9)
        weigh = (lambda r: np.log1p((r / scale) ** 2) * scale**2) if robust else np.square
        w = 1 / (1 + (r / scale) ** 2) if robust else np.ones(len(r))
        cost = weigh(r).sum()
        H, g = J.T @ (w[:, None] * J), J.T @ (w * r)
        ridge = np.diag(np.maximum(np.diag(H), 1e-12))
        while damping < 1e12:
            step = np.zeros(len(p))
            step[free] = -np.linalg.solve(H + damping * ridge, g)
            if weigh(function(p + step)[0]).sum() <= cost:
                break
            damping *= 4
        else:
            return p
        p, damping = p + step, max(damping / 10, 1e-15)
        if np.abs(step).max() < DONE * (1 + np.abs(p).max()):
            break
    return p


def robust_std(r: Array) -> float:
    """Standard deviation of r about zero from the median of magnitudes, which outliers do not
    move."""
    return float(np.median(np.abs(r))) / MEDIAN_OF_NORMAL if len(r) else 0.0


def weakest_direction(H: Array) -> tuple[float, Array]:
    """(square root of the least eigenvalue of H, its eigenvector)."""
    values, vectors = np.linalg.eigh(H)
    return float(np.sqrt(max(values[0], 0))), vectors[:, 0]


def inflation(r: Array, block: int = 50) -> float:
    """Return the factor by which the mean of `block` neighbouring residuals (rows of r) varies than of
    independent ones; at least 1."""
    r = r.reshape(len(r), -1)
    n = len(r) // block
    if n < 10:
        return 1.0
    means = r[: n * block].reshape(n, block, -1).mean(axis=1)
    variance = float(np.mean(r**2))
    return max(1.0, block * float(np.mean(means**2)) / variance) if variance > 0 else 1.0


def _fit(
    z: Array, used: Mask, p: Array, free: Mask, weakest: float, scale: float, std: float
) -> EllipsoidFit:
    M, b = unpack_parameters(p)
    r, J = _misfit(p, z[used])
    J = J[:, free]
    covariance = np.zeros((9, 9))
    if weakest > 1e-6:
        variance = r @ r / (len(r) - free.sum()) * inflation(r) if len(r) > free.sum() else 0.0
        covariance[np.ix_(free, free)] = np.linalg.inv(J.T @ J) * max(variance, (std / scale) ** 2)
    to_full = np.zeros((12, 9))
    to_full[:3, 6:] = np.eye(3) * scale
    for k, (i, j) in enumerate(ENTRIES):
        to_full[3 + 3 * i + j, k] = to_full[3 + 3 * j + i, k] = 1.0
    m = (z - b) @ M
    radial = m * (1 - 1 / np.maximum(np.linalg.norm(m, axis=1), 1e-9))[:, None] * scale
    held = tuple(name for name, is_free in zip(ELLIPSOID_PARAMETERS, free) if not is_free)
    missing = ELLIPSOID_PARAMETERS[6:] if weakest < WEAKEST else ()
    return EllipsoidFit(
        b * scale,
        M,
        to_full @ covariance @ to_full.T,
        np.where(used[:, None], radial, np.nan),
        used,
        weakest,
        held,
        missing,
    )
