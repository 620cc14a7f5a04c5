"""Import paths that documentation of version 0.1 showed: the same objects, and a warning that
says where they are now."""

import importlib
import subprocess
import sys

import pytest

from strapdown import former_names
from strapdown_reproductions import former_names as former_names_of_papers

EVERY = {f"strapdown.{old}": f"strapdown.{new}" for old, new in former_names.MOVED.items()}
EVERY |= {f"strapdown.papers.{old}": new for old, new in former_names_of_papers.MOVED.items()}


@pytest.mark.parametrize("old", EVERY)
def test_a_former_name_is_the_module_of_today(old):
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} is {EVERY[old]} now"):
        former = importlib.import_module(old)
    for name, value in vars(importlib.import_module(EVERY[old])).items():
        assert name.startswith("__") or getattr(former, name) is value


def test_names_from_the_package_itself():
    """`from strapdown import consistency`, as a page showed it, where user code sees the warning
    at its own line."""
    sys.modules.pop("strapdown.consistency", None)
    code = "from strapdown import consistency\nfrom strapdown.sim.flight import fly\nprint(consistency.__name__)"
    done = subprocess.run(
        [sys.executable, "-W", "default", "-c", code], capture_output=True, text=True
    )
    assert (
        done.stdout == "strapdown.consistency\n"
        and done.stderr.count("DeprecationWarning") == 2
        and "<string>:1: Deprec" in done.stderr
    )


@pytest.mark.parametrize(
    "name",
    [
        "strapdown.nothing",
        "strapdown.sensors.nothing",
        "strapdown.papers.nothing",
        "strapdown.sim.nothing",
    ],
)
def test_what_never_was_is_not_found(name):
    with pytest.raises(ModuleNotFoundError, match=name):
        importlib.import_module(name)


def test_without_the_reproductions_the_line_says_so(monkeypatch):
    monkeypatch.setattr(former_names, "REPRODUCTIONS", "not_installed_at_all")
    with pytest.raises(
        ModuleNotFoundError, match="strapdown-reproductions, which is not installed"
    ):
        importlib.import_module("strapdown.papers.alam_figures")
