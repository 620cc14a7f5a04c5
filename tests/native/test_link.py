"""Linkers that are there and are not, and the tag of what they make."""

import ctypes
import platform
import shutil

import pytest

from strapdown.checks import DataError
from strapdown.native import link, object_files
from strapdown.native.build import levels_here
from strapdown.native.emit import TARGETS, emit

ONE = """target datalayout = "e"
target triple = "x86_64-unknown-linux-gnu"
declare double @exp(double)
declare double @missing(double)
define double @one(double %x) {
  %y = call double @exp(double %x)
  ret double %y
}
"""


@pytest.fixture
def compiled(tmp_path):
    """Object of a function for this machine."""
    try:
        level = levels_here()[-1]
        link.linker()
    except DataError as error:
        pytest.skip(str(error))
    gnu = platform.libc_ver()[0] == "glibc"
    path = tmp_path / "one.o"
    path.write_bytes(emit([ONE], TARGETS[level], ["one"], versioned=gnu).content)
    return path


def test_a_library_is_linked_runs_and_says_where(compiled, tmp_path):
    content = link.link([compiled], tmp_path / "one.so")
    one = ctypes.CDLL(str(tmp_path / "one.so")).one
    one.restype, one.argtypes = ctypes.c_double, [ctypes.c_double]
    assert one(0.0) == 1.0 and object_files.defined(content) == ("one",)
    runs = link.platform_of([content], platform.machine())
    if platform.libc_ver()[0] == "glibc":
        assert runs.tag == f"manylinux_2_17_{platform.machine()}"


@pytest.mark.parametrize(
    "libraries, versions, tag, needs",
    [
        ([], {}, "manylinux_2_17_x86_64", "glibc 2.17"),
        (["libm.so.6"], {"libm.so.6": ("GLIBC_2.2.5",)}, "manylinux_2_17_x86_64", "libm.so.6"),
        (
            ["libm.so.6", "libc.so.6"],
            {"libm.so.6": ("GLIBC_2.2.5", "GLIBC_2.29"), "libc.so.6": ("GLIBC_2.14",)},
            "manylinux_2_29_x86_64",
            "glibc 2.29",
        ),
        (["libm.so.6"], {"libm.so.6": ("GLIBC_ABI_DT_RELR",)}, "linux_x86_64", "GLIBC_ABI"),
        (["libgfortran.so.5", "libm.so.6"], {}, "linux_x86_64", "libgfortran.so.5"),
        (["libc.musl-x86_64.so.1"], {}, "linux_x86_64", "indexes refuse it"),
    ],
)
def test_tags(monkeypatch, libraries, versions, tag, needs):
    monkeypatch.setattr(object_files, "libraries", lambda content: tuple(libraries))
    monkeypatch.setattr(object_files, "versions", lambda content: versions)
    runs = link.platform_of([b""], "x86_64")
    assert runs.tag == tag and needs in runs.needs


def test_a_broken_linker_is_one_line_with_what_it_said(compiled, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(DataError, match="^false links no library of kernels: it ended with 1$"):
        link.link([compiled], tmp_path / "one.so")
    monkeypatch.delenv("CC")
    compiled.write_bytes(compiled.read_bytes()[:100])
    with pytest.raises(DataError, match="links no library of kernels: .*one.o"):
        link.link([compiled], tmp_path / "one.so")


def test_no_linker_is_one_line_with_the_remedy(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(DataError, match="no linker: .CC, no-such-compiler, is not found; install"):
        link.linker()
    monkeypatch.setenv("CC", "")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(link.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DataError, match="no linker: none of cc, gcc, clang and zig is found"):
        link.linker()


def test_linkers_in_their_order(monkeypatch):
    found = {"clang", "zig"}
    monkeypatch.setattr(shutil, "which", lambda name: name if name in found else None)
    monkeypatch.setenv("CC", "")
    assert link.linker() == ["clang"]
    found.remove("clang")
    assert link.linker() == ["zig", "cc"]
    found.add("ccache")
    monkeypatch.setenv("CC", "ccache gcc")
    assert link.linker() == ["ccache", "gcc"]
    found.clear()
    monkeypatch.setenv("CC", "")
    monkeypatch.setattr(link.importlib.util, "find_spec", lambda name: name == "ziglang")
    assert link.linker()[1:] == ["-m", "ziglang", "cc"]
