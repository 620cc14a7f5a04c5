"""Noise coefficients of an Allan variance: weighted least squares without negative ones, with
standard errors, and none that could be chance.

The Allan variances of one record at two cluster times are the same periodogram seen through two
filters, G(f) = 4 sin^4(pi f tau) / (pi f tau)^2 of its two-sided spectrum, so they are correlated:
cov = (1/T) int_0^inf S^2 G_1 G_2 df, S two-sided and T the length of the record. Errors of the
coefficients come from that covariance, scaled to the degrees of freedom of NIST SP 1065, not from
the estimates as if each were new evidence.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..sensor_models.noise import FLICKER_FLOOR, gauss_markov_variance
from ..typing import Array, Ints

THRESHOLD = 2.0
"""A coefficient is present where its square exceeds this many of the standard errors that it has
where it is absent."""


MODEL_ERROR = 0.02
"""Relative error of the model itself that weights allow for: thousands of short clusters must
not bend the curve where real noise is not quite white."""


class Coefficient(NamedTuple):
    """A term of the Allan variance: value^2 times `basis`(tau); its two-sided rate spectrum is
    value^2 times `spectrum`(f, dt)."""

    units: dict[str, str]  # SI unit for "gyro" and "accel"
    kind: str  # of its degrees of freedom, see `edf`
    basis: Callable[[Array], Array]
    spectrum: Callable[[Array, float], Array]


def _units(gyro: str, accel: str) -> dict[str, str]:
    return {"gyro": gyro, "accel": accel}


def _without_time(*_: Array | float) -> Array:
    """Stands where a term has a shape only for a given time constant: `markov_shape` makes it."""
    raise TypeError("a Gauss-Markov bias needs its time constant")


Shapes: TypeAlias = dict[str, Coefficient]
"""Terms by name."""
COEFFICIENTS: Shapes = {
    "quantisation": Coefficient(
        _units("rad", "m/s"),
        "white phase",
        lambda tau: 3 / tau**2,
        lambda f, dt: dt * (2 * np.pi * f) ** 2,
    ),
    "white noise": Coefficient(
        _units("rad/sqrt(s)", "m/s/sqrt(s)"),
        "white",
        lambda tau: 1 / tau,
        lambda f, dt: np.ones_like(f),
    ),
    "bias instability": Coefficient(
        _units("rad/s", "m/s^2"),
        "flicker",
        lambda tau: np.full_like(tau, FLICKER_FLOOR**2),
        lambda f, dt: 1 / (2 * np.pi * f),
    ),
    "rate random walk": Coefficient(
        _units("rad/s/sqrt(s)", "m/s^2/sqrt(s)"),
        "walk",
        lambda tau: tau / 3,
        lambda f, dt: 1 / (2 * np.pi * f) ** 2,
    ),
    "rate ramp": Coefficient(
        _units("rad/s^2", "m/s^3"), "walk", lambda tau: tau**2 / 2, lambda f, dt: np.zeros_like(f)
    ),
    "gauss-markov": Coefficient(_units("rad/s", "m/s^2"), "flicker", _without_time, _without_time),
    "time constant": Coefficient(_units("s", "s"), "flicker", _without_time, _without_time),
}
"""Q, N, B, K, R of IEEE Std 952-1997, C.1, and the standard deviation and time constant of a
Gauss-Markov bias; quantisation is a step / sqrt(12)."""
ALWAYS = ("quantisation", "white noise", "rate random walk", "rate ramp")


def edf(kinds: NDArray[np.str_], n: int, sizes: Ints) -> Array:
    """Equivalent degrees of freedom (k,) of overlapping estimates from n samples at `sizes`, where
    `kinds` (k,) of noise rule.

    NIST SP 1065, table 5 (simple formulas, N = n + 1 phases): "white phase", "white", "flicker" and
    "walk" of the rate.
    """
    N, m = n + 1.0, np.asarray(sizes, float)
    each = {
        "white phase": (N + 1) * (N - 2 * m) / (2 * (N - m)),
        "white": (3 * (N - 1) / (2 * m) - 2 * (N - 2) / N) * 4 * m**2 / (4 * m**2 + 5),
        "flicker": np.where(
            m == 1, 2 * (N - 2) / (2.3 * N - 4.9) * (N - 2), 5 * N**2 / (4 * m * (N + 3 * m))
        ),
        "walk": (N - 2) / m * ((N - 1) ** 2 - 3 * m * (N - 1) + 4 * m**2) / (N - 3) ** 2,
    }
    return np.maximum(
        np.select([np.asarray(kinds) == kind for kind in each], list(each.values())), 1.0
    )


class AllanFit(NamedTuple):
    """Coefficients of one curve in SI by name; NaN where absent, then `limit` is the value above
    which it would have been seen."""

    value: dict[str, float]
    std: dict[str, float]
    limit: dict[str, float]
    # rms of the logarithm of fitted over estimated deviation, of that of clusters up to a tenth of
    # the longest
    misfit: float
    shapes: Shapes  # of the terms

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all coefficients looked for."""
        return tuple(self.value)

    @property
    def present(self) -> tuple[str, ...]:
        """Names of those that are there."""
        return tuple(name for name, value in self.value.items() if np.isfinite(value))

    def parts(self, tau: Array) -> dict[str, Array]:
        """{name: Allan variance at `tau`} of each present term."""
        return {
            name: self.value[name] ** 2 * shape.basis(tau)
            for name, shape in self.shapes.items()
            if np.isfinite(self.value[name])
        }

    def deviation(self, tau: Array) -> Array:
        """Fitted Allan deviation at `tau`."""
        return np.sqrt(sum(self.parts(tau).values(), np.zeros_like(tau)))

    def dominant(self, tau: Array) -> NDArray[np.str_]:
        """Kind of noise that rules at each `tau`."""
        parts = self.parts(tau)
        if not parts:
            return np.full(len(tau), "white")
        kinds = np.array([self.shapes[name].kind for name in parts])
        return kinds[np.argmax(np.stack(list(parts.values())), axis=0)]


def fit(
    tau: Array,
    variance: Array,
    n: int,
    sizes: Ints,
    dt: float,
    axes: int = 1,
    gauss_markov: bool = False,
) -> AllanFit:
    """The AllanFit of Allan variances (k,) at cluster times `tau` (k,) s of n samples of `dt` s;
    `axes` independent records were averaged into it."""
    problem = _Problem(tau, variance, n, sizes, dt, axes)
    always = {name: COEFFICIENTS[name] for name in ALWAYS}
    if not gauss_markov:
        shapes = always | {"bias instability": COEFFICIENTS["bias instability"]}
        return _sort_coefficients(
            problem.solve({name: shapes[name] for name in COEFFICIENTS if name in shapes})
        )
    from scipy.optimize import minimize_scalar

    def shapes_at(log_time: float) -> Shapes:
        return always | {"gauss-markov": markov_shape(np.exp(log_time))}

    def cost(log_time: float) -> float:
        return problem.cost(shapes_at(log_time))

    grid = np.log(np.geomspace(3 * tau[0], 3 * tau[-1], 40))
    best = grid[int(np.argmin([cost(each) for each in grid]))]
    width = grid[1] - grid[0]
    best = minimize_scalar(cost, bounds=(best - width, best + width), method="bounded").x
    return _sort_coefficients(
        _with_time(problem, problem.solve(shapes_at(best)), float(np.exp(best)))
    )


def markov_shape(time: float) -> Coefficient:
    """The Coefficient of a Gauss-Markov bias of time constant `time`, s."""
    return Coefficient(
        COEFFICIENTS["gauss-markov"].units,
        "flicker",
        lambda tau: gauss_markov_variance(tau, time),
        lambda f, dt: 2 * time / (1 + (2 * np.pi * f * time) ** 2),
    )


def _sort_coefficients(found: AllanFit) -> AllanFit:
    """The AllanFit with its coefficients in the order of COEFFICIENTS."""

    def sort(table: dict[str, float]) -> dict[str, float]:
        return {name: table[name] for name in COEFFICIENTS if name in table}

    return found._replace(value=sort(found.value), std=sort(found.std), limit=sort(found.limit))


def _with_time(problem: "_Problem", found: AllanFit, time: float) -> AllanFit:
    """Add the time constant of the Gauss-Markov term, its standard error from the slope of the
    curve."""
    value, std = np.nan, np.nan
    if "gauss-markov" in found.present:
        square, step = found.value["gauss-markov"] ** 2, 1e-4 * time
        slope = (
            square
            * (
                gauss_markov_variance(problem.tau, time + step)
                - gauss_markov_variance(problem.tau, time - step)
            )
            / (2 * step)
        )
        active = [found.shapes[name] for name in found.present]
        matrix = np.column_stack([*(shape.basis(problem.tau) for shape in active), slope])
        covariance, weights = problem.model(
            active, np.array([found.value[name] for name in found.present]) ** 2
        )
        spread = _estimator(matrix, weights) @ covariance @ _estimator(matrix, weights).T
        value, std = time, float(np.sqrt(spread[-1, -1]))
        at = found.present.index("gauss-markov")
        found.std["gauss-markov"] = float(
            np.sqrt(spread[at, at]) / (2 * found.value["gauss-markov"])
        )

    def extra(table: dict[str, float], number: float) -> dict[str, float]:
        return {**table, "time constant": number}

    return found._replace(
        value=extra(found.value, value), std=extra(found.std, std), limit=extra(found.limit, np.nan)
    )


class _Problem:
    """Allan variances to be explained, and what their errors are under a model."""

    def __init__(
        self, tau: Array, variance: Array, n: int, sizes: Ints, dt: float, axes: int
    ) -> None:
        from scipy.stats import chi2

        self.tau, self.variance, self.n, self.sizes, self.dt, self.axes = (
            tau,
            variance,
            n,
            sizes,
            dt,
            axes,
        )
        self.f = np.geomspace(0.02 / (n * dt), 0.5 / dt, 1000)
        x = np.pi * self.f[:, None] * tau
        self.filters = 4 * np.sin(x) ** 4 / x**2
        self.band = np.gradient(self.f)
        degrees = axes * edf(np.full(len(tau), "walk"), n, sizes)
        self.cautious = 2 / degrees + MODEL_ERROR**2
        self.highest = variance * degrees / chi2.ppf(0.001, degrees)

    def model(self, shapes: Sequence[Coefficient], squares: Iterable[float]) -> tuple[Array, Array]:
        """(covariance (k, k) of the variances, weights (k,) of the fit) under the model of
        `squares` (values squared) of `shapes`."""
        parts = np.stack([square * shape.basis(self.tau) for shape, square in zip(shapes, squares)])
        kinds = np.array([shape.kind for shape in shapes])[np.argmax(parts, axis=0)]
        relative = 2 / (self.axes * edf(kinds, self.n, self.sizes))
        total = parts.sum(axis=0)
        spectrum = sum(
            square * shape.spectrum(self.f, self.dt) for shape, square in zip(shapes, squares)
        )
        shared = (self.filters * (spectrum**2 * self.band)[:, None]).T @ self.filters
        scale = np.sqrt(np.diag(shared)) if shared.any() else np.ones(len(total))
        correlation = shared / np.outer(scale, scale) if shared.any() else np.eye(len(total))
        std = total * np.sqrt(relative)
        return correlation * np.outer(std, std), 1 / (total**2 * (relative + MODEL_ERROR**2))

    def squares(self, shapes: Sequence[Coefficient]) -> Array:
        """Values squared of `shapes`, weights and fit in turn until they agree; 0 or more, and none
        above what every single cluster time allows.

        The upper bound matters where a record holds what the model does not, say a vibration: its
        hump must not lift the rest of the curve.
        """
        matrix = np.column_stack([shape.basis(self.tau) for shape in shapes])
        most = (self.highest[:, None] / matrix).min(axis=0)
        weights = 1 / (self.variance**2 * self.cautious)
        for _ in range(8):
            found = _bounded_least_squares(matrix, self.variance, weights, most)
            weights = 1 / (np.maximum(matrix @ found, 0.1 * self.variance) ** 2 * self.cautious)
        return found

    def cost(self, shapes: Shapes) -> float:
        """Weighted sum of squares of what `shapes` leave unexplained."""
        terms = list(shapes.values())
        squares = self.squares(terms)
        total = np.column_stack([shape.basis(self.tau) for shape in terms]) @ squares
        return float(np.sum((self.variance / total - 1) ** 2 / self.cautious))

    def solve(self, shapes: Shapes) -> AllanFit:
        """The AllanFit of those `shapes` that are there: the weakest that could be chance is left
        out, until none could."""
        active = dict(shapes)
        while True:
            squares = dict(zip(active, self.squares(list(active.values()))))
            absent = [name for name in active if squares[name] == 0]
            if not absent and len(active) > 1:
                strength = {
                    name: squares[name] / self.chance(shapes, active, name) for name in active
                }
                weakest = min(strength, key=lambda name: strength[name])
                absent = [weakest] if strength[weakest] < THRESHOLD else []
            if not absent:
                return self.result(shapes, active, squares)
            active = {name: shape for name, shape in active.items() if name not in absent}

    def chance(self, shapes: Shapes, active: Shapes, name: str) -> float:
        """Standard error that the square of `name`, fitted beside the `active` others, has where
        it is absent and any other of `shapes` may be there."""
        others = [shape for other, shape in shapes.items() if other != name]
        covariance, weights = self.model(others, self.squares(others))
        beside = [shape.basis(self.tau) for other, shape in active.items() if other != name]
        row = _estimator(np.column_stack([shapes[name].basis(self.tau), *beside]), weights)[0]
        return float(np.sqrt(row @ covariance @ row))

    def result(self, shapes: Shapes, active: Shapes, squares: dict[str, float]) -> AllanFit:
        """The AllanFit with standard errors of what is there, and limits of what is not."""
        names = list(active)
        covariance, weights = self.model(list(active.values()), [squares[name] for name in names])
        estimator = _estimator(
            np.column_stack([shape.basis(self.tau) for shape in active.values()]), weights
        )
        spread = np.sqrt(np.diag(estimator @ covariance @ estimator.T))
        value, std, limit = ({name: np.nan for name in shapes} for _ in range(3))
        for name, error in zip(names, spread):
            value[name] = float(np.sqrt(squares[name]))
            std[name] = float(error / (2 * value[name]))
        for name in set(shapes) - set(names):
            limit[name] = float(np.sqrt(THRESHOLD * self.chance(shapes, active, name)))
        found = AllanFit(value, std, limit, 0.0, shapes)
        sure = self.tau <= max(0.1 * self.tau[-1], self.tau[min(2, len(self.tau) - 1)])
        return found._replace(
            misfit=float(
                np.sqrt(
                    np.mean(np.log(found.deviation(self.tau)[sure] ** 2 / self.variance[sure]) ** 2)
                )
                / 2
            )
        )


def _bounded_least_squares(matrix: Array, variance: Array, weights: Array, most: Array) -> Array:
    """Least squares of `matrix` x = `variance` with `weights`, 0 <= x <= `most`."""
    from scipy.optimize import lsq_linear, nnls

    scaled = matrix * np.sqrt(weights)[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    found = nnls(scaled / norm, variance * np.sqrt(weights))[0] / norm
    if (found > most).any():
        found = (
            lsq_linear(
                scaled / norm, variance * np.sqrt(weights), (0, most * norm), method="bvls"
            ).x
            / norm
        )
    return np.maximum(found, 0.0)


def _estimator(matrix: Array, weights: Array) -> Array:
    """(parameters, k) linear estimator of weighted least squares."""
    scaled = matrix * np.sqrt(weights)[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    return np.linalg.pinv(scaled / norm) * np.sqrt(weights) / norm[:, None]
