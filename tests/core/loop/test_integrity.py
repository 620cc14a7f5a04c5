"""What the loop doubts, each check against a plain twin of it, and the log in which it says so."""

import re
from dataclasses import replace

import false_alarms
import numpy as np
import pytest
from recordings import alike, flight, rows, said, same, start
from scipy import stats
from scripted_filter import SCRIPTED, scripted

import strapdown as sd
from strapdown.core.loop import gaps, integrity, log
from strapdown.core.loop.log import Code
from strapdown.core.loop.loop import SAME_TIME
from strapdown.data.solution import DOUBTFUL, INVALID, VALID, Source
from strapdown.data.vehicle import VEHICLES
from strapdown.engine.events import MAX_OF_A_KIND, Events, log_row
from strapdown.engine.plausible_limits import AT_FULL_SCALE, limits
from strapdown.engine.prepare import new_cursor
from strapdown.filters import find
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.trajectory import static
from strapdown.units import quantities

pytestmark = pytest.mark.short


def fused(recording, **more):
    return sd.fuse(recording, **{"start": start(recording), **more})


def with_samples(recording, gyro=None, accel=None):
    """The recording with its increments changed in place by these functions."""
    dtheta, dv = recording.imu.dtheta.copy(), recording.imu.dv.copy()
    for change, values in ((gyro, dtheta), (accel, dv)):
        if change:
            change(values)
    return replace(recording, imu=recording.imu._replace(dtheta=dtheta, dv=dv))


def with_fixes(recording, change, source=0):
    sources = list(recording.sources)
    y = sources[source].y.copy()
    change(y)
    sources[source] = replace(sources[source], y=y)
    return replace(recording, sources=tuple(sources))


# ---- samples


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_a_sample_that_cannot_be_is_bridged(sensor):
    recording, row = flight(), 150
    clean, dt = fused(recording), recording.imu.dt[150]

    def spoil(values):
        values[row, 1] = 1e6 * dt

    spoilt = fused(with_samples(recording, **{sensor: spoil}))
    ((t, text),) = said(spoilt, "which is out of range")
    assert t == recording.imu.t[row] and "y reads " in text and text.endswith("bridged")
    assert spoilt.status[row] == DOUBTFUL and (spoilt.status[:row] == VALID).all()
    # the sample before it stands for it, and its noise is that of a gap
    assert np.abs(spoilt.trajectory.v_n[row] - clean.trajectory.v_n[row]).max() < 0.01
    grown = spoilt.trajectory.std[row, 6:9] ** 2 - clean.trajectory.std[row, 6:9] ** 2
    np.testing.assert_allclose(grown, gaps.BRIDGE_GYRO**2 * dt, rtol=0.02)
    assert np.abs(sd.errors(spoilt, recording.reference).position[row:]).max() < 3.0


def test_samples_at_full_scale_are_said():
    recording, most = flight(), 0.05
    spec = imu_spec("tactical")
    spec = replace(spec, gyro=replace(spec.gyro, saturation=most))
    dt = recording.imu.dt[:, None]

    def clip(dtheta):
        dtheta[:] = np.clip(dtheta, -most * dt, most * dt)

    clipped = with_samples(recording, gyro=clip)
    solution = fused(clipped, imu=spec)
    for axis in range(3):
        rate = np.abs(clipped.imu.dtheta[:, axis] / clipped.imu.dt)
        full = recording.imu.t[rate >= AT_FULL_SCALE * most]
        found = said(solution, f"gyro {'xyz'[axis]} is at full scale")
        assert [t for t, _ in found] == full[:1].tolist()
        if len(full) > 1:
            assert f"({len(full)} times until {full[-1]:.1f} s)" in found[0][1]
        assert (solution.status[np.isin(solution.t, full)] == DOUBTFUL).all()
    assert said(solution, "at full scale")


def stuck_rows(x, dt):
    """Rows at which a series of right values is said to be stuck, by counting."""
    found, length, repeats = [], 0, 0
    for k in range(1, len(x)):
        length = length + 1 if x[k] == x[k - 1] else 0
        repeats += x[k] == x[k - 1]
        others = k + 1 - length
        usual = (repeats - length + 1) / (others + 2)
        if (
            length >= integrity.STUCK_SAMPLES
            and length * dt >= integrity.STUCK_TIME
            and others >= integrity.LEARNED
            and -length * np.log(usual) > integrity.STUCK_LIKELIHOOD
        ):
            found.append(k)
    return found


@pytest.mark.parametrize("axis", [0, 2])
def test_an_axis_that_repeats_its_value_is_stuck(axis):
    recording, dt = flight(), flight().imu.dt[0]

    def freeze(dtheta):
        dtheta[300:340, axis] = dtheta[300, axis]

    frozen = with_samples(recording, gyro=freeze)
    expected = recording.imu.t[stuck_rows(frozen.imu.dtheta[:, axis], dt)]
    assert len(expected) > 25
    solution = fused(frozen)
    ((t, text),) = said(solution, "is stuck at")
    assert t == expected[0] and f"until {expected[-1]:.1f} s" in text
    assert text.startswith(f"gyro {'xyz'[axis]} ")
    assert (solution.status[np.isin(solution.t, expected)] == DOUBTFUL).all()
    assert (solution.status[solution.t < expected[0]] == VALID).all()


def test_a_coarse_sensor_is_not_stuck():
    """Its steps are larger than its noise, so that repeated values say nothing."""

    def still(dtheta):
        moving = np.cumsum(np.random.default_rng(1).choice([-1, 1], 300))
        dtheta[:, 0] = 0.001 * np.r_[moving, np.full(len(dtheta) - 300, moving[-1])]

    recording = with_samples(flight(), gyro=still)
    assert stuck_rows(recording.imu.dtheta[:, 0], 0.05)
    assert not said(fused(recording), "stuck")


# ---- fixes


def test_a_fix_at_latitude_and_longitude_0_is_none():
    def blank(y):
        y[8:11] = 0.0

    solution = fused(with_fixes(flight(), blank))
    assert solution.counts()["GNSS position"] == (17, 0)
    assert said(solution, "not a fix") == [
        (
            9.0,
            "GNSS position: latitude 0 and longitude 0 are not a fix: left out (3 times until 11.0 s)",
        )
    ]
    assert np.isnan(solution.innovations.nis[solution.innovations.source == 0][8:11]).all()


def test_near_there_it_can_be_one():
    recording = flight(lla=(1e-5, 1e-5, 500.0))

    def blank(y):
        y[8, :2] = 0.0

    assert not said(fused(with_fixes(recording, blank)), "no fix")


def test_standard_deviations_below_any_receivers_are_raised():
    recording = flight()
    least = [quantities.REGISTRY.find(q).min_std for q in ("latitude", "longitude", "length")]

    def stated(deviation):
        fix = recording.sources[0]
        stated = replace(fix, std=np.broadcast_to(deviation, fix.std.shape).copy(), gate=np.inf)
        return replace(recording, sources=(stated, recording.sources[1]))

    tiny, least = fused(stated(1e-9)), fused(stated(least))
    assert same(replace(tiny, events=()), replace(least, events=()))
    ((t, text),) = said(tiny, "smaller than any receiver's")
    assert t == 1.0 and "1e-09 m: raised" in text and not said(least, "raised")


def test_a_source_that_is_further_off_than_the_vehicle_can_have_gone_is_left_out():
    def jump(y):
        y[8:] = displace_lla(y[8:], np.tile([3e5, 0.0, 0.0], (len(y) - 8, 1)))

    far, near = (fused(with_fixes(flight(), jump), vehicle=name) for name in ("car", "any"))
    assert far.counts()["GNSS position"] == (8, 12) and not said(far, "GNSS position: gate opened")
    ((t, text),) = said(far, "farther than vehicle 'car' can move at 120 m/s: left out")
    assert t == pytest.approx(14.0) and "300 km" in text
    assert (far.status[far.t >= t] == DOUBTFUL).all()
    assert np.abs(sd.errors(far, flight().reference).position).max() < 5
    assert not said(near, "GNSS position: gate opened")  # 6 s at 1000 m/s are 6 km


# ---- innovations


def twin(t, whitened):
    """[(t, status from there on)] and {side: [(t, mean)]} of the seconds in which the sum of one
    component fails, above or below; by Page (1954), with fixes of a second as one."""
    tested, second, sums, terms = -np.inf, [], [0.0, 0.0], [0, 0]
    fails, unconfirmed, cause = [False, False], 0, -np.inf
    status, alarms = [(0.0, VALID)], {}
    for at, value in zip(t, whitened):
        second.append(value)
        if at - tested >= integrity.SECOND:
            tested, mean, second = at, np.mean(second), []
            for side, sign in enumerate((1, -1)):
                most = integrity.MAX_WHITENED
                total = sums[side] + np.clip(sign * mean, -most, most) - integrity.MEAN_ALLOWED
                terms[side] = terms[side] + 1 if total > 0 else 0
                sums[side] = min(max(total, 0.0), integrity.MAX_OF_BOUND * integrity.MEAN_ALARM)
                bound = (integrity.RECOVERED if fails[side] else 1.0) * integrity.MEAN_ALARM
                fails[side] = total > bound
                if fails[side]:
                    off = min(total / terms[side] + integrity.MEAN_ALLOWED, most)
                    alarms.setdefault(side, []).append((at, off))
                    unconfirmed, cause = integrity.CONFIRM, at
        if unconfirmed and not any(fails) and at - cause >= integrity.CONFIRM_AFTER:
            unconfirmed -= 1
        status.append((at, DOUBTFUL if unconfirmed else VALID))
    return status, alarms


@pytest.mark.parametrize("interval", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("off", [1.5, -3.0])
def test_fixes_that_are_off_on_average_are_doubted_until_they_agree(interval, off):
    recording, begin = alike(400.0, 1.0)
    t = np.arange(interval, 400.0, interval)
    rng = np.random.default_rng(4)
    whitened = rng.normal(size=len(t)) + off * ((t > 100) & (t < 200))
    fixes = scripted(np.full(len(t), 0.5), t=t, whitened=whitened)
    solution = sd.fuse(replace(recording, sources=(fixes,)), SCRIPTED, start=begin)
    status, alarms = twin(t, whitened)
    times, values = map(np.array, zip(*status))
    expected = values[np.searchsorted(times, solution.t + SAME_TIME) - 1]
    np.testing.assert_array_equal(solution.status, expected)
    assert 20 < (expected == DOUBTFUL).sum() < 330 and (expected[:100] == VALID).all()
    ((side, seen),) = alarms.items()
    ((first, text),) = said(solution, "script north: fixes are")
    worst = max(mean for _, mean in seen)
    assert first == pytest.approx(seen[0][0]) and f"until {seen[-1][0]:.0f} s" in text
    assert side == (off < 0) and re.search(rf"{worst:.2g}( or more)? standard dev", text)
    assert list(solution.events) == [(first, text)]


def test_fixes_that_scatter_too_much_are_doubted():
    """Its NIS is 8 times what is expected, so that each second adds 6 to the sum."""
    recording, begin = alike(120.0, 5.0)
    t = np.arange(1.0, 120.0)
    nis = np.where((t > 20) & (t < 35), 8.0, 0.5)
    fixes = scripted(nis, t=t)
    solution = sd.fuse(replace(recording, sources=(fixes,)), SCRIPTED, start=begin)
    ((first, text),) = solution.events
    terms = integrity.NIS_ALARM / (8.0 - integrity.NIS_ALLOWED)  # one row of a fix
    assert first == 20 + np.floor(terms) + 1
    assert text.startswith("script: fixes scatter 2.8 or more times as much as their standard")
    assert (solution.status[solution.t < first - 1e-6] == VALID).all()
    assert (solution.status[(solution.t > first) & (solution.t < 36)] == DOUBTFUL).all()
    assert solution.status[-1] == VALID


def test_a_doubt_ends_with_confirming_fixes():
    """A wild sample at 10 s: the first fix a second later counts."""
    recording, begin = alike(30.0, 5.0)
    recording = with_samples(recording, gyro=lambda dtheta: dtheta.__setitem__((49, 0), 50.0))
    fixes = scripted(np.full(58, 0.5), t=np.arange(1, 59) / 2)
    solution = sd.fuse(replace(recording, sources=(fixes,)), SCRIPTED, start=begin)
    doubtful = solution.t[solution.status == DOUBTFUL]
    assert doubtful[0] == pytest.approx(10.0)
    end = 10.0 + integrity.CONFIRM_AFTER + 0.5 * (integrity.CONFIRM - 1)
    assert doubtful[-1] == pytest.approx(end - 0.2, abs=0.11)


def at_rest():
    """(90 s at rest with a wild sample at 20 s and no fixes, an InitialState for it)."""
    recording = sd.simulate(static((0.8, 0.1, 100.0)), 90.0, "tactical", 1, 5.0)
    wild = with_samples(recording, gyro=lambda dtheta: dtheta.__setitem__((99, 0), 50.0))
    return replace(wild, sources=()), start(recording)


@pytest.mark.parametrize("name", ["vru", "attitude-mekf", "mahony"])
def test_a_doubt_of_an_attitude_without_fixes_ends_when_it_is_level_again(name):
    """Nothing else could end it. A filter with positions waits for fixes for ever."""
    wild, begin = at_rest()
    solution = sd.fuse(wild, name, start=begin)
    doubtful = solution.t[solution.status == DOUBTFUL]
    assert doubtful[0] == pytest.approx(20.0)
    assert doubtful[-1] == pytest.approx(20.0 + integrity.LEVELLED, abs=0.21)
    assert sd.fuse(wild, start=begin).status[-1] == DOUBTFUL


def test_a_source_that_is_heard_has_to_confirm():
    """Heights that are rejected at 30 s put the end off."""
    (wild, begin), t = at_rest(), np.array([30.0])
    fix = Source("altitude", t, np.array([[5e3]]), np.array([[1.0]]), gate=0.01)
    solution = sd.fuse(replace(wild, sources=(fix,)), "vru", start=begin)
    doubtful = solution.t[solution.status == DOUBTFUL]
    assert doubtful[-1] == pytest.approx(30.0 + integrity.LEVELLED, abs=0.21)


# ---- the log


def empty_cursor():
    return new_cursor(
        find("closed-loop"),
        0.0,
        flight().sources,
        limits(None, sd.Noise(*[1e-3] * 6), VEHICLES["any"]),
    )


def events_of():
    return Events(find("closed-loop"), flight().sources, VEHICLES["any"])


def folded(said_so):
    """[(first, last, code, which, count, largest)] of the stretches without a pause of FOLD s."""
    found = {}
    for t, code, which, value in said_so:
        own = found.setdefault((code, which), [])
        if own and (t - own[-1][1] <= log.FOLD or len(own) == MAX_OF_A_KIND):
            first, last, *_, count, most = own[-1]
            most = value if abs(value) > abs(most) else most
            own[-1] = (first, max(last, t), code, which, count + 1, most)
        else:
            own.append((t, t, code, which, 1, value))
    return sorted(row for own in found.values() for row in own)


@pytest.mark.parametrize("pause", [0.5, 4.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_it_does_not_matter_when_the_log_is_emptied(seed, pause):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(pause, 400))
    told = [
        (at, int(rng.integers(Code.FULL_SCALE, Code.STUCK + 1)), int(rng.integers(3)), rng.normal())
        for at in t
    ]
    notify = log.notify
    for every in (1, 7, 50):
        cursor, events = empty_cursor(), events_of()
        for number, (at, code, which, value) in enumerate(told):
            notify(cursor, code, which, at, value)
            if number % every == 0 or cursor.state[0].logged >= log.LOG_FULL:
                events.take(cursor)
        events.take(cursor)
        assert sorted(tuple(row) for row in events.rows) == folded(told)
        assert cursor.state[0].logged == 0


def test_a_full_log_still_counts():
    """What the loop cannot do, because it stops at half of it."""
    cursor, notify = empty_cursor(), log.notify
    for k in range(log.LOG_ROWS + 10):
        notify(cursor, Code.STUCK, k, 1.0, 2.0)
    notify(cursor, Code.STUCK, 5, 1000.0, -3.0)
    assert cursor.state[0].logged == log.LOG_ROWS
    assert cursor.log[5].tolist() == (1.0, 1000.0, Code.STUCK, 5, 2, -3.0)


def test_every_code_has_words():
    events = events_of()
    for code in Code:
        if code == Code.IN_CONDITION:
            continue
        text = events.text(log_row(1.0, 3.0, code, 0, 2, 4.0))
        assert text and "\n" not in text


def test_a_million_of_them_are_a_few_rows():
    """Every sample of a broken sensor is beyond its range."""
    recording = with_samples(flight(), gyro=lambda dtheta: dtheta.__setitem__(slice(None), 1e3))
    solution = fused(recording)
    wild = said(solution, "which is out of range")
    assert len(wild) == 3 and all(f"({len(solution.t)} times until 20.0 s)" in e for _, e in wild)
    # beyond a second of them velocity and attitude are held, as over a gap
    assert np.isin(solution.status, (DOUBTFUL, INVALID)).all()
    assert np.isfinite(rows(solution)).all()


def test_false_alarms_are_as_rare_as_the_page_says():
    """Tables of cumulative sums have 336 and 930 terms for k = 0.5 and h = 4 and 5."""
    for bound, terms in ((4.0, 336.0), (5.0, 930.0)):
        found = false_alarms.run_length(lambda x: stats.norm.cdf(x + 0.5), bound)
        assert found == pytest.approx(terms, rel=0.02)
    assert false_alarms.of_mean() / 2 / 3600 == pytest.approx(
        1071, rel=0.01
    )  # h, in docs/reference/status.md
    assert min(false_alarms.of_nis(rows) for rows in (1, 2, 3)) / 3600 > 9000


def test_a_source_that_fell_silent_contradicts_no_more():
    """Fixes that are off, then none: another source confirms HEARD seconds later."""
    recording, begin = alike(120.0, 5.0)
    t = np.arange(1.0, 40.0)
    lying = scripted(np.full(len(t), 0.5), t=t, whitened=3.0 * (t > 20))
    late = np.arange(1.0, 120.0)
    right = replace(scripted(np.full(len(late), 0.5), t=late), name="right")
    solution = sd.fuse(replace(recording, sources=(lying, right)), SCRIPTED, start=begin)
    doubtful = solution.t[solution.status == DOUBTFUL]
    assert 20 < doubtful[0] < 30
    assert 39 + integrity.HEARD < doubtful[-1] < 39 + integrity.HEARD + integrity.CONFIRM + 2


def test_a_rejected_fix_begins_the_confirmation_anew():
    recording, begin = alike(30.0, 5.0)
    imu = recording.imu
    dv = imu.dv.copy()
    dv[np.searchsorted(imu.t, 10.0), 0] = 1e6
    t = np.arange(1.0, 30.0)
    nis = np.where(np.isin(t, (13.0, 15.0)), 100.0, 0.5)
    wild = replace(recording, imu=imu._replace(dv=dv), sources=(scripted(nis, t=t),))
    solution = sd.fuse(wild, SCRIPTED, start=begin)
    doubtful = solution.t[solution.status == DOUBTFUL]
    assert doubtful[0] == pytest.approx(10.0, abs=0.3)
    assert doubtful[-1] == pytest.approx(18.0, abs=0.3)  # three in a row: 16, 17 and 18 s


def test_a_velocity_too_fast_for_the_vehicle_is_left_out_without_its_vertical_part_too():
    recording, begin = alike(5.0, 5.0)
    y = np.array([[900.0, 900.0, np.nan]])
    fast = Source("velocity", np.array([2.0]), y, np.full((1, 3), 0.1))
    solution = sd.fuse(replace(recording, sources=(fast,)), start=begin, vehicle="aircraft")
    ((_, text),) = solution.events
    assert "1273 m/s is more than the 400 m/s of vehicle 'aircraft': left out" in text
