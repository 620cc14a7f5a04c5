"""The six-state form: against a dense Kalman filter, against each other, against filterpy, and
what each of its parts promises."""

from dataclasses import replace

import numpy as np
import pyins.earth
import pytest
from flat_flight import GRAVITY, NOISE, ORIGIN, flat, flight
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.mathematics.earth import gravity
from strapdown.data.vehicle import Vehicle
from strapdown.engine import stream as live
from strapdown_reproductions.mollaei.six_state import filters

SHORT = pytest.mark.short


UNBOUNDED = Vehicle(speed=np.inf, lowest=-1e300, highest=1e300)


def fused(made, filter, **options):
    recording, start, _ = made
    return sd.fuse(recording, filter, start=start, noise=NOISE, covariance=True, options=options)


def state(solution, start):
    """(n, 6) flat position about the start and velocity."""
    return np.c_[flat(solution.trajectory.lla, start.lla), solution.trajectory.v_n]


def velocity_increments(recording, start):
    """What the IMU says of the velocity in n, without gravity: coning and sculling of two
    samples, third order within one; and the attitudes."""
    C, before, out, attitudes = (
        Rotation.from_euler("ZYX", start.rph[::-1]),
        np.zeros((2, 3)),
        [],
        [],
    )
    for theta, dv in zip(recording.imu.dtheta, recording.imu.dv):
        r = theta + np.cross(before[0], theta) / 12
        a = dv + (np.cross(before[0], dv) + np.cross(before[1], theta)) / 12
        out.append(C.apply(a + np.cross(r, a) / 2 + np.cross(r, np.cross(r, a)) / 6))
        C, before = C * Rotation.from_rotvec(r), np.array([theta, dv])
        attitudes.append(C)
    return np.array(out), Rotation.concatenate(attitudes)


def dense(made, density=None, q=None, r=None):
    """The Kalman filter of the six states with dense matrices: states and covariances after each
    sample. q per sample, r per row, as in the paper."""
    recording, start, _ = made
    dt, I, O = recording.imu.dt[0], np.eye(3), np.zeros((3, 3))
    Phi = np.block([[I, dt * I], [O, I]])
    Q = (
        q * np.eye(6)
        if q
        else density**2 * np.block([[dt**3 / 3 * I, dt**2 / 2 * I], [dt**2 / 2 * I, dt * I]])
    )
    x, P, states, covariances = (
        np.r_[0, 0, 0, start.v_n],
        np.diag(np.array(start.std[:6]) ** 2),
        [],
        [],
    )
    fixes = [
        (
            a.t,
            (flat(a.y, start.lla) if a.kind == "position" else a.y),
            a.std,
            np.eye(6)[:3] if a.kind == "position" else np.eye(6)[3:],
        )
        for a in recording.sources
    ]
    weight = gravity(np.sin(start.lla[0]), start.lla[2]) * dt
    for t, dv in zip(recording.imu.t, velocity_increments(recording, start)[0] + [0, 0, weight]):
        x, P = Phi @ x + np.r_[dt / 2 * dv, dv], Phi @ P @ Phi.T + Q
        for times, y, sigma, H in fixes:
            for k in np.flatnonzero(np.abs(times - t) < 1e-6):
                R = np.diag(sigma[k] ** 2) if r is None else r * I
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
                x, P = (
                    x + K @ (y[k] - H @ x),
                    (np.eye(6) - K @ H) @ P @ (np.eye(6) - K @ H).T + K @ R @ K.T,
                )
        states.append(x)
        covariances.append(P)
    return np.array(states), np.array(covariances)


def opened(made):
    """The flight with gates wide open, as the paper's filters have none."""
    recording, start, truth = made
    return (
        replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources)),
        start,
        truth,
    )


@SHORT
def test_the_ekf_is_the_dense_kalman_filter():
    for made, options, matrices in (
        (opened(flight(8.0)), {}, dict(density=NOISE.accel)),
        (opened(flight(8.0)), filters.REPRODUCED, dict(q=0.1, r=0.5)),
    ):
        solution, (states, covariances) = (
            fused(made, filters.EKF6, **options),
            dense(made, **matrices),
        )
        # metres from radians: 1e-9 of them are rounding of latitude
        assert np.abs(state(solution, made[1]) - states).max() < 1e-7
        assert (
            np.abs(
                solution.covariance[:, :6, :6] / covariances[-1].max()
                - covariances / covariances[-1].max()
            ).max()
            < 1e-11
        )
        assert (
            not solution.covariance[:, 6:].any() and np.isnan(solution.trajectory.std[:, 6:]).all()
        )


@SHORT
def test_without_fixes_and_errors_the_flight_is_found_again():
    """Gravity of the start against the one of pyins: the only part that both the flight and the
    filter take from the same place."""
    recording, start, truth = flight(10.0, noisy=False, gps=100.0)
    solution = fused(
        (recording, start._replace(lla=tuple(ORIGIN), v_n=tuple(truth[0, 3:])), truth), filters.EKF6
    )
    error = np.c_[flat(solution.trajectory.lla), solution.trajectory.v_n] - truth[1:]
    assert np.abs(error).max() < 2e-4
    assert abs(GRAVITY - pyins.earth.gravity(np.degrees(ORIGIN[0]), ORIGIN[2])) < 1e-5
    off = solution.trajectory.rotation.inv() * recording.reference.rotation[1:]
    assert off.magnitude().max() < 1e-7


@SHORT
def test_the_attitude_is_the_start_turned_by_the_gyros_and_no_fix_corrects_it():
    recording, start, _ = made = flight(6.0)
    tilted = start._replace(
        rph=tuple(np.array(start.rph) + [0.02, -0.01, 0.05]), b_g=(1e-3, 0.0, -2e-3)
    )
    solution = fused((recording, tilted, None), filters.EKF6)
    still = replace(
        recording,
        imu=recording.imu._replace(
            dtheta=recording.imu.dtheta - np.array(tilted.b_g) * recording.imu.dt[:, None]
        ),
    )
    expected = velocity_increments(still, tilted)[1]
    assert (
        expected.inv() * solution.trajectory.rotation
    ).magnitude().max() < 1e-6  # coning is taken of the rates with the bias in them
    assert (velocity_increments(*made[:2])[1].inv() * expected).magnitude().max() > 0.01


@SHORT
def test_without_a_filter_the_last_fix_is_held_for_a_second_and_then_there_is_nothing():
    recording, start, _ = made = flight(6.0, cut=3.1)
    solution = fused(made, filters.RAW)
    now, t = state(solution, start), solution.t
    position, velocity = recording.sources
    k = np.searchsorted(position.t, t + 1e-6) - 1
    held = (k >= 0) & (t < 4.0 + 1e-6)
    assert (
        held.sum() == 400 - 19
        and np.abs(now[held, :3] - flat(position.y[k[held]], start.lla)).max() < 1e-7
    )
    assert np.abs(now[held, 3:] - velocity.y[k[held]]).max() < 1e-13
    gone = t > 4.0 + 1e-6
    assert gone.sum() == 200 and np.abs(now[gone]).max() < 1e-7
    assert (
        solution.counts() == {"position": (15, 0), "velocity": (15, 0)}
        and np.isnan(solution.trajectory.std).all()
    )


@SHORT
def test_what_is_not_measured_of_a_fix_changes_nothing_and_a_wild_one_is_rejected():
    recording, start, truth = flight(4.0)
    position, velocity = recording.sources
    flatter = replace(position, y=position.y * [1, 1, np.nan])
    solution = fused((replace(recording, sources=(flatter,)), start, truth), filters.EKF6)
    alone = fused((replace(recording, sources=(position,)), start, truth), filters.EKF6)
    assert np.array_equal(solution.trajectory.lla[:, :2], alone.trajectory.lla[:, :2])
    assert solution.trajectory.std[-1, 2] > 2.0 > 1.0 > alone.trajectory.std[-1, 2]
    y = position.y.copy()
    y[5] += [1e-5, 0, 0]  # 64 m
    wild = fused(
        (replace(recording, sources=(replace(position, y=y), velocity)), start, truth), filters.EKF6
    )
    assert wild.counts()["position"] == (19, 1) and not wild.innovations.accepted[10]
    assert wild.innovations.nis[10] > 1000 and abs(wild.innovations.innovation[10, 0] - 64) < 5


def test_where_the_attitude_is_right_the_covariance_is_honest():
    """NEES of 60 flights of 3 s at the end, 360 degrees of freedom: a true filter fails one time
    in 1000. A wrong attitude it knows nothing of."""
    total = tilted = 0.0
    for seed in range(60):
        recording, start, truth = opened(flight(3.0, seed=seed))
        for begin in (start, start._replace(rph=tuple(np.array(start.rph) + [0.01, 0.0, 0.0]))):
            solution = fused((recording, begin, truth), filters.EKF6)
            error = (
                truth[-1]
                - np.r_[flat(solution.trajectory.lla[-1:])[0], solution.trajectory.v_n[-1]]
            )
            nees = error @ np.linalg.solve(solution.covariance[-1, :6, :6], error)
            total, tilted = total + nees * (begin is start), tilted + nees * (begin is not start)
    assert (
        chi2.ppf(0.0005, 360) < total < chi2.ppf(0.9995, 360) < 3 * chi2.ppf(0.9995, 360) < tilted
    )


LINEAR = [
    (filters.UKF6, {}),
    (filters.UKF6, dict(sigma="symmetric")),
    (filters.UKF6, dict(alpha=1.0, beta=0.0, kappa=-3.0)),
    (filters.CKF6, {}),
    (filters.PKF6, dict(components=1)),
    (filters.PKF6, dict(components=1, transition="sigma-points")),
]


@SHORT
@pytest.mark.parametrize(("filter", "options"), LINEAR)
def test_driven_by_the_imu_all_are_one_filter(filter, options):
    """Also where a jump of all positions lifts the gate, so that the loop changes the covariance
    behind the filter's back."""
    recording, start, truth = flight(6.0, rate=50.0)
    position, velocity = recording.sources
    jumped = replace(
        position, y=position.y + np.where(position.t[:, None] > 1.5, [2e-6, 0, 0], 0), gate=12.0
    )
    made = replace(recording, sources=(jumped, replace(velocity, gate=np.inf))), start, truth
    for more in ({}, filters.REPRODUCED):
        one, other = fused(made, filters.EKF6, **more), fused(made, filter, **options, **more)
        if not more:
            assert (
                one.innovations.t[one.innovations.accepted & (one.innovations.nis > 12)] > 4
            ).any() and one.counts() == other.counts()
        assert np.abs(state(other, start) - state(one, start)).max() < 1e-9
        assert np.abs(other.covariance - one.covariance).max() < 1e-9
        assert (
            np.allclose(other.innovations.nis, one.innovations.nis, rtol=1e-9)
            and not other.events[len(one.events) :]
        )


def test_many_components_are_the_kalman_filter_within_their_monte_carlo_error():
    """24 seeds: their mean is off by no more than its standard error (six t with 23 degrees of
    freedom: 4.6 is 1 in 1400 runs), and the scatter falls with the root of the number of
    components, as the error of a Monte Carlo method does."""
    made = opened(flight(4.0))
    exact = fused(made, filters.EKF6)
    sigma, scatter = exact.trajectory.std[-1, :6], {}
    for count in (125, 500):
        runs = [
            fused(made, filters.PKF6, components=count, kernel=0.5, seed=seed) for seed in range(24)
        ]
        assert min(run.columns["resamplings"][-1] for run in runs) >= 3 and not max(
            run.columns["repairs"][-1] for run in runs
        )
        off = np.array(
            [(state(run, made[1])[-1] - state(exact, made[1])[-1]) / sigma for run in runs]
        )
        scatter[count] = off.std(axis=0, ddof=1)
        assert (np.abs(off.mean(axis=0)) < 4.6 * scatter[count] / np.sqrt(24)).all()
        assert (
            np.abs(np.mean([run.trajectory.std[-1, :6] for run in runs], axis=0) / sigma - 1).max()
            < 0.1
        )
    ratio = np.sqrt((scatter[125] ** 2).mean() / (scatter[500] ** 2).mean())
    assert 1.5 < ratio < 2.7 and np.sqrt((scatter[500] ** 2).mean()) < 0.3, (ratio, scatter)


@SHORT
@pytest.mark.parametrize(
    ("filter", "options"), [(filters.PKF6, dict(components=9, kernel=0.8)), (filters.UKF6, {})]
)
def test_a_stream_is_the_batch_bit_for_bit_and_a_seed_repeats(filter, options):
    recording, start, _ = made = flight(3.0)
    batch = fused(made, filter, **options)
    stream = live.Stream(
        filter, start=start, noise=NOISE, sources=recording.sources, lag=0.1, options=options
    )
    for place, source in enumerate(recording.sources):
        for t, y, std in zip(source.t, source.y, source.std):
            stream.step(live.Measurement(t, place, tuple(y), tuple(std)))
    for sample in zip(*recording.imu):
        stream.step(live.Sample(*sample))
    belief = stream.finish()
    assert np.array_equal(belief.lla, batch.trajectory.lla[-1]) and np.array_equal(
        belief.P, batch.covariance[-1]
    )
    assert np.array_equal(fused(made, filter, **options).covariance, batch.covariance)
    if filter is filters.PKF6:
        assert (
            batch.columns["resamplings"][-1] > 0
            and (
                fused(made, filter, seed=1, **options).covariance[-1] != batch.covariance[-1]
            ).any()
        )


@SHORT
@pytest.mark.parametrize(
    ("filter", "options", "text"),
    [
        (
            filters.EKF6,
            dict(q=-0.1),
            "q is -0.1 m^2 and m^2/s^2; it must be a finite number, 0 or more",
        ),
        (
            filters.EKF6,
            dict(r=np.nan),
            "r is nan m^2 and m^2/s^2; it must be a finite number, 0 or more",
        ),
        (
            filters.EKF6,
            dict(model=-1.0),
            "model is -1.0 m/s/sqrt(s); it must be a finite number, 0 or more",
        ),
        (filters.EKF6, dict(rate=0.0), "rate is 0.0 Hz; it must be a finite number above 0"),
        *(
            (
                filter,
                dict(earth="geodetic"),
                "earth is 'geodetic'; the six-state form knows a flat, still Earth alone",
            )
            for filter in (filters.RAW, filters.EKF6, filters.UKF6, filters.CKF6, filters.PKF6)
        ),
        (filters.EKF6, dict(aircraft="kite"), "unknown aircraft 'kite'"),
        (filters.EKF6, dict(sigma="merwe"), "has no option 'sigma'"),
        (filters.UKF6, dict(sigma="cubic"), "sigma is 'cubic'; it must be one of merwe, symmetric"),
        (filters.UKF6, dict(alpha=0.0), "alpha must be above 0"),
        (
            filters.EKF6,
            dict(linearised="origin"),
            "linearised is 'origin'; it must be one of estimate, trim, once, held",
        ),
        (
            filters.EKF6,
            dict(linearised="once"),
            "linearised='once' needs the airspeed of its trim; give airspeed, m/s",
        ),
        (
            filters.EKF6,
            dict(airspeed=25.0),
            'give linearised="trim", "once" or "held" with it, or leave it out',
        ),
        (
            filters.EKF6,
            dict(linearised="trim", airspeed=-25.0),
            "airspeed is -25.0 m/s; it must be a finite number above 0",
        ),
        (filters.EKF6, dict(linearised="trim", airspeed=8.0), "cannot be trimmed at 8 m/s"),
        (filters.UKF6, dict(linearised="trim"), "has no option 'linearised'"),
        (
            filters.PKF6,
            dict(transition="exact"),
            "transition is 'exact'; it must be one of linearised, sigma-points",
        ),
        (filters.PKF6, dict(components=0), "components is 0; it must be a whole number"),
        (filters.PKF6, dict(components=2.5), "components is 2.5"),
        (filters.PKF6, dict(kernel=0.0), "kernel is 0.0; it must be a finite number above 0"),
        (
            filters.PKF6,
            dict(resample=1.5),
            "resample is 1.5; it must be a finite number, 0 or more and at most 1",
        ),
        (filters.PKF6, dict(seed=-1), "seed is -1"),
        (filters.RAW, dict(q=0.1), "'six-raw' has no option 'q'; it has earth"),
    ],
)
def test_bad_options_are_one_line(filter, options, text):
    with pytest.raises(DataError) as failure:
        fused(flight(1.0), filter, **options)
    assert text in str(failure.value) and "\n" not in str(failure.value)


@SHORT
def test_other_sources_are_left_out_and_a_lever_arm_is_refused():
    recording, start, truth = flight(2.0)
    position, velocity = recording.sources
    with pytest.raises(
        DataError, match="position has a lever arm of .* m; the six-state form knows none"
    ):
        fused(
            (
                replace(recording, sources=(replace(position, parameters=(0.0, 0.0, -0.4)),)),
                start,
                truth,
            ),
            filters.EKF6,
        )
    with pytest.raises(DataError, match="six-ekf needs position aiding"):
        fused((replace(recording, sources=(velocity,)), start, truth), filters.EKF6)
    compass = sd.Source(
        "heading", position.t, np.zeros((len(position.t), 1)), np.full((len(position.t), 1), 0.01)
    )
    with_it = fused(
        (replace(recording, sources=(*recording.sources, compass)), start, truth), filters.EKF6
    )
    assert "six-ekf does not use heading" in with_it.meta["notes"]
    assert np.array_equal(
        with_it.covariance, fused((recording, start, truth), filters.EKF6).covariance
    )


@SHORT
def test_a_fix_of_which_no_component_knows_anything_is_counted():
    """Its likelihood is not finite: weights and components are kept."""
    recording, start, truth = opened(flight(2.0))
    position, velocity = recording.sources
    y = velocity.y.copy()
    y[4, 0] = 1e200
    recording = replace(recording, meta=recording.meta | {"vehicle": UNBOUNDED})
    with np.errstate(over="ignore", invalid="ignore"):
        solution = fused(
            (replace(recording, sources=(position, replace(velocity, y=y))), start, truth),
            filters.PKF6,
            components=8,
        )
    assert solution.columns["degenerate"][-1] == 1 and np.isfinite(state(solution, start)).all()
    assert any("no component has a finite likelihood" in text for _, text in solution.events)


@SHORT
def test_a_fix_that_one_component_alone_explains_underflows_nothing():
    """100 km off, past a gate that lets it through: all likelihoods are zero in double
    precision, and their ratios are not."""
    recording, start, truth = opened(flight(2.0))
    position, velocity = recording.sources
    y = position.y.copy()
    y[4, 2] += 1e5
    recording = replace(recording, meta=recording.meta | {"vehicle": UNBOUNDED})
    solution = fused(
        (replace(recording, sources=(replace(position, y=y), velocity)), start, truth),
        filters.PKF6,
        components=50,
    )
    k = np.searchsorted(solution.t, position.t[4] - 1e-6)
    assert (
        solution.columns["effective_components"][k] < 1.001
        and solution.columns["repairs"][-1] == solution.columns["degenerate"][-1] == 0
        and not solution.events
    )
    assert (
        np.linalg.eigvalsh(solution.covariance[:, :6, :6]).min() > 0
        and np.isfinite(state(solution, start)).all()
    )
