"""The whole library: every filter has the bits that it has compiled, and plain Python, at every level
of processor."""

import json
import os
import shutil
import subprocess
import sys

import pytest
from golden import bits

from strapdown.core.compile import library

RUN = """
import sys
sys.modules["numba"] = None  # importing it raises
from golden import bits
from strapdown import filters
from strapdown.core.compile import library
kept = bits.kept()
other = bits.BY_LAPACK if bits.lapack() != kept["lapack"] else ()
found = {name: bits.digest(name) for name in filters.names() if name not in other}
print(library.load_library().level, *(name for name in found if found[name] != kept[name]))
"""
LEVELS = library.LEVELS.get(library.system(), {})


@pytest.mark.deep
@pytest.mark.parametrize("level", LEVELS)
def test_every_filter_of_the_library_has_its_bits(whole_library, tmp_path, level):
    if bits.libm() != bits.kept()["libm"]:
        pytest.skip("another mathematical library than that of bits.json")
    if level not in library.levels():
        pytest.skip(f"this processor is not {level}")
    made = json.loads((whole_library / library.MANIFEST).read_bytes())
    made["libraries"] = {level: made["libraries"][level]}
    (tmp_path / library.MANIFEST).write_text(json.dumps(made))
    shutil.copy(whole_library / made["libraries"][level]["file"], tmp_path)
    matrices = bits.MATRICES if "x86-64-v3" in library.levels() else {}
    environment = {library.SETTING: str(tmp_path), library.REQUIRED: "1", "NUMBA_DISABLE_JIT": "0"}
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env={**os.environ, "PYTHONPATH": paths, **matrices, **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [level]
