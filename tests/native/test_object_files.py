"""What object files need, against one that a C compiler makes."""

import shutil
import subprocess

import pytest

from strapdown.native import object_files

CODE = """
#include <math.h>
double one(double x) { return exp(x) + sin(x); }
"""


@pytest.mark.skipif(not shutil.which("gcc"), reason="no gcc")
def test_what_an_object_of_a_c_compiler_asks_for(tmp_path):
    (tmp_path / "one.c").write_text(CODE, encoding="utf-8")
    subprocess.run(["gcc", "-O1", "-fPIC", "-c", "one.c"], cwd=tmp_path, check=True)
    made = (tmp_path / "one.o").read_bytes()
    assert set(object_files.undefined_symbols(made)) - {"_GLOBAL_OFFSET_TABLE_"} == {"exp", "sin"}


def test_what_is_no_object_is_refused():
    for content in (b"", b"MZ" + bytes(100), b"\x7fELF", b"\x7fELF\x02\x02" + bytes(100)):
        with pytest.raises(ValueError, match="neither an ELF file nor WebAssembly"):
            object_files.undefined_symbols(content)
