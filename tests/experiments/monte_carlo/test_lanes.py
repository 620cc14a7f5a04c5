"""Studies in lanes against the same studies run by run: results, cuts, what must run alone, and the
processors of a campaign."""

import json

import numpy as np
import pytest
from test_study import FLIGHT, study, tables

from strapdown.core.compile.jit import COMPILED
from strapdown.experiments.monte_carlo import chunks, processors, study as studies
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.sensor_models.gnss import Gnss

pytestmark = pytest.mark.skipif(not COMPILED, reason="lanes are compiled")
WHOLE, NEVER = 0, 10**12  # steps from which on a study goes through lanes


@pytest.fixture
def least(monkeypatch):
    """Sets from how many steps on lanes are used."""
    return lambda steps: monkeypatch.setattr(studies, "MANY_STEPS", steps)


def arrays_of(made, skip=()):
    return chunks.run_chunk(made, made.chunks()[0], skip)


EXACT = "std", "variances", "nis", "correlation", "accepted", "rejected", "reason", "rows", "bias"


def same(a, b):
    """The filters' own numbers to the bit. Errors to 1e-8 of their standard deviations, and more of
    what follows from them: the last bit of a longitude is a nanometre, and rows have 32 bits."""
    assert a.keys() == b.keys()
    for name in a:
        if name in EXACT:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)
        elif name in ("error", "nees_rows"):
            scale = b["std"] if name == "error" else 1 + b[name]
            np.testing.assert_array_equal(np.isnan(a[name]), np.isnan(b[name]))
            assert np.nanmax(np.abs(a[name] - b[name]) / scale, initial=0.0) < 1e-6
        else:
            np.testing.assert_allclose(a[name], b[name], rtol=1e-7, err_msg=name)


FILTERS = "closed-loop", "open-loop:bias=held", "periodic-reset:interval=7"


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"gnss": Gnss(interval=0.35, velocity_std=(0.1,) * 3, outages=((8.0, 15.0),))},
        {"gate": 3.0},
        {"biases_known": True, "accel_offset": (0.1, 0.0, 0.2)},
    ],
    ids=["as it is", "between samples, an outage", "many rejected", "known biases, an offset"],
)
def test_a_study_in_lanes_is_the_study_run_by_run(least, change):
    made = study(scenarios=FLIGHT.replace(**change), filters=FILTERS, runs=11, chunk_steps=10**9)
    least(WHOLE)
    assert made.side_by_side
    side_by_side = arrays_of(made)
    least(NEVER)
    assert not made.side_by_side
    same(side_by_side, arrays_of(made))


def test_runs_do_not_depend_on_the_runs_beside_them(least):
    least(WHOLE)
    made = study(runs=13, chunk_steps=10**9)
    whole, without = arrays_of(made), arrays_of(made, skip=(0, 5))
    others = np.delete(np.arange(13), [0, 5])
    for name in ("error", "std", "mean_square", "nis"):
        np.testing.assert_array_equal(whole[name][:, others], without[name][:, others])
    assert (without["reason"][:, [0, 5]] == 3).all()


def test_tables_are_the_same_on_threads_and_after_an_interruption(least, tmp_path):
    least(WHOLE)
    made = study(runs=20, chunk_steps=1)  # eight runs a chunk
    one, two = made.run(tmp_path / "one", threads=1), made.run(tmp_path / "two", threads=2)
    files = one._files(one.cells[0])
    assert len(files) == 3
    files[1].unlink()
    again = made.run(tmp_path / "one", threads=2)
    assert tables(again.folder) == tables(two.folder)


def test_filters_without_lanes_run_on_the_same_records(least):
    made = study(filters=("closed-loop", "ckf"), runs=3, chunk_steps=10**9)
    least(WHOLE)
    beside = arrays_of(made)
    least(NEVER)
    alone = arrays_of(made)
    np.testing.assert_array_equal(beside["bias"], alone["bias"])
    for name in ("error", "std", "mean_square", "nis"):
        np.testing.assert_array_equal(beside[name][1], alone[name][1])


def test_what_leaves_the_lanes_is_run_alone(least, monkeypatch):
    """A raw INS that starts far off: its gates are opened in some runs."""
    least(WHOLE)
    started = FLIGHT.replace(gate=1.0)
    made = study(scenarios=started, filters=("open-loop",), runs=8, chunk_steps=10**9)
    alone, scored = [], chunks.RunRecord.score
    monkeypatch.setattr(
        chunks.RunRecord,
        "score",
        lambda self, label: alone.append(self.run) or scored(self, label),
    )
    side_by_side = arrays_of(made)
    assert alone
    least(NEVER)
    same(side_by_side, arrays_of(made))


def test_small_studies_and_wrong_installations_run_one_by_one():
    assert not study().side_by_side
    assert study(runs=10_000).side_by_side
    assert not study(runs=10_000, installation={"clock": 0.1}).side_by_side
    assert not study(runs=10_000, filters=("ukf",)).side_by_side


class TestProcessors:
    def campaign(self, tmp_path, monkeypatch, other="another processor"):
        """A campaign of which the second chunk was made by another processor."""
        made = study(runs=4, chunk_steps=1)
        names = iter([processors.library.processor(), other])
        monkeypatch.setattr(
            "strapdown.experiments.monte_carlo.campaign.processor", lambda: next(names, other)
        )
        return made.run(tmp_path, threads=1)

    def test_one_is_named(self, tmp_path):
        campaign = study(runs=2).run(tmp_path)
        here = processors.library.processor()
        assert json.loads((tmp_path / "manifest.json").read_text())["processors"] == {
            here: processors.SAME
        }
        assert Campaign.open(tmp_path).processors == {here: processors.SAME}
        assert tables(Campaign.open(tmp_path).folder) == tables(campaign.folder)

    def test_another_is_compared(self, tmp_path, monkeypatch):
        found = self.campaign(tmp_path, monkeypatch)
        assert found.processors["another processor"] == processors.SAME
        assert study(runs=4, chunk_steps=1).run(tmp_path).processors == found.processors

    def test_one_that_computes_otherwise_is_told(self, tmp_path, monkeypatch):
        run_chunk = chunks.run_chunk

        def otherwise(*given):
            arrays = run_chunk(*given)
            arrays["error"] = arrays["error"] * np.float32(1 + 1e-6)
            return arrays

        monkeypatch.setattr(processors, "run_chunk", otherwise)
        found = self.campaign(tmp_path, monkeypatch)
        assert "standard deviations" in found.processors["another processor"]
