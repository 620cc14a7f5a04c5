"""Mixtures of Gaussians, for particle Kalman filters: weights, moments, and a resampling that keeps
mean and covariance.

What the mean of a component is, the filter knows; here it is a row of `deviations` (N, n), the
errors about the mean of the mixture or another reference. `stream` is one of
core/mathematics/threefry.py.

Source: Hoteit, Luo & Pham (2012), "Particle Kalman filtering: a nonlinear Bayesian framework for
ensemble Kalman filters", MWR 140(2); systematic resampling after Kitagawa (1996); the kernel and
the shrinkage that goes with it after West (1993).
"""

import math

import numpy as np

from ...checks import check_number
from ...core.compile.jit import helper, inline, matrix
from ...core.mathematics.threefry import new_stream, normal_rows, normals, uniform
from ...typing import Array

MAX_COMPONENTS = 100000
"""Components of a mixture at most; 500 with 15 states take a megabyte."""
NOTHING = 1e-13  # of a variance: a pivot below it is none
# in steps of it the deviations of too few components shrink, until they fit into the covariance
SHRINK = 0.8


@helper
def update_weights(logs: Array, weights: Array) -> int:
    """Multiply weights by likelihoods, whose logarithms are `logs` (overwritten), and normalise
    them. Returns 1 where none is finite, 0 else.

    Then the weights stay as they were; otherwise a component whose likelihood is not finite has
    none any more. Nothing underflows together.
    """
    largest = -math.inf
    for i in range(weights.size):
        logs[i] = logs[i] + math.log(weights[i]) if weights[i] > 0 else -math.inf
        if math.isfinite(logs[i]):
            largest = max(largest, logs[i])
    if largest == -math.inf:
        return 1
    total = 0.0
    for i in range(weights.size):
        weights[i] = math.exp(logs[i] - largest) if math.isfinite(logs[i]) else 0.0
        total += weights[i]
    for i in range(weights.size):
        weights[i] /= total
    return 0


@helper
def effective(weights: Array) -> float:
    """Effective number of components: 1 / sum of the squared weights."""
    squares = 0.0
    for i in range(weights.size):
        squares += weights[i] * weights[i]
    return 1 / squares


@helper
def systematic(weights: Array, at: float, ancestors: Array) -> None:
    """Ancestors (N,) of a systematic resampling at the one number `at` in (0, 1): component i is
    drawn N weights[i] times, up or down to a whole."""
    total, last = 0.0, 0
    for i in range(weights.size):
        total += weights[i]
        if weights[i] > 0:
            last = i
    j, reached = 0, weights[0]
    for i in range(weights.size):
        while reached <= (i + at) * total / weights.size and j < last:
            j += 1
            reached += weights[j]
        ancestors[i] = j


@inline
def moments_size(n: int) -> int:
    """Numbers that `accumulate` sums into: n means, the lower triangle of the second moments in
    rows of n + 1, a copy of one deviation."""
    return n + n * (n + 1) + n + 1


@helper
def clear(sums: Array) -> None:
    """Before the first component."""
    for i in range(sums.size):
        sums[i] = 0.0


@helper
def accumulate(weight: float, x: Array, P: Array, sums: Array) -> None:
    """Add a component to the sums of a mixture: its deviation x (n,) and its covariance P, n n
    numbers in a row."""
    if x.size == 15:  # the same code with constant lengths
        _accumulate(15, weight, x, P, sums)
    elif x.size == 6:
        _accumulate(6, weight, x, P, sums)
    else:
        _accumulate(x.size, weight, x, P, sums)


@inline
def _accumulate(n: int, weight: float, x: Array, P: Array, sums: Array) -> None:
    """Rows in groups of four, each as long as its last one up to the diagonal: what lies right
    of it is not used."""
    copy = n + n * (n + 1)
    for j in range(n):
        sums[copy + j] = x[j]
        sums[j] += weight * x[j]
    for group in range((n + 3) // 4):
        _rows(4 * group, min(4 * group + 4, n), n, weight, P, sums)


@inline
def _rows(first: int, after: int, n: int, weight: float, P: Array, sums: Array) -> None:
    """Rows `first` to `after` of the second moments, in which `after` numbers count."""
    copy = n + n * (n + 1)
    for i in range(first, after):
        a, row = weight * sums[copy + i], n + (n + 1) * i
        for j in range(after):
            sums[row + j] += weight * P[n * i + j] + a * sums[copy + j]


@helper
def moments(sums: Array, mean: Array, S: Array) -> None:
    """From the sums, whose weights add up to 1: mean (n,) of the deviations and covariance S (n,
    n) about it, symmetric to the last bit."""
    n = mean.size
    for j in range(n):
        mean[j] = sums[j]
    for i in range(n):
        for j in range(i + 1):
            S[i, j] = S[j, i] = sums[n + (n + 1) * i + j] - mean[i] * mean[j]


@helper
def root(A: Array, share: float, B: Array, other: float, L: Array) -> int:
    """Lower triangular L with L L' = share A + other B. Returns how many pivots were negative.

    They, and those that are nothing but rounding, count as zero with their columns: a state without
    variance has no part in anything.
    """
    n, negative = A.shape[0], 0
    for j in range(n):
        pivot = share * A[j, j] + other * B[j, j]
        size = abs(share * A[j, j]) + abs(other * B[j, j])
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        if pivot <= NOTHING * size:
            negative += pivot < -NOTHING * size
            for i in range(j, n):
                L[i, j] = 0.0
        else:
            scale = 1 / math.sqrt(pivot)
            L[j, j] = pivot * scale
            for i in range(j + 1, n):
                sum = share * A[i, j] + other * B[i, j]
                for k in range(j):
                    sum -= L[i, k] * L[j, k]
                L[i, j] = sum * scale
        for k in range(j + 1, n):
            L[j, k] = 0.0
    return negative


@inline
def resample_size(n: int) -> int:
    """Numbers of the workspace of `resample`."""
    return 6 * n * n + n + 1


@helper
def resample(
    weights: Array,
    deviations: Array,
    components: Array,
    width: int,
    at: int,
    beside: int,
    S: Array,
    kernel: float,
    stream: Array,
    ancestors: Array,
    drawn: Array,
    Phi: Array,
    work: Array,
) -> int:
    """Draw N components anew, all of weight 1/N, such that the mixture keeps its covariance S (n,
    n) and its mean, about which `deviations` are.

    `components` are flat, of `width` numbers each, `beside` of them side by side; the covariance P (n,
    n) of a component is the n n numbers from its number `at` on.
    Systematic ancestors a, each moved by chol(P_a) times a normal; the sample is recentred and
    rescaled by an affine map, so that with Phi = kernel^2 S for all it has the moments of the
    mixture. `drawn` (N, n) are the new deviations, Phi (n, n) the new covariance. N <= n components
    cannot span S: the ancestors are not moved, only recentred and, where they are spread wider than
    (1 - kernel^2) S in any direction, drawn together; Phi is S less their covariance. Where S
    itself has a negative direction, it counts as none there. Returns the repairs: 1 where they were
    drawn together or S was mended, 0 else. `weights` and `ancestors` (N,) are set, `stream` is
    advanced, `work` has resample_size(n) numbers.
    """
    N, n = drawn.shape
    L, own, T, A = (
        matrix(work, 0, n, n),
        matrix(work, n * n, n, n),
        matrix(work, 2 * n * n, n, n),
        matrix(work, 3 * n * n, n, n),
    )
    kept, mean, random = (
        matrix(work, 4 * n * n, n, n),
        work[5 * n * n : 5 * n * n + n],
        work[5 * n * n + n : 6 * n * n + n + 1],
    )
    systematic(weights, uniform(stream), ancestors)
    _draw(deviations, components, width, at, beside, stream, ancestors, drawn, T, own, random)
    for i in range(N):
        weights[i] = 1 / N
    _centre(drawn, mean, A)
    mended = _mend(S, L, kept)
    wide = N > n
    if wide:
        root(A, 1.0, A, 0.0, own)
        wide = _onto(L, own, T)
    if wide:
        _apply(T, math.sqrt(1 - kernel * kernel), drawn)
        for i in range(n):
            for j in range(n):
                Phi[i, j] = kernel * kernel * kept[i, j]
        return mended
    return max(mended, _fit(kept, A, kernel, drawn, Phi, own))


@helper
def _mend(S: Array, L: Array, kept: Array) -> int:
    """L the root of S, and `kept` S itself, or L L' where S has negative pivots. Returns 1 where
    it has, 0 else."""
    n, negative = S.shape[0], root(S, 1.0, S, 0.0, L) > 0
    for i in range(n):
        for j in range(n):
            kept[i, j] = S[i, j]
            if negative:
                kept[i, j] = 0.0
                for k in range(min(i, j) + 1):
                    kept[i, j] += L[i, k] * L[j, k]
    return 1 if negative else 0


@helper
def _draw(
    deviations: Array,
    components: Array,
    width: int,
    at: int,
    beside: int,
    stream: Array,
    ancestors: Array,
    drawn: Array,
    P: Array,
    L: Array,
    random: Array,
) -> None:
    """The deviations of the ancestors, each moved by a draw from its own covariance where there
    are more components than states."""
    N, n = drawn.shape
    before = -1
    for i in range(N):
        a = int(ancestors[i])
        for k in range(n):
            drawn[i, k] = deviations[a, k]
        if N > n:
            if a != before:
                first = (a // beside * width + at) * beside + a % beside
                for k in range(n):
                    for m in range(n):
                        P[k, m] = components[first + (n * k + m) * beside]
                root(P, 1.0, P, 0.0, L)
                before = a
            normals(stream, random, n)
            for k in range(n):
                for m in range(k + 1):
                    drawn[i, k] += L[k, m] * random[m]


@helper
def _centre(drawn: Array, mean: Array, A: Array) -> None:
    """Subtract the mean of a sample; A becomes its covariance, over N."""
    N, n = drawn.shape
    for k in range(n):
        mean[k] = 0.0
    for i in range(N):
        for k in range(n):
            mean[k] += drawn[i, k] / N
    for k in range(n):
        for m in range(n):
            A[k, m] = 0.0
    for i in range(N):
        for k in range(n):
            drawn[i, k] -= mean[k]
        for k in range(n):
            for m in range(k + 1):
                A[k, m] += drawn[i, k] * drawn[i, m] / N
    for k in range(n):
        for m in range(k):
            A[m, k] = A[k, m]


@helper
def _onto(L: Array, own: Array, T: Array) -> bool:
    """T = L own^-1, lower triangular. Returns whether `own` spans what L does."""
    n = L.shape[0]
    for k in range(n):
        if L[k, k] > 0 and not own[k, k] > 0:
            return False
    for i in range(n):
        for j in range(n):
            T[i, j] = 0.0
        for j in range(i, -1, -1):
            if own[j, j] > 0:
                sum = L[i, j]
                for k in range(j + 1, i + 1):
                    sum -= T[i, k] * own[k, j]
                T[i, j] = sum / own[j, j]
    return True


@helper
def _apply(T: Array, scale: float, drawn: Array) -> None:
    """Each row x of a sample becomes scale T x, T lower triangular."""
    N, n = drawn.shape
    for i in range(N):
        for k in range(n - 1, -1, -1):
            sum = 0.0
            for m in range(k + 1):
                sum += T[k, m] * drawn[i, m]
            drawn[i, k] = scale * sum


@helper
def _fit(S: Array, A: Array, kernel: float, drawn: Array, Phi: Array, L: Array) -> int:
    """Draw a sample of covariance A together until S less it is at least kernel^2 S; Phi becomes
    that. Returns 1 where that was needed."""
    share = 1.0
    while share > 0 and root(S, 1 - kernel * kernel, A, -share, L) > 0:
        share = SHRINK * share if share > NOTHING else 0.0
    for i in range(drawn.shape[0]):
        for k in range(drawn.shape[1]):
            drawn[i, k] *= math.sqrt(share)
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            Phi[i, j] = S[i, j] - share * A[i, j]
    return 1 if share < 1 else 0


def silverman(components: float, n: int) -> float:
    """The kernel width h of that many components in n states: what smooths a Gaussian best;
    Silverman (1986) eq. 4.14. 1 for one component."""
    return min(1.0, (4 / (components * (n + 2))) ** (1 / (n + 4))) if components > 1 else 1.0


def kernel_width(components: float, n: int) -> float:
    """The kernel width h that the filters take where none is given: Silverman's, but for N < 600
    h^2 at least 1 - N/1000.

    At each resampling the covariance of the mixture falls behind its errors by about 4 (1 - h^2)/N
    of it (docs/explanation/particle.md): 0.4 % at most.
    """
    return (
        max(silverman(components, n), math.sqrt(max(0.0, 1 - components / 1000)))
        if components > 1
        else 1.0
    )


def begin(P: Array, components: float, kernel: float, seed: float) -> tuple[Array, Array, Array]:
    """(deviations (N, n), covariance Phi (n, n), stream) of a mixture whose mean is 0 and whose
    covariance is exactly P; drawn from P.

    One component has P itself; with N <= n, which cannot span P, Phi is at least kernel^2 P. Raises
    ValueError for bad options.
    """
    if not (1 <= components <= MAX_COMPONENTS and components == int(components)):
        raise ValueError(
            f"components is {components}; it must be a whole number, at least 1 and at most "
            f"{MAX_COMPONENTS}"
        )
    check_number(kernel, "kernel", above=0, most=1)
    N, n, stream = int(components), len(P), new_stream(seed)
    if N == 1:
        return np.zeros((1, n)), P.copy(), stream
    values, vectors = np.linalg.eigh(
        P / np.outer(*[scale := np.where(np.diag(P) > 0, np.sqrt(np.diag(P)), 1.0)] * 2)
    )
    half = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    white = np.empty((N, n))
    normal_rows(stream, white)
    white -= white.mean(axis=0)
    covariance = white.T @ white / N
    if N > n:
        white, covariance = np.linalg.solve(np.linalg.cholesky(covariance), white.T).T, np.eye(n)
    share = min(1.0, (1 - kernel * kernel) / np.linalg.eigvalsh(covariance)[-1])
    return np.sqrt(share) * white @ half.T, half @ (np.eye(n) - share * covariance) @ half.T, stream
