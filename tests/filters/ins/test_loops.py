"""The four loops against each other and against a textbook filter with dense matrices."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from recordings import OPTIONS, SWIFT, ahrs, flight, same, start
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import dynamics
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.data.vehicle import Vehicle
from strapdown.geometry.geodesy import displace_lla, displacement

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)


def fused(recording, name, **options):
    return sd.fuse(
        recording, name, start=start(recording), noise=NOISE, covariance=True, options=options
    )


def difference(a, b):
    """Largest differences: position m, velocity m/s, attitude rad, biases in their std, std
    relative."""
    return (
        np.abs(displacement(a.trajectory.lla, b.trajectory.lla)).max(),
        np.abs(a.trajectory.v_n - b.trajectory.v_n).max(),
        (a.trajectory.rotation * b.trajectory.rotation.inv()).magnitude().max(),
        np.abs((np.c_[a.b_a, a.b_g] - np.c_[b.b_a, b.b_g]) / b.trajectory.std[:, 9:]).max(),
        np.abs(a.trajectory.std / b.trajectory.std - 1).max(),
    )


def test_reset_at_every_fix_is_the_closed_loop():
    p, v, attitude, bias, deviation = difference(
        fused(flight(), "periodic-reset", interval=0.0), fused(flight(), "closed-loop")
    )
    assert p < 1e-7 and v < 1e-9 and attitude < 1e-11 and bias < 1e-6 and deviation < 1e-9


def test_never_reset_is_the_open_loop():
    assert same(fused(flight(), "periodic-reset", interval=np.inf), fused(flight(), "open-loop"))


def test_an_interval_between_differs_from_both():
    between = fused(flight(), "periodic-reset", interval=6.0)
    assert (
        min(difference(between, fused(flight(), name))[0] for name in ("open-loop", "closed-loop"))
        > 1e-7
    )


def test_bias_in_the_ins_and_in_the_error_state_agree_per_step_to_second_order():
    """One step of each; the difference falls with the square of dt (halved: by 4), so that over
    a run of a given length it falls with dt."""

    def step(dt):
        imu = flight(2.0, 20.0).imu
        one = replace(
            flight(2.0, 20.0),
            sources=(),
            imu=type(imu)(
                np.array([dt, 2 * dt]),
                np.full(2, dt),
                *(column[:2] * (dt / imu.dt[0]) for column in imu[2:]),
            ),
        )
        begin = start(flight(2.0, 20.0))._replace(b_a=(0.5, -0.3, 0.2), b_g=(0.02, -0.03, 0.01))
        a, b = (
            sd.fuse(one, name, start=begin, noise=NOISE)
            for name in ("closed-loop", "closed-loop-error-bias")
        )
        return np.linalg.norm((a.trajectory.v_n - b.trajectory.v_n)[0])

    coarse, fine = step(0.1), step(0.05)
    assert 0 < fine < 1e-3 and 3.5 < coarse / fine < 9


def test_the_loops_agree_to_first_order_for_small_errors():
    closed = fused(flight(), "closed-loop")
    for name in ("mekf", "open-loop", "closed-loop-error-bias", "periodic-reset"):
        p, v, attitude, bias, _ = difference(fused(flight(), name), closed)
        assert p < 0.05 and v < 0.02 and attitude < 1e-3 and bias < 0.2, name


def test_the_raw_ins_of_the_open_loop_is_the_belief_less_its_error():
    """The columns ins_error_* are the way from the raw INS, run alone without fixes, to the
    corrected belief."""
    recording = flight()
    solution = fused(recording, "open-loop")
    shift = np.stack(
        [solution.columns[f"ins_error_{axis} [m]"] for axis in ("north", "east", "down")], axis=1
    )
    raw = replace(recording, sources=())
    alone = sd.fuse(raw, "open-loop", start=start(recording), noise=NOISE)
    assert np.abs(displacement(solution.trajectory.lla, alone.trajectory.lla) - shift).max() < 1e-3
    assert np.abs(shift).max() > 0.1


def test_the_printed_error_model_moves_the_open_loop_and_hardly_the_closed_one():
    shift = {
        name: difference(fused(flight(), name, error_model="literal"), fused(flight(), name))
        for name in ("open-loop", "closed-loop")
    }
    assert 0 < shift["closed-loop"][0] < 1e-3 and 0 < shift["open-loop"][2]


def textbook(recording, begin):
    """The closed loop with dense F, matrix exponentials and the Joseph form; yields (lla, v, C,
    P) at each sample."""
    lla, v, C = (
        np.array(begin.lla),
        np.array(begin.v_n),
        Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix(),
    )
    b_a, b_g, P = np.zeros(3), np.zeros(3), np.diag(np.square(begin.std))
    previous = None
    for k, t in enumerate(recording.imu.t):
        dt, rotation, force = recording.imu.dt[k], recording.imu.dtheta[k], recording.imu.dv[k]
        r, a = rotation.copy(), force.copy()
        if previous is not None:
            r += np.cross(previous[0], rotation) / 12
            a += (np.cross(previous[0], force) + np.cross(previous[1], rotation)) / 12
        previous = rotation, force
        r, a = r - b_g * dt, a - b_a * dt
        middle = C @ Rotation.from_rotvec(r / 2).as_matrix()
        F, Q = dynamics(lla, v, middle, middle @ a / dt, NOISE)
        van_loan = expm(np.block([[-F, Q], [np.zeros((15, 15)), F.T]]) * dt)
        Phi = van_loan[15:, 15:].T
        P = Phi @ P @ Phi.T + Phi @ van_loan[:15, 15:]
        mechanize(lla, v, C, r, a, dt, np.zeros(3))
        b_a, b_g = b_a * np.exp(-NOISE.accel_decay * dt), b_g * np.exp(-NOISE.gyro_decay * dt)
        for source in recording.sources:
            for row in np.flatnonzero(np.abs(source.t - t) < 1e-6):
                arm, H = C @ source.parameters, np.zeros((3, 15))
                if source.kind == "position":
                    e = displacement(source.y[row], lla) - arm
                    H[:, :3], H[:, 6:9] = (
                        np.eye(3),
                        np.array(
                            [[0, arm[2], -arm[1]], [-arm[2], 0, arm[0]], [arm[1], -arm[0], 0]]
                        ),
                    )
                else:
                    swing = C @ np.cross(r / dt, source.parameters)
                    e = source.y[row] - v - swing
                    H[:, 3:6], H[:, 6:9] = (
                        np.eye(3),
                        np.array(
                            [
                                [0, swing[2], -swing[1]],
                                [-swing[2], 0, swing[0]],
                                [swing[1], -swing[0], 0],
                            ]
                        ),
                    )
                    H[:, 12:15] = C @ np.array(
                        [
                            [0, -source.parameters[2], source.parameters[1]],
                            [source.parameters[2], 0, -source.parameters[0]],
                            [-source.parameters[1], source.parameters[0], 0],
                        ]
                    )
                R = np.diag(source.std[row] ** 2)
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
                keep = np.eye(15) - K @ H
                P, dx = keep @ P @ keep.T + K @ R @ K.T, K @ e
                turn = np.eye(15)  # of the attitude error that is left
                turn[6:9, 6:9] = Rotation.from_rotvec(dx[6:9] / 2).as_matrix()
                P = turn @ P @ turn.T
                lla, v, C = (
                    displace_lla(lla, dx[:3]),
                    v + dx[3:6],
                    Rotation.from_rotvec(dx[6:9]).as_matrix() @ C,
                )
                b_a, b_g = b_a + dx[9:12], b_g + dx[12:15]
        yield lla.copy(), v.copy(), C.copy(), P.copy()


def test_the_closed_loop_is_the_textbook_filter():
    recording = flight(5.0, 20.0)
    recording = replace(
        recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources)
    )
    solution = fused(recording, "closed-loop")
    lla, v, C, P = (np.array(part) for part in zip(*textbook(recording, start(recording))))
    assert np.abs(displacement(solution.trajectory.lla, lla)).max() < 2e-5
    assert np.abs(solution.trajectory.v_n - v).max() < 2e-5
    assert (solution.trajectory.rotation * Rotation.from_matrix(C).inv()).magnitude().max() < 1e-6
    scale = np.sqrt(np.einsum("kii->ki", P))
    assert np.abs((solution.covariance - P) / (scale[:, :, None] * scale[:, None, :])).max() < 1e-4


@pytest.mark.parametrize("name", SWIFT)
def test_covariances_stay_symmetric_and_positive(name):
    recording = flight()
    P = fused(
        replace(recording, sources=(*recording.sources, ahrs(recording.reference))),
        name,
        **OPTIONS.get(name, {}),
    ).covariance
    # a filter of attitude alone leaves the rows of the other states at zero
    own = np.flatnonzero(np.diagonal(P[0]))
    assert np.array_equal(P, P.transpose(0, 2, 1)) and not np.delete(P, own, axis=1).any()
    P = P[:, own][:, :, own]
    assert (
        np.linalg.eigvalsh(P / np.sqrt(np.einsum("ki,kj->kij", *[np.einsum("kii->ki", P)] * 2))) > 0
    ).all()


@pytest.mark.parametrize("name", filters.names())
def test_a_filter_pickles_as_its_name(name):
    assert (
        pickle.loads(pickle.dumps(filters.find(name))) is filters.find(name)
        and len(pickle.dumps(filters.find(name))) < 200
    )


@pytest.mark.parametrize(
    "name, options, message",
    [
        ("periodic-reset", {"interval": -1.0}, "interval is -1"),
        ("periodic-reset", {"interval": np.nan}, "interval is nan"),
        ("closed-loop", {"error_model": "wrong"}, "corrected, literal"),
        ("open-loop", {"interval": 1.0}, "has no option 'interval'"),
        ("closd-loop", {}, "did you mean 'closed-loop'"),
    ],
)
def test_bad_options_are_refused_by_name(name, options, message):
    with pytest.raises(DataError, match=message):
        fused(flight(), name, **options)


@pytest.mark.parametrize(
    "name, gone", [("open-loop", True), ("periodic-reset", True), ("closed-loop", False)]
)
def test_a_raw_ins_that_leaves_the_model_is_an_event(name, gone):
    """9 km/s^2 of unknown acceleration upwards for ten seconds."""
    recording = flight()
    falling = replace(
        recording,
        imu=recording.imu._replace(
            dv=recording.imu.dv - np.outer(recording.imu.dt, [0, 0, 9000.0])
        ),
    )
    solution = sd.fuse(
        falling,
        name,
        start=start(recording),
        noise=sd.imu("tactical").noise(),
        vehicle=Vehicle(speed=1e6, acceleration=1e4, lowest=-1e7, highest=1e7),
    )
    events = [(t, text) for t, text in solution.events if "raw INS left the model" in text]
    assert bool(events) == gone
    if gone:
        assert (
            events[0][0] == pytest.approx(np.sqrt(2 * 500e3 / 9000), abs=0.5)
            and "beyond 500 km" in events[0][1]
        )
