"""What a solution says of parameters that were states: against the errors that were put in, and
against what its own numbers must lead to."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import at_rest, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data import calibration_parameters
from strapdown.data.solution import Source
from strapdown.engine.installation import with_estimates
from strapdown.installation import screening
from strapdown.installation.states import estimated_installation
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion

pytestmark = pytest.mark.short
SECONDS = 60.0
NUMBERS = ("given", "change", "std", "value", "prior")


def wrong(recording, arm=(0.0, 0.0, 0.0), clock=0.0):
    """The recording whose antenna is given wrong by `arm` (m), and whose stamps are by `clock`
    (s), less than the truth."""
    return replace(
        recording,
        sources=tuple(
            replace(a, t=a.t - clock, parameters=tuple(np.array(a.parameters) - arm))
            for a in recording.sources
        ),
    )


def by_name(solution):
    return {
        (each.parameter, each.component): each
        for each in estimated_installation(solution).parameters
    }


def moving(name, course, speed, roll=0.0, seed=1003, **gnss):
    """A simulated recording of level motion along a course (deg), at a speed and roll (m/s, deg), all
    functions of time."""
    motion = Motion(
        name,
        (DEG * 47.0, DEG * 8.0, 500.0),
        lambda t: (speed(t) * np.cos(DEG * course(t)), speed(t) * np.sin(DEG * course(t)), 0 * t),
        lambda t: (DEG * roll * np.sin(0.23 * t), 0 * t, DEG * course(t)),
    )
    return sd.simulate(motion, SECONDS, "tactical", seed, 20.0, Gnss(**gnss))


@pytest.fixture(scope="module")
def turning():
    """It winds, faster and slower, with an accurate receiver."""
    return moving(
        "winding",
        lambda t: 80 + 60 * np.sin(0.3 * t),
        lambda t: 15 + 5 * np.sin(0.17 * t),
        20.0,
        position_std=0.3,
        velocity_std=0.03,
        lever_arm=(0.3, -0.2, -0.5),
    )


def straight(**more):
    """Straight and level at 30 m/s: what it shows of an antenna is nothing."""
    return moving("straight", lambda t: 80 + 0 * t, lambda t: 30.0 + 0 * t, **more)


@pytest.mark.parametrize("run", [sd.fuse, sd.smooth])
def test_what_is_wrong_is_found_in_the_terms_of_the_file(turning, run):
    recording = wrong(turning, (1.0, -0.8, 0.0), 0.1)
    recording = replace(recording, meta=recording.meta | {"imu_lever_arm": [0.2, 0.0, -1.0]})
    solution = run(recording, start=start(turning), estimate=["clock", "lever-arm"])
    found = by_name(solution)
    for key, error, given in (
        (("clock", ""), 0.1, 0.0),
        (("lever-arm", "forward"), 1.0, 0.3 - 1.0 + 0.2),
        (("lever-arm", "right"), -0.8, -0.2 + 0.8),
    ):
        each = found[key]
        assert each.status == "found" and abs(each.change - error) < 3 * each.std < 0.5
        assert each.given == pytest.approx(given) and each.value == pytest.approx(
            given + each.change
        )
    clock = found["clock", ""]
    column = "clock error of GNSS position [s]"
    assert clock.change == solution.columns[column][-1] and clock.prior == 0.1
    assert clock.std == solution.columns[f"std of {column}"][-1]
    assert clock.name == "clock of GNSS position and GNSS velocity" and clock.unit == "s"
    assert str(clock) == f"{clock.name}: found, {clock.seen} from the given value"
    assert str(found["lever-arm", "right"]).startswith(
        f"lever arm right of GNSS position and GNSS velocity: found: "
        f"{found['lever-arm', 'right'].value:.3f} m, -0."
    )


def test_what_is_right_is_consistent(turning):
    found = by_name(sd.fuse(turning, start=start(turning), estimate=["clock", "lever-arm"]))
    assert found["clock", ""].status == found["lever-arm", "right"].status == "consistent"
    assert "consistent with the given value (" in str(found["clock", ""])


def with_odometer(recording, scale):
    """With the speed of the reference, times scale."""
    t = np.arange(1.0, SECONDS, 0.5)
    truth = recording.reference
    speed = np.interp(t, truth.t, np.linalg.norm(truth.v_n, axis=1))
    odometer = Source("speed", t, scale * speed[:, None], np.full((len(t), 1), 0.05), (0.0,) * 3)
    return replace(recording, sources=(*recording.sources, odometer))


def test_a_scale_is_told_as_what_its_file_must_be_multiplied_by(turning):
    recording = with_odometer(turning, 1.03)
    solution = sd.fuse(recording, start=start(turning), estimate=["scale"])
    (scale,) = estimated_installation(solution).parameters
    assert scale.status == "found" and scale.change == pytest.approx(0.03, abs=2e-3)
    assert scale.value == pytest.approx(1 / 1.03, abs=2e-3)
    assert str(scale).startswith("scale of speed: found: it reads 3.0 % too much, a difference of")
    assert str(scale).endswith(f"; multiply its scale by {scale.value:.4f}")
    # what is told, done, leaves nothing to find
    right = [replace(a, y=a.y * scale.value) if a.kind == "speed" else a for a in recording.sources]
    again = sd.fuse(
        replace(recording, sources=tuple(right)), start=start(turning), estimate=["scale"]
    )
    assert abs(estimated_installation(again).parameters[0].change) < 1e-4


@pytest.mark.parametrize("given", [None, 3, "solution.nc"])
def test_what_is_no_solution_is_refused(given):
    with pytest.raises(DataError, match="it must be a Solution"):
        estimated_installation(given)


def test_numbers_are_plain_floats(turning):
    solution = sd.fuse(turning, start=start(turning), estimate=["clock", "mounting"])
    for each in estimated_installation(solution).parameters:
        assert {type(vars(each)[name]) for name in NUMBERS} == {float}


def test_the_stamps_of_a_reference_are_doubted_with_those_of_the_receiver(turning, tmp_path):
    recording = wrong(turning, clock=0.1)
    meta = {key: value for key, value in recording.meta.items() if key not in ("b_a", "b_g")}
    truth = recording.reference
    logged = replace(recording, meta=meta, reference=replace(truth, t=truth.t - 0.1))
    solution = sd.fuse(logged, start=start(turning), estimate=["clock"])
    found = estimated_installation(solution)
    assert found.of_reference == found.told[-1]
    assert found.of_reference.startswith(
        "the reference keeps its time stamps: where it comes from "
    )
    assert f"off by {found.parameters[0].seen}" in found.of_reference
    sd.report(solution, logged.reference).save(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "The reference may itself be wrong: the reference keeps its time stamps" in page
    for other in (recording, replace(logged, reference=None)):
        assert not estimated_installation(
            sd.fuse(other, start=start(turning), estimate=["clock"])
        ).of_reference


def test_the_other_source_of_an_antenna_is_taken_as_right_in_time(turning):
    solution = sd.fuse(turning, start=start(turning), estimate=["position clock"])
    assert estimated_installation(solution).remarks == (
        "clock of GNSS position: GNSS velocity of the same antenna is assumed to have correct times; where "
        "one receiver stamps both, estimate the clocks of both",
    )


def test_an_attitude_is_of_the_imu_whatever_its_mounting(turning):
    zeros = np.zeros((1, 3))
    ahrs = Source("attitude", np.array([SECONDS - 1]), zeros, zeros + 1e3, (), name="AHRS")
    solution = sd.fuse(turning, start=start(turning), estimate=["mounting"])
    assert not [text for text in estimated_installation(solution).remarks if "own axes" in text]
    kinds = solution.meta["kinds"] | {ahrs.name: ahrs.kind}
    remarks = estimated_installation(
        replace(solution, meta=solution.meta | {"kinds": kinds})
    ).remarks
    assert "the mounting is estimated with AHRS assumed to be in the IMU's own axes" in remarks


def test_a_tight_prior_is_no_reason_to_go_driving(turning):
    solution = sd.fuse(turning, start=start(turning), estimate={"clock": 1e-4})
    found = estimated_installation(solution)
    assert str(found.parameters[0]).endswith("); the prior is as tight as the data")
    assert found.remarks == ()


def test_what_no_motion_shows_is_said_with_the_motion_that_would():
    recording = straight()
    solution = sd.fuse(recording, start=start(recording), estimate=["lever-arm"])
    found = by_name(solution)
    assert found["lever-arm", "right"].status == "not observable"
    text = str(found["lever-arm", "right"])
    assert text.endswith(", prior 0.5 m); to show it, turn, to both sides")
    assert "(std 0." in text


def test_two_clocks_cannot_be_told_apart_at_one_speed():
    """Two antennas show the difference of their clocks, and nothing what they have in common."""
    recording, more = straight(), straight(seed=1004, lever_arm=(2.0, 0.0, 0.0))
    front = replace(more.sources[0], name="front")
    recording = replace(recording, sources=(recording.sources[0], front))
    solution = sd.fuse(recording, start=start(recording), estimate=["clock"])
    (remark,) = estimated_installation(solution).remarks
    assert remark.startswith(
        "the data cannot separate clock of GNSS position and clock of front (correlation +0.9"
    )
    assert remark.endswith("): estimate one of them, or accelerate, brake or turn")


def test_without_a_source_of_velocity_that_is_said():
    recording = straight()
    alone = replace(recording, sources=recording.sources[:1])
    found = estimated_installation(sd.fuse(alone, start=start(recording), estimate=["lever-arm"]))
    assert found.remarks == (
        "none of the requested parameters of the installation is observable: the recording has no "
        "source of velocity; add one",
    )


def test_at_rest_nothing_is_observable():
    recording = at_rest()
    solution = sd.fuse(recording, estimate=["clock", "lever-arm"])
    assert estimated_installation(solution).remarks[-1] == (
        "none of the requested parameters of the installation is observable: the vehicle hardly moves, at most "
        "0.3 m/s"
    )


def test_a_prior_that_contradicts_the_data_is_a_reason_with_both_numbers(turning):
    recording = wrong(turning, (1.0, 0.0, 0.0))
    solution = sd.fuse(recording, start=start(turning), estimate={"lever-arm": 0.2, "clock": 0.1})
    (reason,) = estimated_installation(solution).reasons
    error = by_name(solution)["lever-arm", "forward"]
    assert reason.cause == "lever arm" and reason.weight == pytest.approx(error.change / 0.6)
    assert reason.seen == (
        f"the estimate of {error.name} differs by {error.seen} from the given value, and its prior is 0.2 m: the "
        "prior contradicts the data"
    )
    assert reason in solution.verdict.reasons and not solution.verdict.trusted


def test_the_verdict_looks_at_the_set_up_that_was_found(turning):
    """An IMU whose mounting, antenna and clock were given wrong; the filter found them, and nothing
    else is blamed for it."""
    recording = wrong(turning, (1.0, 0.0, 0.0), 0.1)
    t = np.arange(0.5, SECONDS, 0.5)
    zeros = np.zeros((len(t), 1))
    constraints = [
        Source(kind, t, zeros, zeros + 0.05, (0.0,) * 3)
        for kind in ("zero-lateral-velocity", "zero-vertical-velocity")
    ]
    turn = Rotation.from_euler("ZYX", [3, -2, 0], degrees=True)
    imu = recording.imu._replace(
        dtheta=turn.apply(recording.imu.dtheta.copy()), dv=turn.apply(recording.imu.dv.copy())
    )
    recording = replace(recording, imu=imu, sources=(*recording.sources, *constraints))
    begin = start(turning)
    asked = {"clock": 0.1, "lever-arm": 0.5, "mounting": (0, 0.05, 0.05)}
    given = (Rotation.from_euler("ZYX", begin.rph[::-1]) * turn.inv()).as_euler("ZYX")[::-1]
    begin = begin._replace(rph=tuple(given.tolist()))
    solution = sd.fuse(recording, start=begin, estimate=asked)
    found = by_name(solution)
    assert {each.status for each in found.values()} == {"found", "consistent"}
    assert found["mounting", "heading"].change == pytest.approx(-3, abs=0.3)
    assert found["mounting", "pitch"].change == pytest.approx(2, abs=0.3)
    for suspect in screening.suspects(solution):
        assert (suspect.z < 5).all()
    assert solution.verdict.trusted


def told(solution, **changes):
    """What is said where the facts on the first parameter are these."""
    facts = solution.meta["installation"]
    first = facts["parameters"][0] | changes
    known = facts | {"parameters": [first, *facts["parameters"][1:]]}
    return estimated_installation(replace(solution, meta=solution.meta | {"installation": known}))


def test_an_estimate_beyond_what_is_plausible_is_a_reason(turning):
    solution = sd.fuse(turning, start=start(turning), estimate=["clock"])
    (column,) = [name for name in solution.columns if name.startswith("clock")]
    far = replace(solution, columns=solution.columns | {column: np.full(len(solution.t), -2.5)})
    (reason,) = estimated_installation(far).reasons
    assert "-2.500 +- 0.0" in reason.seen and "at most 2 s is plausible" in reason.seen
    assert reason.weight == pytest.approx(3 * 2.5 / calibration_parameters.CLOCK.most)


@pytest.mark.parametrize("share, status", [(2.1, "consistent"), (1.9, "not observable")])
def test_half_of_the_prior_is_the_limit(turning, share, status):
    solution = sd.fuse(turning, start=start(turning), estimate=["clock"])
    std_ = by_name(solution)["clock", ""].std
    assert told(solution, prior=share * std_).parameters[0].status == status


def test_angles_of_a_mounting_are_those_to_be_written(turning):
    """The IMU stands 90 deg to the left: what is off about the vehicle's pitch is its roll."""
    given = [0.0, 0.0, -np.pi / 2]
    recording = replace(turning, meta=turning.meta | {"imu_mounting": given})
    t = np.arange(1.0, SECONDS)
    zeros = np.zeros((len(t), 1))
    level = Source("zero-vertical-velocity", t, zeros, zeros + 0.1, (0.0,) * 3)
    recording = replace(recording, sources=(*recording.sources, level))
    solution = sd.fuse(recording, start=start(turning), estimate=["mounting"])
    pitch, heading = estimated_installation(solution).parameters
    assert (pitch.given, heading.given) == (0.0, -90.0) and pitch.motion != heading.motion
    C = Rotation.from_rotvec(np.radians([0, pitch.change, heading.change])) * Rotation.from_euler(
        "ZYX", [-90, 0, 0], degrees=True
    )
    assert [heading.value, pitch.value] == pytest.approx(C.as_euler("ZYX", degrees=True)[:2])


def test_a_file_says_the_same(turning, tmp_path):
    asked = with_estimates(turning, ["clock", "lever-arm"])
    solution = sd.fuse(asked, start=start(turning))
    sd.write_solution(solution, tmp_path / "solution.nc")
    assert estimated_installation(
        sd.read_solution(tmp_path / "solution.nc")
    ) == estimated_installation(solution)


def test_nothing_is_said_where_nothing_was_asked_for(turning):
    assert estimated_installation(sd.fuse(turning, start=start(turning))).lines == []
