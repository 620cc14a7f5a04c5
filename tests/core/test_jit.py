"""Compilation and its cache: changed helpers are noticed, foreign caches left alone, wrong types refused, imports cheap, views right."""
import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numba
import numpy as np
import pytest

import strapdown
from strapdown.core import jit
from strapdown.core.jit import OPTIONS, compile_kernel, flatten, helper, is_cached, kernel, matrix, plain, source_hash
from strapdown.core.contract import OBSERVE

PACKAGE = Path(strapdown.__file__).parent
needs_compiler = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")


def python(code, path=PACKAGE.parent, **environment):
    """What a new process prints for `code`; it must print nothing on standard error. The package is taken from `path`."""
    environment = {**os.environ, "PYTHONPATH": str(path), "PYTHONWARNINGS": "error", **environment}
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], env=environment, capture_output=True, text=True, cwd="/")
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout.split()


COMPILE = """
    import numpy as np
    from strapdown.aiding import heading
    from strapdown.core import jit as compiling
    from strapdown.core.contract import PARAMETERS, Belief
    was_cached = compiling.is_cached(heading.observe)
    compiled = compiling.compile_kernel(heading.observe)
    z, e = np.zeros(3), np.zeros(3)
    heading.observe(Belief(z, z, np.eye(3), z, z, np.eye(15), z, z, z, np.zeros(0)), np.ones(3), np.zeros(PARAMETERS), e, np.zeros((3, 15)))
    print(round(e[0], 6), compiled, was_cached)
    """


@needs_compiler
def test_a_changed_helper_in_another_file_is_noticed(tmp_path):
    """numba itself looks only at the file of the kernel: a kernel in aiding/, its helper in core/."""
    shutil.copytree(PACKAGE, tmp_path / "strapdown", ignore=shutil.ignore_patterns("__pycache__"))
    run = lambda: python(COMPILE, tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"), NUMBA_CACHE_DIR="", PYTHONDONTWRITEBYTECODE="1")
    assert run() == ["1.0", "True", "False"]
    assert run() == ["1.0", "False", "True"]
    file = tmp_path / "strapdown/core/rotation.py"
    source, before = file.read_text(), file.stat()
    assert source.count("return angle - 2 *") == 1
    file.write_text(source.replace("return angle - 2 *", "return angle + 1 - 2 *"))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))     # even where the clock hides it
    assert run() == ["2.0", "True", "False"]
    file.write_text(source)
    assert run() == ["1.0", "False", "True"]                        # and the old one is still there
    assert len(list((tmp_path / "cache/strapdown").iterdir())) == 2
    assert not list(tmp_path.glob("strapdown/**/__pycache__"))      # numba's own, stale place


@needs_compiler
def test_a_folder_that_cannot_be_written_means_no_cache_and_no_noise(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    assert python(COMPILE, XDG_CACHE_HOME=str(tmp_path / "file"), NUMBA_CACHE_DIR="") == ["1.0", "True", "False"]


@needs_compiler
def test_a_user_without_a_home_has_no_cache(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(jit.config, "CACHE_DIR", "")
    monkeypatch.setattr(jit.Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("Could not determine home directory.")))
    assert jit._cache_folder() is None


@needs_compiler
def test_numbas_own_setting_of_the_folder_is_respected(tmp_path):
    python("import strapdown.core.contract", NUMBA_CACHE_DIR=str(tmp_path))
    assert [folder.name for folder in (tmp_path / "strapdown").iterdir()] == [source_hash()]


def test_only_the_last_three_folders_are_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(jit.config, "CACHE_DIR", "")
    for age, name in enumerate(["a", "b", "c", "d", "b", "e"]):     # b is used again before e comes
        monkeypatch.setattr(jit, "source_hash", lambda name=name: name)
        folder = jit._cache_folder()
        assert folder == tmp_path / "strapdown" / name and folder.is_dir()
        os.utime(folder, (1e9 + age, 1e9 + age))
    assert sorted(path.name for path in (tmp_path / "strapdown").iterdir()) == ["b", "d", "e"]


def test_hash_follows_sources_and_names(tmp_path):
    for name in ("core", "aiding", "filters", "flight/aircraft"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "file.py").write_text("x = 1\n")
    hashes = [source_hash(tmp_path), source_hash(tmp_path)]
    for name in ("core", "flight/aircraft"):
        (tmp_path / name / "file.py").write_text("x = 2\n")
        hashes.append(source_hash(tmp_path))
    (tmp_path / "core/file.py").rename(tmp_path / "core/other.py")
    hashes.append(source_hash(tmp_path))
    assert hashes[0] == hashes[1] and len(set(hashes)) == 4


def test_every_file_with_a_kernel_or_a_helper_is_in_the_hash():
    hashed = {file for pattern in jit.KERNEL_SOURCES for file in PACKAGE.glob(pattern)}
    compiled = {file for file in PACKAGE.rglob("*.py") if re.search(r"^@(helper|inlined|kernel)\b", file.read_text(encoding="utf-8"), re.MULTILINE)}
    assert len(compiled) > 30 and compiled <= hashed


@needs_compiler
@pytest.mark.parametrize("folder", ["", "/somewhere/else"])
def test_numbas_setting_is_left_as_found(monkeypatch, folder):
    monkeypatch.setattr(numba.config, "CACHE_DIR", folder)
    kernel(numba.float64(numba.float64))(lambda x: x)
    assert numba.config.CACHE_DIR == folder
    with pytest.raises(TypeError):
        kernel(numba.float64(numba.float64))("not a function")
    assert numba.config.CACHE_DIR == folder


@needs_compiler
def test_reference_counts_can_be_left_out_in_this_numba(monkeypatch):
    """A private option: without it everything works, 0.14 us a sample slower. Where it holds an allocation is a compile error."""
    assert OPTIONS.get("_nrt") is False
    assert numba.njit(_nrt=False)(lambda x: x + 1)(1) == 2      # numba refuses an option it does not know only when it compiles
    with pytest.raises(numba.TypingError):
        helper(lambda: np.zeros(3))()
    monkeypatch.setattr(jit.cpu, "CPUTargetOptions", object)
    assert not jit._reference_counts_can_be_left_out()


@needs_compiler
def test_another_type_is_refused_once_compiled(monkeypatch):
    monkeypatch.setattr(jit, "CACHE", None)       # kernels of tests do not belong there
    add = kernel(numba.float64(numba.float64[::1]))(lambda x: x[0] + 1)
    assert compile_kernel(add) and not compile_kernel(add) and is_cached(add)
    assert add(np.zeros(4)) == 1
    for wrong in (np.zeros(4)[::2], np.zeros(4, np.float32), 3.0):
        with pytest.raises(TypeError, match="No matching definition"):
            add(wrong)


@needs_compiler
def test_a_kernel_of_similar_name_does_not_count_as_cached(tmp_path, monkeypatch):
    """zero_velocity.observe in the cache says nothing of velocity.observe."""
    from strapdown.aiding import velocity
    other = kernel(OBSERVE)(velocity.observe.py_func)
    (tmp_path / "zero_velocity_1").mkdir()
    (tmp_path / "zero_velocity_1/zero_velocity.observe-5.py311.nbi").touch()
    monkeypatch.setattr(jit, "CACHE", tmp_path)
    assert not is_cached(other)
    (tmp_path / "zero_velocity_1/velocity.observe-5.py311.nbi").touch()
    assert is_cached(other)


def test_plain_is_the_function_behind_a_helper():
    double = lambda x: 2 * x
    assert plain(helper(double)) is double and plain(double) is double


@pytest.mark.short
def test_views_equal_their_python_twins():
    @helper
    def write(flat, square):
        view, line = matrix(flat, 3, 2, 4), flatten(square)
        view[1, 2] = 7.0
        line[4] = 9.0
        return view[0, 0] + view.shape[0] + 10 * view.shape[1] + 100 * line.size + line[3]

    flat, square = np.arange(20.0), np.arange(9.0).reshape(3, 3)
    assert write(flat, square) == 3 + 2 + 40 + 900 + 3
    assert flat[3 + 4 + 2] == 7 and square[1, 1] == 9
    np.testing.assert_array_equal(np.delete(flat, 9), np.delete(np.arange(20.0), 9))
    twin = jit._matrix_twin(flat, 3, 2, 4)
    assert np.shares_memory(twin, flat) and twin[1, 2] == 7 and twin.shape == (2, 4)


@pytest.mark.short
def test_a_kernel_is_called_by_its_address(monkeypatch):
    """That is how predict, correct and observers cross into `run`."""
    monkeypatch.setattr(jit, "CACHE", None)
    signature = numba.float64(numba.float64) if jit.COMPILED else "a signature"
    function_at = jit.caller(signature)
    triple = kernel(signature)(lambda x: 3 * x)
    compile_kernel(triple)

    @helper
    def through(address, x):
        return function_at(address)(x)

    assert through(jit.address(triple), 2.0) == 6.0
    assert jit.entry_point(triple)(2.0) == 6.0


@pytest.mark.parametrize("code", ["import strapdown", "import strapdown; dir(strapdown); strapdown.__version__"])
def test_importing_the_package_imports_nothing_heavy(code):
    assert python(f"{code}; import sys; print(*{{'numba', 'numpy', 'pandas', 'scipy', 'xarray', 'pydantic', 'typer'}} & set(sys.modules))") == []


def test_help_does_not_import_numba():
    code = """
        import contextlib, io, sys
        sys.argv = ["strapdown", "--help"]
        from strapdown.cli.app import main
        text = io.StringIO()
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            main()
        assert "fuse" in text.getvalue()
        print(*{"numba", "pandas", "scipy", "xarray", "pydantic", "plotly"} & set(sys.modules))
        """
    assert python(code) == []
