"""`make wheel`: a wheel with the library of kernels, and what its tag asks of a machine.

python -m strapdown.native.wheel DIST
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from ..core.compile import library

CHECKOUT = library.PACKAGE.parents[1]


def made(dist: Path) -> Path:
    """Build the library into build/library of the checkout, and a wheel with it; without it where that
    cannot be built. Raises RuntimeError where there is no wheel either."""
    folder = CHECKOUT / "build" / "library"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(
        [sys.executable, "-m", "strapdown.native.build", folder, "--levels", "all"], check=False
    )
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    with tempfile.TemporaryDirectory() as temporary:
        subprocess.run(
            [*command, "--no-deps", "--wheel-dir", temporary, CHECKOUT],
            env={**os.environ, library.SETTING: str(folder) if folder.exists() else "0"},
            check=False,
        )
        for new in Path(temporary).glob("strapdown-*.whl"):
            dist.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(new, dist / new.name)
            return dist / new.name
    raise RuntimeError("pip made no wheel")


def told(wheel: Path) -> str:
    """File, size, tag of a wheel, and what the tag asks for."""
    tag = "-".join(wheel.stem.split("-")[-3:])
    with zipfile.ZipFile(wheel) as file:
        name = f"strapdown/lib/{library.MANIFEST}"
        there = name in file.namelist()
        needs = json.loads(file.read(name))["needs"] if there else ""
    what = f"needs {needs}" if there else "for any machine, where numba compiles on first use"
    return f"{wheel}, {wheel.stat().st_size / 1e6:.1f} MB, {tag}: {what}"


if __name__ == "__main__":
    print(told(made(Path(sys.argv[1]))))
