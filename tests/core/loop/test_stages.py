"""The stage that the documentation adds in one file, in a run."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from strapdown import filters
from strapdown.core.loop import stages
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.sim.synthesis import simulate

PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "design.md"


@pytest.fixture
def silence(tmp_path, monkeypatch):
    """The file of the page as a module of its room, with its line in PREPARE."""
    name = f"{stages.__name__}.silence"
    found = re.search(r"```python file=silence.py\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    path = tmp_path / "silence.py"
    path.write_text(found[1], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, path)
    made = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, made)
    spec.loader.exec_module(made)
    line = (made.widened_by_silence, lambda sources, cursor: True)
    monkeypatch.setattr(stages, "PREPARE", (*stages.PREPARE, line))
    return made


def claims(recording, acceleration):
    """Standard deviations of the last position, m, where sources have this parameter, m/s^2."""
    run = begin(recording, filters.find("closed-loop"), run_options())
    run.fixes.sources["parameters"][:, 3] = acceleration
    run.complete()
    return np.sqrt(np.diag(run.belief.P)[:3])


def test_the_stage_of_the_documentation_widens_what_was_silent(silence):
    recording = simulate("straight", 20.0, seed=1)
    as_given, widened = claims(recording, 0.0), claims(recording, 8.0)
    assert np.all(widened > 1.5 * as_given)
    sources = begin(recording, filters.find("closed-loop"), run_options()).fixes.sources
    assert not silence.is_needed(sources, None)
    sources["parameters"][0, 3] = 1.0
    assert silence.is_needed(sources, None)
