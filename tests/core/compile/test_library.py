"""The library of kernels at run time: used where it fits, to the bit and without the compiler; where
it does not fit it says why, and kernels are compiled."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import strapdown as sd
from strapdown.aiding import position
from strapdown.checks import DataError
from strapdown.core.compile import jit, library, machine_code
from strapdown.core.compile.signatures import ABI
from strapdown.core.loop.contract import OBSERVE
from strapdown.core.mathematics import elementary
from strapdown.native import emit, relocation
from strapdown.sim.trajectory import demo_flight

PACKAGE = library.PACKAGE
HERE = library.levels()
pytestmark = pytest.mark.skipif(not HERE, reason="no library runs on this processor")
COMPILER = ("numba", "llvmlite", "scipy", "pandas")
KERNEL = SimpleNamespace(
    __module__="strapdown.aiding.position",
    stem=position.observe.stem,
    symbol=position.observe.symbol,
    py_func=position.observe.py_func,
    at_hand=False,
    why_not_kept="",
)
"""A kernel of the package that is not compiled yet."""
DOES_NOTHING = """target datalayout = "e"
target triple = "x86_64-unknown-linux-gnu"
define void @{symbol}() {{
  ret void
}}
"""
FILES = ("aiding/position.py", "core/mathematics/earth.py", "core/loop/contract.py")


@pytest.fixture(scope="module")
def code():
    """A file of the one function, which does nothing."""
    return of_object(KERNEL.symbol)


def of_object(symbol):
    """A file of machine code with the one function, which does nothing."""
    text = DOES_NOTHING.format(symbol=symbol)
    made = emit.emit([text], emit.LIBRARY[HERE[-1]], [symbol])
    return machine_code.file_content(*relocation.place([made.content]))


def digest(content):
    return hashlib.sha256(content).hexdigest()


def forget():
    for found in (library.load_library, library.levels, library._is_edited):
        found.cache_clear()


@pytest.fixture
def made(tmp_path, monkeypatch, code):
    """Folder of a library that fits, which this process asks for the first time. What a test changes
    it calls `forget` after."""
    folder = tmp_path / "lib"
    folder.mkdir()
    (folder / "kernels.bin").write_bytes(code)
    manifest = {
        "abi": ABI,
        "version": sd.__version__,
        "arithmetic": "strict",
        "built_with": "hand",
        "libraries": {each: {"file": "kernels.bin", "sha256": digest(code)} for each in HERE},
        "files": {file: digest((PACKAGE / file).read_bytes()) for file in FILES},
        "kernels": {KERNEL.symbol: [0, 1, 2]},
        "values": {KERNEL.symbol: library.values_of(position.observe)},
    }
    (folder / library.MANIFEST).write_text(json.dumps(manifest), encoding="utf-8")
    for name in (library.REQUIRED, library.CONTRACTION):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(library.SETTING, str(folder))
    forget()
    yield folder
    monkeypatch.undo()
    forget()


@pytest.fixture
def reason(command):
    """Why the library is not used, as the version and the line on compiling both tell it."""

    def told():
        forget()
        why = library.why_not(KERNEL)
        assert library.find(KERNEL) is None
        assert jit.said_first(KERNEL, "closed-loop").endswith(f" ... ({why})")
        code, text, errors = command("--version", "--verbose")
        assert (code, errors) == (0, []) and text.splitlines()[1:] == list(
            library.describe_library()
        )
        assert text.splitlines()[1] == f"kernels: compiled on use by numba ({why})"
        return why

    return told


def changed(folder, **values):
    """Rewrite the manifest with other values, None for left out."""
    file = folder / library.MANIFEST
    manifest = json.loads(file.read_bytes()) | values
    kept = {name: value for name, value in manifest.items() if value is not None}
    file.write_text(json.dumps(kept), encoding="utf-8")


def test_one_that_fits_is_used_and_told_of(made, command):
    assert library.find(KERNEL) and library.why_not(KERNEL) == ""
    assert library.find(SimpleNamespace(**{**vars(KERNEL), "symbol": "another"})) is None
    _, text, _ = command("--version", "--verbose")
    of, processor = text.splitlines()[1:]
    assert of == f"kernels: 1 in {made / 'kernels.bin'} (ABI {ABI}, hand)"
    assert processor == f"processor: {HERE[0]}"


def code_is(content):
    return lambda folder: (folder / "kernels.bin").write_bytes(content)


def manifest_is(content):
    return lambda folder: (folder / library.MANIFEST).write_bytes(content)


def truncated(folder):
    code = folder / "kernels.bin"
    code.write_bytes(code.read_bytes()[:-100])


def one_byte_changed(folder):
    code = bytearray((folder / "kernels.bin").read_bytes())
    code[len(code) // 2] ^= 1
    (folder / "kernels.bin").write_bytes(code)


def no_machine_code(folder):
    (folder / "kernels.bin").write_bytes(b"text")
    one = {"file": "kernels.bin", "sha256": digest(b"text")}
    changed(folder, libraries=dict.fromkeys(HERE, one))


def without(name):
    return lambda folder: changed(folder, **{name: None})


def with_values(**values):
    return lambda folder: changed(folder, **values)


CASES = {
    "truncated": (truncated, "kernels.bin is not whole or not the one that was made"),
    "one byte changed": (one_byte_changed, "is not whole or not the one that was made"),
    "empty": (code_is(b""), "is not whole or not the one that was made"),
    "missing": (lambda folder: (folder / "kernels.bin").unlink(), "kernels.bin is not there or"),
    "no machine code": (no_machine_code, "kernels.bin cannot be loaded ("),
    "no symbol": (
        with_values(
            kernels={KERNEL.symbol: [0], "gone": [0]}, values={KERNEL.symbol: "", "gone": ""}
        ),
        "kernels.bin cannot be loaded (it lacks gone)",
    ),
    "no JSON": (manifest_is(b"{"), "kernels.json is not that of a library of kernels (JSON"),
    "no text": (manifest_is(b"\xff\xfe{"), "is not that of a library of kernels ("),
    "too deep": (manifest_is(b"[" * 200_000), "is not that of a library of kernels (Recursion"),
    "a list": (manifest_is(b"[1]"), "is not that of a library of kernels (TypeError"),
    "no ABI": (without("abi"), "is not that of a library of kernels (KeyError: 'abi')"),
    "no files": (without("files"), "is not that of a library of kernels (KeyError: 'files')"),
    "no kernels": (without("kernels"), "(KeyError: 'kernels')"),
    "no values": (without("values"), "(KeyError: 'values')"),
    "values a list": (with_values(values=[1]), "(TypeError: "),
    "kernels a list": (with_values(kernels=[1]), "(AttributeError: "),
    "files of no number": (with_values(kernels={KERNEL.symbol: [99]}), "(IndexError: "),
    "another ABI": (with_values(abi=ABI + 1), f"other rules (ABI {ABI + 1}, this strapdown has"),
    "another processor": (with_values(libraries={"z16": {}}), "is for z16; this processor is"),
    "no folder": (shutil.rmtree, "lib has no library of kernels"),
    "no manifest": (lambda folder: (folder / library.MANIFEST).unlink(), "has no library of"),
}


@pytest.mark.parametrize("change, words", CASES.values(), ids=CASES)
def test_what_does_not_fit_is_said_and_compiled(made, reason, change, words):
    change(made)
    assert words in reason()


@pytest.mark.parametrize("folder", ["/" + 5000 * "x", __file__], ids=["too long", "a file"])
def test_a_folder_that_is_none(made, reason, monkeypatch, folder):
    monkeypatch.setenv(library.SETTING, folder)
    assert "librar" in reason()


def test_switches_are_reasons(made, reason, monkeypatch):
    monkeypatch.setenv(library.CONTRACTION, "1")
    assert reason() == (
        "STRAPDOWN_CONTRACTION is set, and the library of kernels is made without contraction"
    )
    monkeypatch.setattr(library, "OWN", made)
    monkeypatch.setenv(library.SETTING, "0")
    assert reason() == "STRAPDOWN_LIBRARY is 0"


def test_no_reason_is_given_where_none_is_there(made, monkeypatch, tmp_path):
    monkeypatch.setattr(library, "OWN", tmp_path / "none")
    monkeypatch.delenv(library.SETTING)
    forget()
    said = jit.said_first(KERNEL, "closed-loop").format(", about 8 s")
    assert said == "closed-loop for the first time on this machine, about 8 s ..."


def test_an_old_processor_takes_the_lower_level_and_an_unknown_one_none(made, reason, monkeypatch):
    lowest = list(library.LEVELS[library.system()])[-1]
    forget()
    monkeypatch.setattr(library, "levels", library.cache(lambda: (lowest,)))
    assert library.load_library().level == lowest
    monkeypatch.setattr(library, "levels", library.cache(lambda: ()))
    assert reason().endswith(f"this processor is {library.platform.machine()}")


def test_another_value_compiles_what_closes_over_it(made, monkeypatch):
    """A number of a helper in another module, which no file says."""
    assert library.find(KERNEL)
    monkeypatch.setattr(elementary, "QUARTERS", 0.6)
    assert library.why_not(KERNEL) == (
        "strapdown.aiding.position.observe closes over other values than the library of kernels was "
        "made from"
    )
    assert library.find(KERNEL) is None


def test_an_edit_compiles_what_it_touches(made, monkeypatch, tmp_path, command):
    """Of two kernels of which one comes from the file."""
    other = SimpleNamespace(**{**vars(KERNEL), "symbol": "other", "stem": "other"})
    for file in FILES:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(PACKAGE / file, tmp_path / file)
    monkeypatch.setattr(library, "PACKAGE", tmp_path)
    with open(tmp_path / FILES[0], "a", encoding="utf-8") as file:
        file.write("# edited\n")
    assert library.why_not(KERNEL) == (
        "aiding/position.py is another than the library of kernels was made from"
    )
    assert library.find(KERNEL) is None and "not in the library" in library.why_not(other)
    _, text, _ = command("--version", "--verbose")
    assert text.splitlines()[-1] == (
        "compiled on use by numba: 1 of them, because of edits to aiding/position.py"
    )
    (tmp_path / FILES[0]).unlink()
    forget()
    assert library.find(KERNEL) is None


def test_required_is_an_error_of_one_line_but_for_kernels_of_others(made, monkeypatch):
    monkeypatch.setenv(library.REQUIRED, "1")
    assert library.find(KERNEL)
    mine = jit.kernel(OBSERVE)(lambda belief, y, source, innovation, H: 0)
    assert library.find(mine) is None
    with pytest.raises(DataError) as refused:
        library.find(SimpleNamespace(**{**vars(KERNEL), "symbol": "another", "stem": "that.one"}))
    assert str(refused.value) == (
        "the kernel that.one would have to be compiled, which STRAPDOWN_REQUIRE_LIBRARY forbids: "
        "that.one is not in the library of kernels"
    )


# ---- a library of real kernels


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """File of a flight with fixes of position and velocity."""
    made = sd.simulate(demo_flight(), 20.0, "tactical", 1)
    assert {each.kind for each in made.sources} == {"position", "velocity"}
    path = tmp_path_factory.mktemp("flight") / "recording.nc"
    sd.write_recording(made, path)
    return path


def process(*words, path=PACKAGE.parent, **environment):
    """What a new process did, with numba's compiler as a user has it."""
    given = {"PYTHONPATH": str(path), "NUMBA_DISABLE_JIT": "0", "PYTHONWARNINGS": "error"}
    return subprocess.run(
        [sys.executable, *map(str, words)],
        env={**os.environ, **given, "PYTHONDONTWRITEBYTECODE": "1", **environment},
        capture_output=True,
        text=True,
        cwd="/",
    )


def printed(*words, **environment):
    done = process(*words, **environment)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout


BLOCK = f"""
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {COMPILER}:
            raise ImportError(name + " is blocked")

sys.meta_path.insert(0, Blocked())
"""
LOADED = f"""
import sys
print(*({{*{COMPILER}}} & {{*sys.modules}}))
"""
SOLUTION = """
import sys
import numpy as np
import strapdown as sd
from strapdown.engine.stream import Measurement, Sample

recording = sd.read(sys.argv[1])
start = sd.align(recording, sd.imu("tactical"))
solution = sd.fuse(recording, "closed-loop", start=start)
stream = sd.Stream("closed-loop", start=start, imu="tactical", sources=recording.sources)
imu = recording.imu
columns = (imu.t, imu.dt, imu.dtheta, imu.dv)
events = [Sample(*row) for row in zip(*(column.tolist() for column in columns))]
for source, a in enumerate(recording.sources):
    fixes = zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
    events += [Measurement(t, source, tuple(y), tuple(std)) for t, y, std in fixes]
for event in sorted(events, key=lambda event: (event.t, type(event) is Sample)):
    stream.step(event)
stream.finish()
live = stream.solution
path, other = solution.trajectory, live.trajectory
assert all(np.array_equal(a, b) for a, b in zip(
    (path.lla, path.v_n, path.q_nb, path.std), (other.lla, other.v_n, other.q_nb, other.std)))
np.save(sys.argv[2], np.c_[path.t, path.lla, path.v_n, path.q_nb, path.std])
"""


@pytest.fixture(scope="module")
def compiled(recording, tmp_path_factory):
    """What the compiler's kernels make of it."""
    out = tmp_path_factory.mktemp("compiled") / "rows.npy"
    printed("-c", SOLUTION, recording, out, STRAPDOWN_LIBRARY="0", STRAPDOWN_REQUIRE_LIBRARY="")
    return np.load(out)


def test_batch_and_stream_run_without_the_compiler_and_to_its_bits(
    kernel_library, recording, compiled, tmp_path
):
    said = printed(
        *("-c", BLOCK + SOLUTION + LOADED, recording, tmp_path / "rows.npy"),
        STRAPDOWN_LIBRARY=str(kernel_library),
        STRAPDOWN_REQUIRE_LIBRARY="1",
    )
    assert said.split() == []
    assert np.load(tmp_path / "rows.npy").tobytes() == compiled.tobytes()


@pytest.mark.parametrize("home", ["", "no home"])
def test_it_needs_no_home_and_no_writing(kernel_library, recording, compiled, tmp_path, home):
    """Nothing is written beside it, nor in a cache."""
    folder = tmp_path / "installed"
    shutil.copytree(kernel_library, folder)
    before = {file: file.stat().st_mtime_ns for file in (folder, *folder.iterdir())}
    folder.chmod(0o555)
    places = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"), str(tmp_path / "nowhere"))
    printed(
        *("-c", BLOCK + SOLUTION, recording, tmp_path / "rows.npy"),
        STRAPDOWN_LIBRARY=str(folder),
        STRAPDOWN_REQUIRE_LIBRARY="1",
        **(places if home else {}),
    )
    assert np.load(tmp_path / "rows.npy").tobytes() == compiled.tobytes()
    assert before == {file: file.stat().st_mtime_ns for file in (folder, *folder.iterdir())}
    assert not (tmp_path / "nowhere").exists()


def test_what_it_lacks_is_one_line_where_it_is_required(kernel_library, recording, tmp_path):
    main = "import sys; from strapdown.cli.app import main; sys.exit(main())"
    words = ("fuse", recording, "--filter", "mekf", "--out", tmp_path / "out")
    required = {"STRAPDOWN_LIBRARY": str(kernel_library), "STRAPDOWN_REQUIRE_LIBRARY": "1"}
    done = process("-c", BLOCK + main, *words, **required)
    assert (done.returncode, done.stdout) == (2, "")
    line = (
        "the kernel strapdown.filters.ins.mekf.correct would have to be compiled, which "
        "STRAPDOWN_REQUIRE_LIBRARY forbids: strapdown.filters.ins.mekf.correct is not in the "
        "library of kernels"
    )
    assert done.stderr.splitlines() == [f"strapdown: {line}"]
    assert not (tmp_path / "out").exists()
    done = process("-c", BLOCK + SOLUTION.replace("closed-loop", "mekf"), recording, "", **required)
    assert done.stderr.splitlines()[-1].endswith(f"DataError: {line}")


SENSOR = """
from strapdown.core.loop.contract import OBSERVE, MeasurementModel, kernel
from strapdown.registration import register


@kernel(OBSERVE)
def observe(belief, y, source, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    H[0, 5] = 1.0
    return 1


register(MeasurementModel("vertical-speed", observe, ("speed",)))
"""
MIXED = """
import sys
import numpy as np
import strapdown as sd
from strapdown.core.loop import loop

recording = sd.read(sys.argv[1])
p, v = recording.sources
own = sd.Source("vertical-speed", v.t, v.y[:, 2:], v.std[:, 2:])
recording = sd.Recording(recording.imu, (p, own), recording.reference, recording.meta)
found = []
for name in sys.argv[3:]:
    solution = sd.fuse(recording, name, imu="tactical")
    assert solution.counts()["vertical-speed"][0] > 10
    path = solution.trajectory
    found.append(np.c_[path.t, path.lla, path.v_n, path.q_nb, path.std])
np.save(sys.argv[2], found)
print("_made" in vars(loop.run), "numba" in sys.modules)
"""


@pytest.mark.parametrize(
    "filters, required",
    [(["closed-loop"], "1"), pytest.param(["closed-loop", "mekf"], "", marks=pytest.mark.deep)],
    ids=["sensor of one's own", "filter that is missing"],
)
def test_kernels_of_the_library_and_of_the_compiler_mix(
    kernel_library, recording, tmp_path, filters, required
):
    """A sensor of one's own under the library's loop; a filter whose kernels are missing beside."""
    plugin = tmp_path / "sensor.py"
    plugin.write_text(SENSOR, encoding="utf-8")
    found = {}
    for folder, needed in (("0", ""), (str(kernel_library), required)):
        rows = tmp_path / "rows.npy"
        said = printed(
            *("-c", MIXED, recording, rows, *filters),
            STRAPDOWN_PLUGINS=str(plugin),
            STRAPDOWN_LIBRARY=folder,
            STRAPDOWN_REQUIRE_LIBRARY=needed,
        )
        assert said.split() == [str(folder == "0"), "True"]  # whether the loop was compiled
        found[folder] = rows.read_bytes()
    assert len(set(found.values())) == 1


NOT_USED = """
import importlib, json, sys
from strapdown.core.compile import library
for symbol in ("core.loop.loop.run", "aiding.position.observe", "aiding.velocity.observe",
               "filters.ins.closed_loop.predict", "filters.ins.closed_loop.correct"):
    module, _, name = symbol.rpartition(".")
    kernel = getattr(importlib.import_module("strapdown." + module), name)
    if why := library.why_not(kernel):
        print(symbol, "|", why)
print(library.load_library().path.parent)
"""


def test_two_versions_side_by_side_use_what_is_their_own(kernel_library, tmp_path):
    """Copies of the package, each with its library: of both, the one that was made from its files."""
    edits = {"old": "", "sensor": "aiding/velocity.py", "contract": "core/loop/contract.py"}
    for name, file in edits.items():
        package = tmp_path / name / "strapdown"
        shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__", "lib"))
        shutil.copytree(kernel_library, package / "lib")
        if file:
            with open(package / file, "a", encoding="utf-8") as code:
                code.write("# another version\n")

    def used(name, **more):
        settings = {"STRAPDOWN_LIBRARY": "", "STRAPDOWN_REQUIRE_LIBRARY": ""} | more
        done = process("-c", BLOCK + NOT_USED, path=tmp_path / name, **settings)
        assert done.returncode == 0 and done.stderr == "", done.stderr
        *lines, folder = done.stdout.splitlines()
        return dict(line.split(" | ") for line in lines), folder

    assert used("old") == ({}, str(tmp_path / "old/strapdown/lib"))
    why = "{} is another than the library of kernels was made from"
    of_sensor = {"aiding.velocity.observe": why.format("aiding/velocity.py")}
    assert used("sensor") == (of_sensor, str(tmp_path / "sensor/strapdown/lib"))
    of_contract, _ = used("contract")
    assert len(of_contract) == 4  # all but the loop, which does not need it
    assert set(of_contract.values()) == {why.format("core/loop/contract.py")}
    # as if that one were built anew
    manifest = json.loads((tmp_path / "sensor/strapdown/lib" / library.MANIFEST).read_bytes())
    edited = tmp_path / "sensor/strapdown/aiding/velocity.py"
    files = manifest["files"] | {"aiding/velocity.py": digest(edited.read_bytes())}
    changed(tmp_path / "sensor/strapdown/lib", files=files)
    assert used("sensor")[0] == {}
    other = str(tmp_path / "sensor/strapdown/lib")
    assert used("old", STRAPDOWN_LIBRARY=other) == (of_sensor, other)


@pytest.mark.deep
def test_contraction_is_the_compilers_and_changes_last_bits(
    kernel_library, recording, compiled, tmp_path
):
    done = process(
        *("-c", SOLUTION + LOADED, recording, tmp_path / "rows.npy"),
        STRAPDOWN_LIBRARY=str(kernel_library),
        STRAPDOWN_REQUIRE_LIBRARY="",
        STRAPDOWN_CONTRACTION="1",
    )
    assert done.returncode == 0 and "numba" in done.stdout.split(), done.stderr
    rows = np.load(tmp_path / "rows.npy")
    assert rows.tobytes() != compiled.tobytes()
    assert np.all(np.abs(rows - compiled) <= 1e-7 * np.maximum(np.abs(compiled), 1e-3))
