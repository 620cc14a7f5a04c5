"""Kernels on disk: an edit costs what it touches, nothing stale or broken is ever loaded,
importing leaves no trace."""

import importlib
import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numba
import pytest
from numba.core.registry import cpu_target

import strapdown
from strapdown.aiding import heading
from strapdown.core.compile import compiler, jit, kernel_cache
from strapdown.core.compile.jit import compile_kernel, kernel
from strapdown.core.compile.signatures import REAL, signature
from strapdown.core.loop.contract import OBSERVE
from strapdown.fileio.locks import PART, lock

PACKAGE = Path(strapdown.__file__).parent
pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")

COMPILE = """
    import importlib
    import numpy as np
    from strapdown.aiding import heading
    from strapdown.core.compile import jit
    from strapdown.core.loop.contract import FilterState
    from strapdown.core.mathematics.source import new_source
    was_cached = heading.observe.at_hand
    compiled = jit.compile_kernel(heading.observe)
    z, e = np.zeros(3), np.zeros(3)
    heading.observe(FilterState(z, z, np.eye(3), z, z, np.eye(15), z, z, z, np.zeros(0)), np.ones(3), new_source(), e, np.zeros((3, 15)))
    print(round(e[0], 6), compiled, was_cached)
    """
KEYS = """
    from strapdown.aiding import heading, velocity
    from strapdown.core.compile import compiler
    from strapdown.core.loop import loop
    from strapdown.filters.ins import closed_loop, mekf
    for kernel in (heading.observe, velocity.observe, loop.run, closed_loop.correct, mekf.correct):
        print(compiler.key(kernel))
    """
ONE = signature("one", REAL, x=REAL)
HEADING, VELOCITY, LOOP, CLOSED_LOOP, MEKF = range(5)


def python(code, path=PACKAGE.parent, **environment):
    """Words that a new process prints for `code`; it must print nothing on standard error. The
    package is taken from `path`."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(path),
        "PYTHONWARNINGS": "error",
        "PYTHONDONTWRITEBYTECODE": "1",
        **environment,
    }
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=environment,
        capture_output=True,
        text=True,
        cwd="/",
    )
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout.split()


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """Folder with a copy of the package."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, folder / "strapdown", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture
def edit(copy):
    """Function that replaces text in a file of the copy until the test ends."""
    before = {}

    def replace(name, old, new):
        file = copy / "strapdown" / name
        source, stamp = before.setdefault(file, (file.read_text(), file.stat()))
        assert source.count(old) >= 1
        file.write_text(source.replace(old, new, 1))
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # even where the clock hides it

    yield replace
    for file, (source, _) in before.items():
        file.write_text(source)


@pytest.fixture
def cache(tmp_path):
    """Where the kernels of a new process that is given this as XDG_CACHE_HOME go."""
    return tmp_path / "strapdown" / "kernels"


def compiled(path, cache):
    return python(COMPILE, path, XDG_CACHE_HOME=str(cache.parents[1]), NUMBA_CACHE_DIR="")


def test_a_changed_helper_in_another_file_is_noticed(copy, edit, cache):
    """numba itself looks only at the file of the kernel: a kernel in aiding/, its helper in
    core/."""
    assert compiled(copy, cache) == ["1.0", "True", "False"]
    assert compiled(copy, cache) == ["1.0", "False", "True"]
    edit("core/mathematics/rotation.py", "return angle - 2 *", "return angle + 1 - 2 *")
    assert compiled(copy, cache) == ["2.0", "True", "False"]
    edit("core/mathematics/rotation.py", "return angle - 2 *", "return angle - 2 *")
    assert compiled(copy, cache) == ["1.0", "False", "True"]  # and the old one is still there
    assert len(list(cache.iterdir())) == 2
    assert not list(copy.glob("strapdown/**/__pycache__"))  # numba's own, stale place


@pytest.fixture(scope="module")
def keys(copy):
    return python(KEYS, copy)


def changed(copy, keys):
    return [
        number
        for number, (old, new) in enumerate(zip(keys, python(KEYS, copy), strict=True))
        if old != new
    ]


def test_docstrings_comments_and_annotations_recompile_nothing(copy, edit, keys):
    edit("aiding/heading.py", '"""', '"""Another sentence. ')
    edit("core/mathematics/earth.py", "\n\n\n", "\n\n\n# a comment\n\n")
    edit("core/mathematics/rotation.py", "(angle: float) -> float", "(angle)")
    assert changed(copy, keys) == []


@pytest.mark.parametrize(
    "name, touched",
    [
        ("aiding/heading.py", [HEADING]),
        ("filters/ins/mekf.py", [MEKF]),
        ("core/mathematics/error_state.py", [CLOSED_LOOP, MEKF]),
        ("core/mathematics/mechanization.py", [LOOP, CLOSED_LOOP, MEKF]),
        ("engine/batch.py", []),
        ("core/compile/library.py", []),
        ("core/loop/contract.py", [HEADING, VELOCITY, CLOSED_LOOP, MEKF]),
        ("core/compile/compiler.py", [HEADING, VELOCITY, LOOP, CLOSED_LOOP, MEKF]),
    ],
)
def test_an_edit_recompiles_what_it_touches(copy, edit, keys, name, touched):
    edit(name, "\nfrom ", "\nEXTRA = 1\nfrom ")
    assert changed(copy, keys) == touched


@pytest.mark.parametrize(
    "setting, value",
    [
        ("LOOP_VECTORIZE", 0),
        ("SLP_VECTORIZE", 1),
        ("OPT", 1),
        ("BOUNDSCHECK", 1),
        ("DEBUGINFO_DEFAULT", 1),
        ("ENABLE_AVX", False),
        ("LLVM_REFPRUNE_PASS", 0),
        ("A_SETTING_TO_COME", 1),
    ],
)
def test_settings_that_change_machine_code_make_another_kernel(monkeypatch, setting, value):
    before = compiler.key(heading.observe)
    monkeypatch.setattr(numba.config, setting, value, raising=False)
    assert compiler.key(heading.observe) != before


@pytest.mark.parametrize(
    "setting, value",
    [
        ("CACHE_DIR", "/elsewhere"),
        ("NUMBA_NUM_THREADS", 7),
        ("DUMP_ASSEMBLY", 1),
        ("COLOR_SCHEME", "dark_bg"),
        ("CUDA_LOG_LEVEL", "debug"),
        ("DISABLE_PERFORMANCE_WARNINGS", 1),
    ],
)
def test_settings_of_no_effect_make_none(monkeypatch, setting, value):
    before = compiler.key(heading.observe)
    monkeypatch.setattr(numba.config, setting, value, raising=False)
    assert compiler.key(heading.observe) == before


def test_numba_and_processor_belong_to_the_key(monkeypatch):
    before = compiler.key(heading.observe)
    monkeypatch.setattr(kernel_cache.numba, "__version__", "0.0")
    other = compiler.key(heading.observe)
    codegen = type(cpu_target.target_context.codegen())
    monkeypatch.setattr(codegen, "magic_tuple", lambda self: ("x86_64", "another", ""))
    assert len({before, other, compiler.key(heading.observe)}) == 3


def test_importing_every_module_with_kernels_makes_and_deletes_nothing(tmp_path):
    code = """
        import pkgutil, importlib, strapdown
        for module in pkgutil.walk_packages(strapdown.__path__, "strapdown."):
            if not module.name.endswith(("__main__", "distributed")):
                importlib.import_module(module.name)
        """
    leftover = tmp_path / f"strapdown/kernels/.dead{PART}"
    leftover.parent.mkdir(parents=True)
    leftover.touch()
    python(code, XDG_CACHE_HOME=str(tmp_path), NUMBA_CACHE_DIR="")
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [leftover]


def test_a_broken_file_is_compiled_anew(copy, cache):
    """Empty, half written, cut at its end, with one byte changed: none is loaded."""
    assert compiled(copy, cache) == ["1.0", "True", "False"]
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    place = compiler.cache_of(heading.observe)
    context = cpu_target.target_context
    for broken in (b"", b"half", whole[:-1], whole[:40] + b"x" + whole[41:]):
        place.path = file
        file.write_bytes(broken)
        assert place.load_overload(None, context) is None
    assert compiled(copy, cache)[:2] == ["1.0", "True"]  # and is written anew
    assert compiled(copy, cache) == ["1.0", "False", "True"]
    assert [each.name for each in cache.iterdir()] == [file.name]


def test_what_a_killed_process_left_is_swept_at_the_next_write(copy, cache):
    cache.mkdir(parents=True)
    (cache / f".dead{PART}").write_bytes(b"half a kernel")
    with (cache / f".alive{PART}").open("wb") as held:
        lock(held)
        assert compiled(copy, cache)[1] == "True"
    names = [file.name for file in cache.iterdir() if file.suffix != ".kernel"]
    assert names == [f".alive{PART}"] and len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("place", ["a file", "read-only", "full"])
def test_a_folder_that_cannot_be_written_means_no_cache_and_no_noise(tmp_path, monkeypatch, place):
    """Root may write anywhere, so a folder that is read-only or full is played by the call that
    would fail there."""
    if place == "a file":
        (tmp_path / "file").write_text("not a folder")
        assert python(COMPILE, XDG_CACHE_HOME=str(tmp_path / "file"), NUMBA_CACHE_DIR="") == [
            "1.0",
            "True",
            "False",
        ]
        return
    fails = {"read-only": "kernel_cache.Path.mkdir", "full": "kernel_cache.os.replace"}[place]
    code = f"""
        import os
        from strapdown.core.compile import kernel_cache
        def fail(*words, **more):
            raise OSError(28, "No space left on device")
        {fails} = fail
        """
    assert python(
        textwrap.dedent(code) + textwrap.dedent(COMPILE),
        XDG_CACHE_HOME=str(tmp_path),
        NUMBA_CACHE_DIR="",
    ) == ["1.0", "True", "False"]
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]


def test_two_processes_at_once_leave_one_whole_kernel(copy, cache):
    environment = {
        **os.environ,
        "PYTHONPATH": str(copy),
        "XDG_CACHE_HOME": str(cache.parents[1]),
        "NUMBA_CACHE_DIR": "",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    both = [
        subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(COMPILE)],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    assert all(
        process.communicate()[0].startswith("1.0") and process.returncode == 0 for process in both
    )
    assert compiled(copy, cache) == ["1.0", "False", "True"] and len(list(cache.iterdir())) == 1


def test_a_user_without_a_home_has_no_cache(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(
        kernel_cache.Path,
        "home",
        lambda: (_ for _ in ()).throw(RuntimeError("Could not determine home directory.")),
    )
    assert kernel_cache.folder() is None


def test_numbas_own_setting_of_the_folder_is_respected_and_left_as_found(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert kernel_cache.folder() == tmp_path / "strapdown/kernels"
    assert numba.config.CACHE_DIR == str(tmp_path)


def test_the_versions_used_last_are_kept(tmp_path, monkeypatch):
    from strapdown.aiding import heading

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    place = compiler.cache_of(heading.observe)
    place.path.parent.mkdir(parents=True)
    for age in range(10):
        old = place.path.with_name(f"strapdown.aiding.heading.observe-{age}.kernel")
        old.touch()
        os.utime(old, (1e9 - age, 1e9 - age))
    (tmp_path / "strapdown/kernels/strapdown.aiding.velocity.observe-0.kernel").touch()
    place._sweep(place.path)
    place.path.touch()
    names = {
        file.name.removeprefix("strapdown.aiding.") for file in place.path.parent.iterdir()
    } - {place.path.name.removeprefix("strapdown.aiding.")}
    assert names == {
        "velocity.observe-0.kernel",
        *(f"heading.observe-{age}.kernel" for age in range(kernel_cache.KEEP - 1)),
    }


def test_a_kernel_made_inside_a_function_is_not_kept(tmp_path, monkeypatch):
    """Its machine code can depend on what the function was given, which no file says."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    triple = kernel(ONE)(lambda x: 3 * x)
    assert compile_kernel(triple) and triple(2.0) == 6.0 and not list(tmp_path.rglob("*.kernel"))


def test_a_kernel_of_similar_name_does_not_count_as_cached(tmp_path, monkeypatch):
    """zero_velocity.observe in the cache says nothing of velocity.observe."""
    from strapdown.aiding import velocity, zero_velocity

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    other = kernel(OBSERVE)(velocity.observe.py_func)
    place = compiler.cache_of(zero_velocity.observe).path
    place.parent.mkdir(parents=True)
    place.touch()
    assert not other.at_hand
    compiler.cache_of(other).path.touch()
    assert other.at_hand


USER = """
    import sys
    sys.path.insert(0, {folder!r})
    import mine
    from strapdown.core.compile import compiler, jit, kernel_cache
    jit.compile_kernel(mine.kernel_of_mine)
    print(mine.kernel_of_mine(1.0), compiler.key(mine.kernel_of_mine), *sorted(kernel_cache.import_closure(mine)[0].values()))
    """


def test_kernels_of_a_users_own_files_follow_what_these_import(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from strapdown.core.compile.jit import kernel\nfrom strapdown.core.compile.signatures import REAL, signature\nfrom helpers import scaled\n\n"
        "ONE = signature('one', REAL, x=REAL)\n@kernel(ONE)\ndef kernel_of_mine(x):\n    return scaled(x)\n"
    )
    helpers = tmp_path / "helpers.py"
    run = lambda: python(
        USER.format(folder=str(tmp_path)), XDG_CACHE_HOME=str(tmp_path), NUMBA_CACHE_DIR=""
    )
    source = "from strapdown.core.compile.jit import helper\nFACTOR = 3.0\n\n@helper\ndef scaled(x):\n    return FACTOR * x\n"
    helpers.write_text(source)
    first = run()
    helpers.write_text(source.replace("3.0", "5.0"))
    second = run()
    assert (
        (first[0], second[0]) == ("3.0", "5.0")
        and first[1] != second[1]
        and {"helpers", "strapdown.core.compile.signatures"} <= set(first[2:])
    )


def test_the_closure_of_every_kernel_holds_the_modules_of_its_helpers():
    """What a kernel calls is found in the globals of its module; each such function's own file
    must be in the closure."""
    from compile_all import kernels

    checked = 0
    for module in {each.__module__ for each in kernels()}:
        loaded = sys.modules[module]
        files = set(kernel_cache.import_closure(loaded)[0].values())
        for value in vars(loaded).values():
            if re.match("strapdown", getattr(getattr(value, "py_func", None), "__module__", "")):
                checked += 1
                assert value.py_func.__module__ in files
    assert checked > 100


# ---- values that a kernel closes over

HEAD = """
import enum, math, os
import numpy as np
from collections import namedtuple
from strapdown.core.compile.jit import helper, inline, kernel
from strapdown.core.compile.signatures import REAL, signature
K = float(os.environ["K"])
ONE = signature("one", REAL, x=REAL)
"""
TAIL = """
@kernel(ONE)
def mine(x):
    return {}
"""
FORMS = {
    "number": ("", "K * x"),
    "tuple": ("T = (1, (2.0, K))", "T[1][1] * x"),
    "named tuple": ("T = namedtuple('T', 'a k')(1.0, K)", "T.k * x"),
    "array": ("A = np.array([[0.0, K]])", "A[0, 1] * x"),
    "number of numpy": ("N = np.float32(K)", "N * x"),
    "slice": ("S = slice(int(K), 10)", "np.arange(10.0)[S][0] * x"),
    "member of an enumeration": ("E = enum.IntEnum('E', {'A': int(K)})", "E.A * x"),
    "of a module": ("import others", "others.K * x"),
    "of a helper": ("@helper\ndef h(x):\n    return K * x", "h(x)"),
    "of a helper's helper": (
        "@inline\ndef g(x):\n    return K * x\n@helper\ndef h(x):\n    return g(x)",
        "h(x)",
    ),
    "of a helper in another module": ("from others import h", "h(x)"),
    "in a cell": (
        "def of(k):\n    @helper\n    def h(x):\n        return k * x\n    return h\nh = of(K)",
        "h(x)",
    ),
    "which of two helpers": (
        "if K > 1:\n    @helper\n    def h(x):\n        return 3 * x\n"
        "else:\n    @helper\n    def h(x):\n        return 1 * x",
        "h(x)",
    ),
    "which of two cells": (
        "def of(k):\n    @helper\n    def h(x):\n        return k * x\n    return h\n"
        "a, b, c = of(1), of(3), of(0)\nf, g = (a, c) if K == 1 else (b, c)",
        "f(x) + g(x)",
    ),
    "a default": ("@helper\ndef h(x, k=K):\n    return k * x", "h(x)"),
    "of numba's own": ("import numba\n@numba.njit\ndef h(x):\n    return K * x", "h(x)"),
    "in a function inside": ("", "sum([K * y for y in (x, 0.0)])"),
}
WITHOUT_WORDS = {
    "a plain function": (
        "from numba.extending import register_jitable\n@register_jitable\ndef h(x):\n    return K * x",
        "h(x)",
        "h in mine is a function",
    ),
    "a ufunc of numba": (
        "import numba\n@numba.vectorize(['f8(f8)'])\ndef h(x):\n    return K * x",
        "h(x)",
        "h in mine is a DUFunc",
    ),
    "a module by another name": (
        "import others\n@helper\ndef h(x):\n    m = others\n    return m.K * x",
        "h(x)",
        "others in h is a module",
    ),
    "an object": ("class C:\n    k = K\nc = C()", "c.k * x", "c.k in mine is a C"),
}
OTHERS = """
import os
from strapdown.core.compile.jit import helper
K = float(os.environ["K"])

@helper
def h(x):
    return K * x
"""


@pytest.fixture
def written(tmp_path):
    """Function that writes the module of a kernel of one's own."""
    (tmp_path / "others.py").write_text(OTHERS)
    return lambda form, result: (tmp_path / "mine.py").write_text(HEAD + form + TAIL.format(result))


@pytest.fixture
def loaded(written, tmp_path, monkeypatch):
    """Function that imports the module anew, where K has a value."""
    monkeypatch.syspath_prepend(tmp_path)

    def load(K):
        monkeypatch.setenv("K", str(K))
        for name in ("mine", "others"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        return importlib.import_module("mine").mine

    return load


@pytest.fixture
def user(tmp_path):
    """Result of the kernel in a new process, and whether it was compiled."""
    code = f"""
        import sys
        sys.path.insert(0, {str(tmp_path)!r})
        import mine
        new = mine.mine.ready()
        print(mine.mine(1.0), new)
        """
    return lambda K: python(code, XDG_CACHE_HOME=str(tmp_path), NUMBA_CACHE_DIR="", K=str(K))


@pytest.mark.parametrize("form, result", FORMS.values(), ids=FORMS)
def test_values_that_a_kernel_closes_over_make_another_kernel(written, loaded, form, result):
    written(form, result)
    one, again, three = (kernel_cache.code_digest(loaded(K)) for K in (1, 1, 3))
    assert one == again != three


def test_a_kept_kernel_has_the_values_of_its_process(written, user):
    written(*FORMS["of a helper's helper"])
    assert [user(K) for K in (1, 3, 1)] == [["1.0", "True"], ["3.0", "True"], ["1.0", "False"]]


def test_digests_are_the_same_in_every_process(written, tmp_path):
    written(*FORMS["of a helper in another module"])
    code = f"""
        import sys
        sys.path[:0] = [{str(Path(__file__).parents[2])!r}, {str(tmp_path)!r}]
        import mine
        from compile_all import kernels
        from strapdown.core.compile import kernel_cache, library
        for kernel in (mine.mine, *kernels()):
            print(kernel_cache.code_digest(kernel), library.values_of(kernel))
        """
    one, other = (python(code, PYTHONHASHSEED=seed, K="1") for seed in "12")
    assert one == other and len(one) > 200


@pytest.mark.parametrize("form, result, why", WITHOUT_WORDS.values(), ids=WITHOUT_WORDS)
def test_a_kernel_of_values_without_words_says_why_it_is_not_kept(
    written, loaded, form, result, why
):
    written(form, result)
    mine, said = loaded(1), []
    place = compiler.cache_of(mine)
    assert (place.path, place.why_not) == (None, why) and not mine.at_hand
    jit.compile_together([mine], "mine", said.append)
    assert said == [f"compiling mine in each process, since {why} ..."]


def test_a_kernel_that_is_not_kept_has_the_values_of_its_process(written, user, tmp_path):
    written(*WITHOUT_WORDS["a plain function"][:2])
    assert [user(K) for K in (1, 3)] == [["1.0", "True"], ["3.0", "True"]]
    assert not list(tmp_path.rglob("*.kernel"))


def test_a_value_that_changed_while_the_process_runs_is_not_kept(written, loaded):
    """numba compiles a helper once in a process, whatever its values are by then."""
    written(*FORMS["of a helper"])
    mine = loaded(1)
    assert compiler.cache_of(mine).path
    sys.modules["mine"].K = 3.0
    assert compiler.cache_of(mine).why_not == "a value in h has changed since it was compiled"


def test_numbers_count_bit_for_bit(written, loaded):
    written(
        "Z = {'1': 0.0, '2': -0.0, '3': 0, '4': False, '5': math.nan}[os.environ['K']]", "Z + x"
    )
    digests = [kernel_cache.code_digest(loaded(K)) for K in (1, 2, 3, 4, 5, 5)]
    assert len(set(digests)) == 5 and digests[4] == digests[5]
