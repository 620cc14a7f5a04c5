"""fuse: chunks, split samples, gaps, gates, re-acquisition, starts, decimation, ends, and refusals."""
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from recordings import alike, flight, position, rows, same, split, start, without_samples

import strapdown as sd
from strapdown import engine
from strapdown.core import loop
from strapdown.data import BRIDGED, INVALID, VALID, Aiding, DataError
from strapdown.geodesy import displaced, displacement
from strapdown.sensors.imu import grades
from strapdown.sim.trajectory import DEG

short = pytest.mark.short


def fused(recording, **more):
    return sd.fuse(recording, **{"start": start(recording), **more})


def moved(aiding, after, ned):
    """The position fixes from `after` on displaced by metres north, east, down."""
    y = aiding.y.copy()
    late = aiding.t >= after - 1e-9
    y[late] = displaced(y[late], np.broadcast_to(ned, y[late].shape))
    return replace(aiding, y=y)


def with_position(recording, change):
    return replace(recording, aidings=(change(recording.aidings[0]), *recording.aidings[1:]))


# ---- chunks, threads, decimation

@short
@pytest.mark.parametrize("chunk", [1, 37, 399])
def test_chunks_change_nothing(monkeypatch, chunk):
    recording = without_samples(flight(), (7.0, 7.5), (11.0, 14.0))
    whole = fused(recording)
    monkeypatch.setattr(engine, "CHUNK", chunk)
    assert same(fused(recording), whole)
    assert [text.split(":")[0] for _, text in whole.events] == ["IMU gap of 0.5 s", "IMU gap of 3 s"]


@short
def test_progress_rises_to_one(monkeypatch):
    monkeypatch.setattr(engine, "CHUNK", 64)
    told = []
    fused(flight(), progress=told.append)
    assert len(told) == 7 and told == sorted(told) and told[-1] == 1.0


def test_ctrl_c_ends_a_run_between_chunks(monkeypatch):
    monkeypatch.setattr(engine, "CHUNK", 64)

    def stop(share):
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        fused(flight(), progress=stop)


def test_two_threads_at_once_give_what_one_gives():
    recordings = [flight(seconds=60.0, seed=seed) for seed in range(6)]
    alone = [fused(recording, filter=name) for recording in recordings for name in ("closed-loop", "open-loop")]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda job: fused(job[0], filter=job[1]), [(r, name) for r in recordings for name in ("closed-loop", "open-loop")]))
    assert all(same(a, b) for a, b in zip(alone, together))


def test_two_threads_may_prepare_at_once():
    """In a new process: the second thread must find the result of the first, not compilation switched off."""
    import subprocess
    import sys
    code = ("from concurrent.futures import ThreadPoolExecutor\nfrom strapdown.engine import prepare\n"
            "with ThreadPoolExecutor(4) as pool:\n    list(pool.map(lambda _: prepare('closed-loop', ['position', 'velocity']), range(8)))")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@short
@pytest.mark.parametrize("every", [7, 400, 1000])
def test_every_nth_row_and_the_last(every):
    all_rows = rows(fused(flight()))
    kept = rows(fused(flight(), every=every))
    np.testing.assert_array_equal(kept, all_rows[(len(all_rows) - 1) % every::every] if every < len(all_rows) else all_rows[-1:])


@short
def test_covariance_belongs_to_the_rows():
    solution = fused(flight(), every=10, covariance=True)
    assert solution.covariance.shape == (40, 15, 15)
    np.testing.assert_allclose(np.sqrt(np.diagonal(solution.covariance, axis1=1, axis2=2)), solution.trajectory.sd, rtol=1e-14)
    np.testing.assert_array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    assert fused(flight()).covariance is None


# ---- fixes inside samples

@short
@pytest.mark.parametrize("share", [0.25, 0.9])
def test_a_sample_is_split_at_a_fix_inside_it(share):
    recording, begin = alike()
    inside = recording.imu.t[50] - (1 - share) * recording.imu.dt[50]
    aidings = (position([inside], (0.8, 0.20001, 310.0)),)
    whole = sd.fuse(replace(recording, aidings=aidings), start=begin)
    by_hand = sd.fuse(replace(split(recording, 50, share), aidings=aidings), start=begin)
    np.testing.assert_allclose(rows(whole), np.delete(rows(by_hand), 50, axis=0), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(whole.innovations.innovation, by_hand.innovations.innovation, rtol=1e-9)
    at_the_end = sd.fuse(replace(recording, aidings=(replace(aidings[0], t=recording.imu.t[50:51]),)), start=begin)
    assert np.abs(at_the_end.innovations.innovation - whole.innovations.innovation).max() > 0.02


@short
def test_two_fixes_inside_one_sample():
    recording, begin = alike()
    cut = recording.imu.t[50] - np.array([0.7, 0.2]) * recording.imu.dt[50]
    aidings = (position(cut, (0.8, 0.20001, 310.0)),)
    whole = sd.fuse(replace(recording, aidings=aidings), start=begin)
    by_hand = sd.fuse(replace(split(split(recording, 50, 0.3), 51, 5 / 7), aidings=aidings), start=begin)
    np.testing.assert_allclose(rows(whole), np.delete(rows(by_hand), [50, 51], axis=0), rtol=1e-11, atol=1e-13)


@short
@pytest.mark.parametrize("off", [-0.9, 0.9])
def test_a_fix_within_a_microsecond_of_a_samples_end_is_taken_there(off):
    recording, begin = alike()
    fix = position(recording.imu.t[50:51], (0.8, 0.20001, 310.0))
    exact, near = (sd.fuse(replace(recording, aidings=(replace(fix, t=fix.t + shift),)), start=begin) for shift in (0.0, off * loop.SAME_TIME))
    np.testing.assert_array_equal(rows(exact), rows(near))
    beyond = sd.fuse(replace(recording, aidings=(replace(fix, t=fix.t + 3 * np.sign(off) * loop.SAME_TIME),)), start=begin)
    assert not np.array_equal(rows(exact), rows(beyond))


@short
def test_simultaneous_fixes_in_the_order_of_their_sources():
    recording, begin = alike()
    t = recording.imu.t[[19, 39]]
    precise, coarse = position(t, (0.8 + 1e-6, 0.200001, 301.0), 0.5), position(t, (0.8 + 1.5e-6, 0.2000012, 302.0), 1.0)
    first, second = (sd.fuse(replace(recording, aidings=pair), start=begin) for pair in ((precise, coarse), (coarse, precise)))
    for solution in (first, second):
        assert solution.innovations.source.tolist() == [0, 1, 0, 1]
    np.testing.assert_allclose(rows(first)[20], rows(second)[20], rtol=1e-5, atol=1e-7)     # the order does not matter to the estimate
    assert first.innovations.innovation[1, 2] > second.innovations.innovation[0, 2] + 0.5   # but the second one sees what the first has done


# ---- gaps

@short
def test_a_short_gap_is_bridged():
    recording, begin = alike()
    solution, whole = (sd.fuse(r, start=begin) for r in (without_samples(recording, (5.0, 5.5)), recording))
    k = int(np.searchsorted(solution.t, 5.5))
    assert solution.t[k - 1] == pytest.approx(5.0) and solution.t[k] == pytest.approx(5.55)
    assert np.flatnonzero(solution.status == BRIDGED).tolist() == [k] and set(solution.status) == {VALID, BRIDGED}
    [(t, text)] = solution.events
    assert t == pytest.approx(5.0) and text == "IMU gap of 0.5 s: bridged"
    same_time = np.searchsorted(whole.t, 5.55 - 1e-9)      # the last sample's rates are those that are missing
    np.testing.assert_allclose(solution.trajectory.v_n[k], whole.trajectory.v_n[same_time], atol=2e-3)
    np.testing.assert_allclose(solution.trajectory.q_nb[k], whole.trajectory.q_nb[same_time], atol=1e-5)
    variance, without = solution.trajectory.sd[k] ** 2, whole.trajectory.sd[same_time] ** 2
    np.testing.assert_allclose((variance - without)[6:9], 0.5 * loop.BRIDGE_GYRO ** 2, rtol=0.02)
    np.testing.assert_allclose((variance - without)[5], 0.5 * loop.BRIDGE_ACCEL ** 2, rtol=0.02)


@short
def test_over_a_long_gap_velocity_and_attitude_are_held():
    recording, begin = alike()
    solution = sd.fuse(without_samples(recording, (4.0, 9.0)), start=begin)
    k = int(np.searchsorted(solution.t, 9.0))
    before, after = ({"v": s.v_n, "q": s.q_nb, "sd": s.sd} for s in [solution.trajectory] * 2)
    step = recording.imu.dt[0]
    np.testing.assert_allclose(after["v"][k], before["v"][k - 1], atol=0.8 * step * 10)
    np.testing.assert_allclose(after["q"][k], before["q"][k - 1], atol=0.2 * step)
    np.testing.assert_allclose(displacement(solution.trajectory.lla[k], solution.trajectory.lla[k - 1]), solution.trajectory.v_n[k - 1] * (5 + step), atol=0.1)
    np.testing.assert_allclose((after["sd"][k] ** 2 - before["sd"][k - 1] ** 2)[6:9], 5 * loop.HOLD_GYRO ** 2, rtol=0.05)
    assert after["sd"][k, 5] ** 2 - before["sd"][k - 1, 5] ** 2 == pytest.approx(5 * loop.HOLD_ACCEL ** 2, rel=0.05)
    assert (solution.status[:k] == VALID).all() and (solution.status[k:] == INVALID).all()
    assert solution.events == ((pytest.approx(4.0), "IMU gap of 5 s: velocity and attitude held, invalid until the next position fix"),)


@short
def test_a_long_gap_ends_with_the_next_accepted_position_fix():
    solution = fused(without_samples(flight(), (5.2, 10.2)))
    invalid = solution.t[solution.status == INVALID]
    assert invalid[0] == pytest.approx(10.25) and invalid[-1] == pytest.approx(10.95)
    inside = (solution.innovations.t > 5.2) & (solution.innovations.t < 10.2)
    assert inside.sum() == 10 and solution.innovations.accepted[inside].all()      # fixes inside are used at their time
    away = fused(without_samples(with_position(flight(), lambda a: a.without([(5.2, 15.5)])), (5.2, 10.2)))
    assert away.t[away.status == INVALID][-1] == pytest.approx(15.95)    # velocity fixes do not end it
    far = fused(without_samples(with_position(flight(), lambda a: moved(a.without([(5.2, 10.5)]), 10.5, [900, 0, 0]).without([(12.5, 99)])), (5.2, 10.2)))
    assert far.counts()["GNSS position"] == (5, 2) and far.status[-1] == INVALID    # nor do rejected ones


@short
def test_a_fix_inside_a_short_gap_does_not_hide_it():
    solution = fused(without_samples(flight(), (5.8, 6.3)))
    assert solution.t[solution.status == BRIDGED] == pytest.approx(6.35)
    assert solution.counts() == {"GNSS position": (20, 0), "GNSS velocity": (20, 0)}
    at_the_row = fused(without_samples(flight(), (5.45, 5.95)))
    assert at_the_row.t[at_the_row.status == BRIDGED] == pytest.approx(6.0)


@short
def test_samples_that_overlap_or_miss_a_little_are_contiguous():
    recording, begin = alike()
    jitter = np.where(np.arange(len(recording.imu.t)) % 2, 0.4, 0.0) * recording.imu.dt[0]
    shaken = replace(recording, imu=recording.imu._replace(t=recording.imu.t + jitter))
    solution, even = sd.fuse(shaken, start=begin), sd.fuse(recording, start=begin)
    assert solution.events == () and (solution.status == VALID).all()
    np.testing.assert_array_equal(rows(solution)[:, 1:], rows(even)[:, 1:])


# ---- gates

@short
def test_a_fix_50_m_off_is_rejected_and_leaves_no_trace():
    spoiled = with_position(flight(), lambda a: replace(a, y=np.where((np.arange(20) == 11)[:, None], displaced(a.y, np.tile([50.0, 0, 0], (20, 1))), a.y)))
    clean = with_position(flight(), lambda a: a._where(np.arange(20) != 11))
    solution, without = fused(spoiled), fused(clean)
    np.testing.assert_array_equal(rows(solution), rows(without))
    assert solution.counts() == {"GNSS position": (19, 1), "GNSS velocity": (20, 0)} and solution.events == ()
    [rejected] = np.flatnonzero(~solution.innovations.accepted)
    assert solution.innovations.t[rejected] == pytest.approx(12.0) and solution.innovations.nis[rejected] > 16.266
    assert solution.innovations.innovation[rejected, 0] == pytest.approx(50, abs=5)


@short
@pytest.mark.parametrize("interval, rejected", [(1.0, 5), (0.25, 12), (0.8, 5)])
def test_what_stays_away_is_reacquired(interval, rejected):
    """At least 5 rejections in a row and at least 3 s after the first of them."""
    base = flight(seconds=20.0)
    t = np.arange(interval, 20.0 - 1e-9, interval)
    path = fused(base).trajectory
    lla = np.c_[[np.interp(t, path.t, column) for column in path.lla.T]].T
    offset = moved(position(t, lla, gate=None, name="receiver"), 7.9, [0, 60.0, 0])
    solution = fused(replace(base, aidings=(offset, base.aidings[1])))
    i = solution.innovations
    own, first = i.source == 0, t[t >= 7.9 - 1e-9][0]
    away = i.accepted[own & (i.t > 7.9 - 1e-9)]
    assert not away[:rejected].any() and away[rejected:].all()
    assert solution.events == ((pytest.approx(first + rejected * interval), "receiver: gate lifted after 5 or more rejections in a row over 3 s"),)
    assert solution.counts()["receiver"] == (len(t) - rejected, rejected)
    assert i.nis[own][-1] < 16.266 and i.nis[own & (i.t > 7.9 - 1e-9)][rejected] > 16.266


@short
def test_a_gate_returns_after_reacquisition():
    """A gate that was lifted once holds again as soon as a fix has passed it."""
    far = with_position(flight(), lambda a: moved(moved(a, 4.0, [0, 60.0, 0]), 17.0, [0, 500.0, 0]))
    solution = fused(far)
    own = solution.innovations.source == 0
    assert (~solution.innovations.accepted[own]).nonzero()[0].tolist() == [3, 4, 5, 6, 7, 16, 17, 18, 19]


@short
@pytest.mark.parametrize("gate, rejected", [(np.inf, 0), (None, 1), (1e6, 0), (1e-9, 0)])
def test_gates(gate, rejected):
    recording = with_position(flight(), lambda a: replace(moved(a, 20.0, [0, 0, 50.0]), gate=gate))
    counts = fused(recording).counts()["GNSS position"]
    assert counts == (20 - rejected, rejected) if gate != 1e-9 else counts[1] >= 5 and counts[0] > 5


@short
def test_missing_components_are_skipped_and_missing_fixes_not_counted():
    def blank(a):
        y = a.y.copy()
        y[:, 2], y[[4, 5]] = np.nan, np.nan
        return replace(a, y=y)
    base = with_position(flight(), lambda a: a)
    solution, full = fused(replace(base, aidings=(blank(base.aidings[0]),))), fused(replace(base, aidings=base.aidings[:1]))
    i = solution.innovations
    assert np.isnan(i.innovation[:, 2]).all() and np.isnan(i.nis[[4, 5]]).all() and not i.accepted[[4, 5]].any()
    assert np.isfinite(np.delete(i.innovation[:, :2], [4, 5], axis=0)).all() and solution.counts() == {"GNSS position": (18, 0)}
    np.testing.assert_allclose(solution.trajectory.sd[-1, :2], full.trajectory.sd[-1, :2], rtol=0.05)
    assert solution.trajectory.sd[-1, 2] > 3 * full.trajectory.sd[-1, 2]


# ---- starts and ends

@short
def test_a_start_in_the_middle_uses_what_comes_after():
    recording = flight()
    solution = fused(recording, start=start(recording, 10.0))
    assert solution.t[0] == pytest.approx(10.05) and len(solution.t) == 200
    assert solution.innovations.t.min() == pytest.approx(11.0)      # the fix at the start's own time is the start's
    assert solution.meta["fixes_outside"] == 20
    assert sd.rms(sd.errors(solution, recording.reference)).position.max() < 2


@short
@pytest.mark.parametrize("share", [0.2, 0.6, 0.999])
def test_a_start_inside_a_sample_uses_the_rest_of_it(share):
    recording, begin = alike()
    inside = recording.imu.t[20] - (1 - share) * recording.imu.dt[20]
    begin = begin._replace(t=float(inside))
    solution, by_hand = sd.fuse(recording, start=begin), sd.fuse(split(recording, 20, share), start=begin)
    assert solution.t[0] == recording.imu.t[20]
    np.testing.assert_allclose(rows(solution), rows(by_hand), rtol=1e-11, atol=1e-13)


@short
def test_a_start_before_the_first_sample_is_a_gap():
    recording, begin = alike()
    for early, status, text in ((0.8, BRIDGED, "IMU gap of 0.8 s: bridged"), (3.0, INVALID, "IMU gap of 3 s: velocity")):
        solution = sd.fuse(recording, start=begin._replace(t=-early))
        assert solution.status[0] == status and solution.events[0][0] == -early and text in solution.events[0][1]


@short
def test_the_latitude_limit_ends_a_run_with_its_reason():
    recording, begin = alike()
    begin = begin._replace(lla=(np.radians(89) - 50 / 6.4e6, 0.2, 300.0), v=(10.0, 0.0, 0.0), rph=(0.0, 0.0, 0.0))
    solution = sd.fuse(recording, start=begin)
    t, text = solution.events[-1]
    assert solution.meta["stopped"] == text and "latitude" in text and 3 < t < 7
    assert solution.t[-1] == pytest.approx(t - 0.05) and (np.abs(solution.trajectory.lla[:, 0]) <= np.radians(89)).all()


def test_a_run_that_diverges_ends_with_its_reason():
    recording, begin = alike()
    dv = recording.imu.dv.copy()
    dv[100] = 1e300
    solution = sd.fuse(replace(recording, imu=recording.imu._replace(dv=dv)), start=begin)
    assert len(solution.t) in (100, 101) and "diverged" in solution.meta["stopped"]
    dv[0] = 1e300
    with pytest.raises(DataError, match="closed-loop stopped at 0.05 s: .*diverged"):
        sd.fuse(replace(recording, imu=recording.imu._replace(dv=dv)), start=begin)


@short
@pytest.mark.parametrize("name", ["closed-loop", "open-loop"])
def test_the_antimeridian_is_crossed(name):
    recording = flight(lla=(DEG * -20, np.pi - 100 / 6.4e6, 100.0))
    solution = fused(recording, filter=name)
    lon = solution.trajectory.lla[:, 1]
    assert np.abs(lon).max() <= np.pi and (lon > 3).any() and (lon < -3).any()
    assert solution.counts() == {"GNSS position": (20, 0), "GNSS velocity": (20, 0)}
    assert sd.rms(sd.errors(solution, recording.reference)).position.max() < 2


# ---- refusals

@short
@pytest.mark.parametrize("wrong, words", [
    (dict(filter="closed-lop"), "no filter is called 'closed-lop'; did you mean 'closed-loop'"),
    (dict(interval=3.0), "filter 'closed-loop' has no option 'interval'; it has error_model"),
    (dict(error_model="exact"), "error_model is 'exact'; it must be one of corrected, literal"),
    (dict(filter="periodic-reset", interval="x"), "filter 'periodic-reset': "),
    (dict(every=0), "every is 0; it must be a whole number, at least 1"),
    (dict(every=2.5), "every is 2.5"),
    (dict(imu="tacticle"), "did you mean 'tactical'"),
    (dict(noise=(1e-4, float("nan"), 0, 0, 0, 0)), "noise: accel is nan; it must be a finite number, 0 or more"),
    (dict(noise=(1e-4, 1e-3, -1, 0, 0, 0)), "noise: gyro_bias is -1"),
    (dict(t=30.0), "the start at 30 s is not before the last IMU sample at 20 s"),
    (dict(t=-1e9), "the start at -1e+09 s is 1000000000 s before the first IMU sample"),
    (dict(t=float("nan")), "start: t is nan"),
    (dict(lla=(1.56, 0.0, 0.0)), "start: latitude is 89.3814 deg; results hold up to 89 deg"),
    (dict(v=(1.0, 2.0)), "start: v is (1.0, 2.0); it must be 3 finite numbers"),
    (dict(sd=(-1.0,) * 15), "start: sd has -1; standard deviations must be 0 or more"),
    (dict(sd=(1.0,) * 9), "it must be 15 finite numbers"),
])
def test_refused_in_one_line(wrong, words):
    recording = flight()
    parts = {key: wrong.pop(key) for key in ("t", "lla", "v", "sd") if key in wrong}
    if "noise" in wrong:
        wrong["noise"] = sd.Noise(*wrong["noise"])
    with pytest.raises(DataError) as error:
        fused(recording, start=start(recording)._replace(**parts), **wrong)
    assert words in str(error.value) and "\n" not in str(error.value)


@short
def test_an_imu_that_nobody_named():
    recording = replace(flight(), meta={})
    with pytest.raises(DataError) as error:
        fused(recording)
    assert all(name in str(error.value) for name in grades())
    noise = sd.Noise(1e-4, 1e-3, 1e-6, 1e-5, 0.0, 0.0)
    assert fused(recording, noise=noise).meta["noise"] == noise._asdict()
    with pytest.raises(DataError, match="give imu="):
        sd.fuse(recording, noise=noise)      # the alignment needs it


@short
def test_an_unknown_aiding_is_refused():
    recording = flight()
    with pytest.raises(DataError, match="no aiding is of kind 'positon'; did you mean 'position'"):
        fused(replace(recording, aidings=(replace(recording.aidings[0], kind="positon"),)))


@short
def test_slow_compilation_is_announced_at_most_once():
    said = []
    fused(flight(), say=said.append)
    assert len(said) <= 1
    fused(flight(), say=said.append)
    assert len(said) <= 1


# ---- parts of a recording

@short
def test_between_keeps_what_lies_within():
    part = flight().between(5.0, 10.0)
    assert part.imu.t[0] == pytest.approx(5.05) and part.imu.t[-1] == pytest.approx(10.0)
    assert part.span == (pytest.approx(5.0), pytest.approx(10.0))
    assert all(a.t.tolist() == pytest.approx([5, 6, 7, 8, 9, 10]) for a in part.aidings)
    with pytest.raises(DataError, match="no IMU samples between 30 and 40 s; the recording covers 0.000 to 20.000 s"):
        flight().between(30, 40)


@short
def test_hidden_withholds_recorded_fixes_and_keeps_constraints():
    t = np.arange(0.5, 20.0, 0.5)
    lateral = Aiding("zero-lateral-velocity", t, np.zeros((len(t), 1)), np.ones((len(t), 1)))
    recording = replace(flight(), aidings=(*flight().aidings, lateral))
    hidden = recording.hidden([(5.0, 8.0), (10.0, 12.0)])
    assert hidden.aidings[0].t.tolist() == pytest.approx([1, 2, 3, 4, 8, 9, *range(12, 21)]) and len(hidden.aidings[1].t) == 15
    assert hidden.aidings[2] is lateral
    assert [len(a.t) for a in recording.hidden([(5.0, 8.0)], kinds=["velocity", "zero-lateral-velocity"]).aidings] == [20, 17, 33]
    solution = fused(recording.hidden([(5.0, 8.0)]))
    used = solution.innovations.t[solution.innovations.source == 0]
    assert not ((used >= 5) & (used < 8)).any() and solution.meta["fixes_outside"] == 0


@short
def test_no_fixes_at_all():
    recording, begin = alike()
    solution = sd.fuse(recording, start=begin)
    assert solution.counts() == {} and len(solution.t) == 200 and (np.diff(solution.trajectory.sd[:, 0]) > 0).all()
    with pytest.raises(DataError, match="no position fix to start from"):
        sd.fuse(recording)
