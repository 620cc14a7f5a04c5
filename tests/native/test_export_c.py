"""An exported filter on this machine, compiled by its C compiler: the same as in Python, bit for bit."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from exports import STRICT, Delayed, InC, build_example, rough_flight, run

import strapdown as sd
from strapdown.core.loop.contract import DOUBTFUL, INVALID, Use
from strapdown.native.export.chosen import choose_export
from strapdown.native.export.folder import export, find_target
from strapdown.native.export.layout import layout, sizes_of

COMPILER = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
KINDS = ("position", "velocity", "altitude", "zero-velocity")

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler is found")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(what was chosen, what was written, its folder); a closed loop with
    held biases over a rough flight."""
    folder = tmp_path_factory.mktemp("exported")
    of = choose_export("closed-loop", KINDS, rough_flight(), options={"bias": "held"})
    return of, export(of, find_target("host"), folder), folder


@pytest.fixture
def in_c(made):
    of, written, folder = made
    found = InC(folder, COMPILER, written.sizes.state)
    places = layout(sizes_of(of.records(of.start))).places
    found.places = {f"{place.record}.{place.name}": place for place in places}
    return found


def values(of):
    s = of.start
    return [s.t, *s.lla, *s.v_n, *s.rph, *s.b_a, *s.b_g, *s.std[:15], *of.noise]


def begun(of, in_c):
    assert in_c.start(values(of)) == 0
    for s, a in enumerate(of.sources):
        assert in_c.source(s, [*a.parameters, 0, 0, 0, 0, 0, 0][:6], 0.0) == 0
    return in_c


def test_the_example_gives_the_bits_of_python_over_a_rough_flight(made):
    _, written, folder = made
    build_example(COMPILER, folder)
    code, said = run("./main", folder=folder)
    rows = said.splitlines()[-1].split()
    assert code == 0 and rows[0] == rows[2] and int(rows[0]) > 1000, said
    assert f"{written.sizes.state} bytes of state" in said  # as the README says
    # a spoiled replay is seen
    spoiled = bytearray((folder / "replay.bin").read_bytes())
    at = len(spoiled) - 8 - 33 * 8 + 8 * 3  # the last height
    spoiled[at + 5] ^= 1
    (folder / "spoiled.bin").write_bytes(spoiled)
    code, said = run("./main", "spoiled.bin", folder=folder)
    assert code == 1, said
    assert run("./main", "main.c", folder=folder) == (2, "replay.bin is of another export\n")


def test_the_example_of_the_readme_compiles(made):
    folder = made[2]
    text = (folder / "README.md").read_text(encoding="utf-8")
    (folder / "firmware.c").write_text(text.split("```c\n")[1].split("```")[0])
    code, said = run(COMPILER, *STRICT, "-c", "firmware.c", folder=folder)
    assert code == 0, said


def test_the_flight_shows_the_rules_of_the_loop(made):
    done = made[0].replay()
    uses = set(zip(done.out.fix.source.tolist(), done.out.fix.use.tolist()))
    assert {
        (0, Use.ACCEPTED),
        (0, Use.REJECTED),
        (0, Use.REACQUIRED),
        (1, Use.REJECTED),
        (2, Use.ACCEPTED),
        (3, Use.REJECTED),
    } <= uses
    assert {INVALID, DOUBTFUL} <= set(done.out.nav[:, 32])


def test_live_with_late_fixes_it_is_what_a_stream_is(made, in_c):
    """Fixes that come late, beside each other in the wrong order, and twice in one sample."""
    of = made[0]
    begun(of, in_c)
    none = [replace(a, t=a.t[:0], y=a.y[:0], std=a.std[:0]) for a in of.sources]
    stream = sd.Stream(
        of.filter, start=of.start, imu=of.spec, noise=of.noise, sources=none, estimate=[]
    )
    rng = np.random.default_rng(5)
    events = [(t, 1, sample) for t, sample in zip(of.recording.imu.t, zip(*of.recording.imu))]
    for s, a in enumerate(of.sources):
        late = rng.choice([-0.3, -0.02, 0.004, 0.3], len(a.t))
        events += [(t + by, 0, (t, s, y, w)) for t, y, w, by in zip(a.t, a.y, a.std, late)]
    belief, results, compared = None, [], 0
    for _, kind, event in sorted(events, key=lambda event: event[:2]):
        if kind == 0:
            t, s, y, w = event
            results.append(in_c.fix(s, t, y, w))
            stream.step(sd.Measurement(t, s, tuple(y), tuple(w)))
        elif event[0] > of.start.t + 1e-6:
            t, dt, dtheta, dv = event
            belief = stream.step(sd.Sample(t, dt, tuple(dtheta), tuple(dv)))
            status = in_c.sample(t, dt, dtheta, dv)
            assert status == stream.status, t
            compared += 1
            if compared % 100 == 0:
                for name in ("lla", "v_n", "C_nb", "b_a", "b_g", "P"):
                    place = in_c.places[f"belief.{name}"]
                    np.testing.assert_array_equal(in_c.read(place), getattr(belief, name), f"{t}")
    books = in_c.read(in_c.places["cursor.books"])
    assert list(zip(books["accepted"], books["rejected"])) == stream.counts()
    assert results.count(-2) > 50 < results.count(0) and stream.dropped_by["late"] > 50


def test_what_it_is_given_wrong_changes_nothing_and_says_why(made, in_c):
    of = made[0]
    good = values(of)
    for place, wrong in ((0, np.nan), (1, 1.6), (16, -1.0), (31, -1e-9), (5, np.inf)):
        assert in_c.start([*good[:place], wrong, *good[place + 1 :]]) == -1
    begun(of, in_c)
    before = bytes(in_c.numbers)
    t = of.start.t
    turn, push = [0.0] * 3, [0.0, 0.0, -0.098]
    y, w = [*of.start.lla], [1.0, 1.0, 1.0]
    assert in_c.source(4, None, 0.0) == in_c.fix(-1, t + 1, y, w) == -5
    assert in_c.source(0, [np.nan] * 6, 0.0) == in_c.source(0, None, np.nan) == -1
    for fix in ((np.nan, y, w), (t + 1, [np.nan] * 3, w), (t + 1, y, [0.0, 1.0, 1.0])):
        assert in_c.fix(0, *fix) == -1
    assert in_c.fix(0, t, y, w) == in_c.sample(t, 0.01, turn, push) == -2
    for sample in ((t + 1, 0.0), (t + 1, 1.01), (np.inf, 0.01)):
        assert in_c.sample(*sample, turn, push) == -1
    assert in_c.sample(t + 1, 0.01, [np.nan] * 3, push) == -1
    assert in_c.sample(t + 86402, 0.01, turn, push) == -4
    assert bytes(in_c.numbers) == before
    assert [in_c.fix(0, t + 1, y, w) for _ in range(17)] == [0] * 16 + [-3]
    # a belief that is no longer a number stops it
    in_c.numbers[0] = np.nan
    assert in_c.sample(t + 0.01, 0.01, turn, push) == -6
    assert in_c.sample(t + 0.02, 0.01, turn, push) == -6


def test_a_copy_goes_on_as_the_filter_does(made, in_c):
    of = made[0]
    begun(of, in_c)
    rows = [row for row in zip(*of.recording.imu) if row[0] > of.start.t + 1e-6][:400]
    for row in rows[:200]:
        in_c.sample(*row)
    saved = bytes(in_c.numbers)
    for row in rows[200:]:
        in_c.sample(*row)
    after = bytes(in_c.numbers)
    in_c.numbers = type(in_c.numbers).from_buffer_copy(saved)
    for row in rows[200:]:
        in_c.sample(*row)
    assert bytes(in_c.numbers) == after != saved


def timed(of):
    """(time, source or -1, numbers) of samples and fixes, in the order of time."""
    start = of.start.t + 1e-3
    found = [(row[0], -1, row) for row in zip(*of.recording.imu) if row[0] > start]
    for s, a in enumerate(of.sources):
        found += [(t - 1e-3, s, (t, y, w)) for t, y, w in zip(a.t, a.y, a.std) if t > start]
    return sorted(found, key=lambda event: event[:2])


def test_late_fixes_give_the_bits_of_fixes_in_time(made, in_c):
    of = made[0]
    in_time = Delayed(begun(of, in_c))
    for _, s, numbers in (events := timed(of)):
        in_time.sample(*numbers) if s < 0 else in_time.fix(s, *numbers)
    names = ("belief.lla", "belief.v_n", "belief.C_nb", "belief.P", "cursor.books")
    wanted = {name: in_time.read(in_c.places[name]) for name in names}
    late = Delayed(begun(of, in_c))
    rng = np.random.default_rng(8)
    delays = [0.0 if s < 0 else rng.choice([0.0, 0.05, 0.3, 0.8]) for _, s, _ in events]
    arrived = sorted(zip(events, delays), key=lambda pair: pair[0][0] + pair[1])
    refused = [late.fix(s, *n) for (_, s, n), _ in arrived if s >= 0 or late.sample(*n) < -9]
    assert not any(refused)
    for name in names:
        np.testing.assert_array_equal(late.read(in_c.places[name]), wanted[name], name)
    t = events[-1][0]
    y, w = [*of.start.lla], [1.0, 1.0, 1.0]
    assert late.fix(0, t - 10, y, w) == -2 and late.fix(0, t - 1, y, [0.0] * 3) == -1


def test_a_saved_filter_goes_on_and_a_damaged_one_is_refused(made, in_c):
    of = made[0]
    begun(of, in_c)
    rows = [row for row in zip(*of.recording.imu) if row[0] > of.start.t + 1e-6][:400]
    for row in rows[:200]:
        in_c.sample(*row)
    saved = in_c.saved()
    for row in rows[200:]:
        in_c.sample(*row)
    after = bytes(in_c.numbers)
    assert in_c.restore(saved) == 0
    for row in rows[200:]:
        in_c.sample(*row)
    assert bytes(in_c.numbers) == after
    for at in (0, 9, 16, len(saved) // 2, len(saved) - 1):
        assert in_c.restore(saved[:at] + bytes([saved[at] ^ 4]) + saved[at + 1 :]) == -8
    assert bytes(in_c.numbers) == after
    # 10 s without power are a gap
    assert in_c.restore(saved) == 0
    t, dt, dtheta, dv = rows[199]
    assert in_c.sample(t + 10.0, dt, dtheta, dv) == 2
