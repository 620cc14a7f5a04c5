"""What object files need, against libraries that a C compiler makes."""

import platform
import shutil
import subprocess

import pytest

from strapdown.native import object_files

CODE = """
#include <math.h>
__asm__(".symver exp,exp@%s");
double one(double x) { return exp(x) + sin(x); }
"""
OLDEST = {"x86_64": "GLIBC_2.2.5", "aarch64": "GLIBC_2.17"}.get(platform.machine())
needs_gcc = pytest.mark.skipif(
    not (shutil.which("gcc") and OLDEST), reason="no gcc, or no library is built for this machine"
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(object, library that asks for an old symbol by its version) as bytes."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "one.c").write_text(CODE % OLDEST, encoding="utf-8")
    subprocess.run(["gcc", "-O1", "-fPIC", "-c", "one.c"], cwd=folder, check=True)
    command = "gcc -shared -nostartfiles one.o -o one.so -lm -Wl,-soname,one.so"
    subprocess.run(command.split(), cwd=folder, check=True)
    return (folder / "one.o").read_bytes(), (folder / "one.so").read_bytes()


@needs_gcc
def test_what_an_object_asks_for(made):
    assert set(object_files.undefined(made[0])) - {"_GLOBAL_OFFSET_TABLE_"} == {
        f"exp@{OLDEST}",
        "sin",
    }


@needs_gcc
def test_what_a_library_asks_for_and_offers(made):
    library = made[1]
    assert object_files.undefined(library) == ("exp", "sin")
    assert object_files.defined(library) == ("one",)
    assert object_files.libraries(library) == ("libm.so.6",)
    assert object_files.versions(library) == {"libm.so.6": (OLDEST,)}


@needs_gcc
def test_versions_are_those_that_readelf_shows(made):
    shown = subprocess.run(
        ["readelf", "-V", "/proc/self/exe"], capture_output=True, text=True, check=True
    ).stdout.partition("Version needs")[2]
    with open(shutil.which("readelf"), "rb") as file:
        found = object_files.versions(file.read())
    assert sum(map(len, found.values())) == shown.count("Name: ") > 2
    assert all(f"Name: {each} " in shown for listed in found.values() for each in listed)


def test_what_is_no_object_is_refused():
    for content in (b"", b"MZ" + bytes(100), b"\x7fELF", b"\x7fELF\x02\x02" + bytes(100)):
        with pytest.raises(ValueError, match="neither an ELF file nor WebAssembly"):
            object_files.undefined(content)
