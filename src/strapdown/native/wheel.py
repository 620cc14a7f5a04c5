"""`make wheel`: a wheel with the library of kernels.

python -m strapdown.native.wheel DIST [LEVELS]
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


def build_wheel(dist: Path, levels: str = "all") -> Path:
    """Build the library into build/library of the checkout, and a wheel with it, or without it
    where it cannot be built. Raises RuntimeError where the wheel fails too."""
    folder = CHECKOUT / "build" / "library"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(
        [sys.executable, "-m", "strapdown.native.build", folder, "--levels", levels], check=False
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


def describe_wheel(wheel: Path) -> str:
    """File, size and tag of a wheel, and the levels that it has kernels for."""
    tag = "-".join(wheel.stem.split("-")[-3:])
    with zipfile.ZipFile(wheel) as file:
        name = f"strapdown/lib/{library.MANIFEST}"
        there = name in file.namelist()
        levels = ", ".join(json.loads(file.read(name))["libraries"]) if there else ""
    what = (
        f"kernels for {levels}" if there else "without kernels, which numba compiles on first use"
    )
    return f"{wheel}, {wheel.stat().st_size / 1e6:.1f} MB, {tag}: {what}"


if __name__ == "__main__":
    print(describe_wheel(build_wheel(Path(sys.argv[1]), *sys.argv[2:])))
