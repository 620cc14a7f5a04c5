"""The digest of a study's code: complete, and indifferent to what cannot change a result."""

import shutil
import subprocess
import sys

import pytest

from strapdown.experiments.monte_carlo import sources

MATTER = (
    "core/loop/loop.py",
    "core/mathematics/kalman.py",
    "aiding/position.py",
    "filters/ins/closed_loop.py",
    "sim/synthesis.py",
    "sensor_models/geomagnetism.py",
    "preprocessing/lever_arm.py",
    "engine/batch.py",
    "evaluation/consistency.py",
    "experiments/monte_carlo/chunks.py",
    "experiments/monte_carlo/scoring.py",
    "geometry/rotation_products.py",
)
DATA = ("sensor_models/egm96.xz", "sensor_models/grades/tactical.toml")
NOT = ("cli/app.py", "pages/page.py", "io/readers/ubx.py", "experiments/advice/advise.py")


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the library, whose files can be changed."""
    root = tmp_path_factory.mktemp("library") / "strapdown"
    shutil.copytree(sources.ROOT, root, ignore=shutil.ignore_patterns("__pycache__"))
    return root


@pytest.fixture
def digest(copied, monkeypatch):
    monkeypatch.setattr(sources, "ROOT", copied)
    return lambda: sources.versions()["sources"]


def test_changed_code_and_data_change_the_digest(copied, digest):
    known = {digest()}
    for name in (*MATTER, *DATA):
        file = copied / name
        content = file.read_bytes()
        file.write_bytes(content + b"\nCHANGED = 1\n")
        found = digest()
        file.write_bytes(content)
        assert found not in known, name
        known.add(found)


def test_docstrings_comments_and_rooms_that_no_chunk_enters_do_not(copied, digest):
    before = digest()
    for name in NOT:
        (copied / name).write_text((copied / name).read_text() + "\nCHANGED = 1\n")
    file = copied / MATTER[0]
    file.write_text(file.read_text().replace('"""', '"""Other words. ', 1) + "# a comment\n")
    assert digest() == before


def test_versions_of_what_computes_count():
    found = sources.versions()
    assert {"numpy", "scipy", "numba", "llvmlite", "pygeomag"} <= set(found)
    assert not {"pandas", "h5netcdf", "plotly"} & set(found)
    assert found["numpy"] == sys.modules["numpy"].__version__


CHUNK = """
import sys
from types import SimpleNamespace
from strapdown.evaluation.consistency import LossLimits
from strapdown.experiments.monte_carlo import chunks
study = SimpleNamespace(cells=chunks.cells(("demo",), ("tactical",)), filters=("closed-loop",), seed=1,
    epoch=60.0, keep=1, limits=LossLimits(), installation={"clock": (0.01,)}, side_by_side=False)
chunks.run_chunk(study, chunks.Chunk(0, 0, 1))
print(*(name for name in sys.modules if name.partition(".")[0] == "strapdown"))
"""


def test_every_module_that_a_chunk_loads_counts():
    """So the rooms that are left out by name are indeed not asked."""
    done = subprocess.run([sys.executable, "-c", CHUNK], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert set(done.stdout.split()) <= set(sources.closure()[0])
