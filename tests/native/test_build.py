"""A library of a few kernels built, called and told of; the whole one is a deep test."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import strapdown
from strapdown.aiding import position
from strapdown.checks import DataError
from strapdown.core.compile import c_calls, jit, kernel_cache, library, machine_code, signatures
from strapdown.core.loop.contract import InitialState
from strapdown.core.mathematics import elementary
from strapdown.core.mathematics.source import new_source
from strapdown.native import build

SOURCE = Path(strapdown.__file__).parents[1]
ONLY = "strapdown.aiding.position.observe,strapdown.aiding.zero_velocity.observe"


def built(folder, *words, **environment):
    """What `python -m strapdown.native.build` did."""
    return subprocess.run(
        [sys.executable, "-m", "strapdown.native.build", str(folder), *words],
        env={**os.environ, "PYTHONPATH": str(SOURCE), **environment},
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """(folder of a library of two kernels for all levels, what the build said, its cache)."""
    try:
        build.levels_here()
    except DataError as error:
        pytest.skip(str(error))
    folder, cache = tmp_path_factory.mktemp("lib"), tmp_path_factory.mktemp("cache")
    environment = {"NUMBA_CACHE_DIR": str(cache), "NUMBA_DISABLE_JIT": "0"}
    done = built(folder, "--levels", "all", "--only", ONLY, **environment)
    assert done.returncode == 0, done.stderr
    return folder, done, environment


def test_the_manifest_says_what_the_library_is(small):
    folder, done, _ = small
    made = json.loads((folder / "kernels.json").read_bytes())
    assert made["abi"] == signatures.ABI and made["arithmetic"] == "strict"
    assert made["version"] == strapdown.__version__ and made["built_with"].startswith("numba ")
    assert list(made["libraries"]) == list(build.levels_here())
    for each in made["libraries"].values():
        content = (folder / each["file"]).read_bytes()
        assert each["sha256"] == hashlib.sha256(content).hexdigest()
        assert each["bytes"] == len(content)
    files = list(made["files"])
    for file, digest in made["files"].items():
        content = (SOURCE / "strapdown" / file).read_bytes()
        assert digest == hashlib.sha256(content).hexdigest()
    of_position = {files[number] for number in made["kernels"]["strapdown_aiding_position_observe"]}
    assert {
        "aiding/position.py",
        "aiding/augmented.py",
        "core/mathematics/earth.py",
        "core/compile/compiler.py",
        "core/compile/signatures.py",
    } <= of_position
    assert not of_position & {"aiding/zero_velocity.py", "core/loop/loop.py"}
    assert set(os.listdir(folder)) == {
        "kernels.json",
        *(each["file"] for each in made["libraries"].values()),
    }
    assert made["tag"] in done.stdout and "2 of 2: strapdown.aiding.position.observe" in done.stderr


def state():
    """The arguments of an observation of a position, with a lever arm and an attitude."""
    place, v, rph, zero = (0.8, 0.2, 310.0), (30.0, -4.0, 1.5), (0.3, -0.2, 2.1), (0.0, 0.0, 0.0)
    start = InitialState(0.0, place, v, rph, zero, zero, (1.0,) * 15)
    source = new_source()
    source.parameters[:3] = 0.3, -0.7, 1.1
    y = np.array([0.8000002, 0.1999999, 312.5])
    return start.belief(np.zeros(1)), y, source, np.zeros(3), np.zeros((3, 15))


@pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")
def test_its_functions_give_the_bits_of_the_compiler(small):
    folder, _, _ = small
    ours = state()
    kernel = position.observe
    assert kernel(*ours) == 3 and np.any(ours[-1])
    made = json.loads((folder / "kernels.json").read_bytes())
    for level in library.levels():
        file = folder / made["libraries"][level]["file"]
        address = machine_code.load(file, file.read_bytes())[kernel.symbol]
        theirs = state()
        assert c_calls.kernel_call(address, kernel.signature, theirs)() == 3
        for mine, other in zip(ours[-2:], theirs[-2:], strict=True):
            assert mine.tobytes() == other.tobytes()


def test_building_again_takes_what_did_not_change_from_the_cache(small, tmp_path):
    folder, _, environment = small
    done = built(tmp_path / "again", "--levels", "all", "--only", ONLY, **environment)
    assert "2 of 2 kernels did not change" in done.stderr and "observe, " not in done.stderr
    for file in folder.glob("*.bin"):
        assert (tmp_path / "again" / file.name).read_bytes() == file.read_bytes()


def test_an_object_is_found_by_the_values_of_its_kernel(monkeypatch):
    """As for kernels on disk: a number of a helper in another module."""
    before = build._name(position.observe, "x86-64-v3")
    assert build._name(position.observe, "x86-64-v3") == before
    monkeypatch.setattr(elementary, "QUARTERS", 0.6)
    monkeypatch.setattr(kernel_cache, "_FROZEN", {})
    assert build._name(position.observe, "x86-64-v3") != before


@pytest.mark.parametrize(
    "words, line",
    [
        (["--levels", "x86-64-v9"], "--levels is 'x86-64-v9' (did you mean 'x86-64-v"),
        (["--only", "strapdown.aiding.positon.observe"], "(did you mean 'strapdown.aiding.pos"),
    ],
)
def test_what_cannot_be_built_is_one_line_and_leaves_what_was_there(small, tmp_path, words, line):
    (tmp_path / "kernels.json").write_text("before", encoding="utf-8")
    done = built(tmp_path, "--only", ONLY, *words, **small[2])
    assert done.returncode == 2 and done.stdout == ""
    (last,) = [each for each in done.stderr.splitlines() if not each[0].isdigit()]
    assert last.startswith("no library of kernels: ") and line in last
    assert os.listdir(tmp_path) == ["kernels.json"]


def test_a_processor_below_all_levels_is_refused(tmp_path):
    with pytest.raises(DataError, match="this processor is below|this is "):
        build.build(tmp_path, (), (), print)


def test_another_machine_is_refused(monkeypatch):
    monkeypatch.setattr(library.platform, "machine", lambda: "riscv64")
    with pytest.raises(DataError, match="exist for linux x86_64, .* this system is .*riscv64"):
        build.levels_here()


def test_the_tag_is_that_of_the_system_or_any():
    for system, levels in library.LEVELS.items():
        assert build.tag(tuple(levels)) == build.TAGS[system]
    assert build.tag(("x86-64-v2", "macos-arm64")) == "any"


def test_every_kernel_of_the_package_is_known_and_every_level_has_a_target():
    stems = [kernel.stem for kernel in build.kernels_of_package()]
    assert len(stems) == len(set(stems)) > 60
    assert {
        "strapdown.core.loop.loop.run",
        "strapdown.core.mathematics.smoother.run_back",
        "strapdown.evaluation.nees.normalised_rows",
        "strapdown.flight.flight_loop.fly",
        "strapdown.filters.ins.closed_loop.predict",
    } <= set(stems)
    for levels in library.LEVELS.values():
        assert set(levels) <= set(build.emit.LIBRARY)


USED = """
import strapdown as sd, sys
from strapdown.core.compile import library
solution = sd.fuse(sd.simulate("car", duration=60.0), filter="closed-loop")
assert "numba" not in sys.modules
print(*library.describe_library(), sep=chr(10))
"""


@pytest.mark.deep
def test_the_whole_library_is_built_and_used_without_the_compiler(whole_library):
    folder = whole_library
    made = json.loads((folder / "kernels.json").read_bytes())
    assert set(made["kernels"]) == {kernel.symbol for kernel in build.kernels_of_package()}
    environment = {library.SETTING: str(folder), library.REQUIRED: "1", "NUMBA_DISABLE_JIT": "0"}
    used = subprocess.run(
        [sys.executable, "-c", USED],
        env={**os.environ, "PYTHONPATH": str(SOURCE), **environment},
        capture_output=True,
        text=True,
    )
    assert used.returncode == 0 and str(folder) in used.stdout, used.stderr
