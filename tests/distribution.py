"""`make dist`: sdist and wheel of both packages in dist, checked, each installed by pip into a new
environment where the demo runs. One line of result; the first thing that fails ends it.

    python tests/distribution.py [DIST]
"""

import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ROOT, ROOT / "reproductions"
TRIED = """import strapdown as sd, strapdown_reproductions
recording = sd.simulate("demo", 20.0, seed=1)
assert sd.fuse(recording, "closed-loop").has_position
print(sd.__version__)"""


def run(*command, **options):
    """A command's standard output. Ends with its last lines where it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **options)
    if done.returncode:
        sys.exit("\n".join((done.stdout + done.stderr).strip().splitlines()[-15:]))
    return done.stdout.strip()


def built(folder):
    """Sdists and the wheels that are made of them: [files of kind ...], both packages in each."""
    for package in PACKAGES:
        run(sys.executable, "-m", "build", "--outdir", folder, package)
    return [sorted(folder.glob(ending)) for ending in ("*.tar.gz", "*.whl")]


def tried(files, folder):
    """Install files into a new environment in a folder, and use what they brought: the version."""
    venv.create(folder / "venv", with_pip=True)
    bin = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
    keep = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    run(bin / "python", "-m", "pip", "install", "--quiet", *files, env=keep, cwd=folder)
    run(bin / "strapdown", "demo", "--out", folder / "report.html", env=keep, cwd=folder)
    said = run(bin / "strapdown", "--version", env=keep, cwd=folder)
    version = run(bin / "python", "-c", TRIED, env=keep, cwd=folder)
    if said != f"strapdown {version}" or not (folder / "report.html").stat().st_size > 1e5:
        sys.exit(f"{files[0].name}: it says {said!r}, and its version is {version}")
    return version


def main(dist):
    """All of it."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        sdists, wheels = built(folder / "dist")
        run(sys.executable, "-m", "twine", "check", "--strict", *sdists, *wheels)
        run(sys.executable, "-m", "check_wheel_contents", *wheels)
        for kind, files in (("sdist", sdists), ("wheel", wheels)):
            (folder / kind).mkdir()
            version = tried(files, folder / kind)
        dist.mkdir(exist_ok=True)
        for file in (*sdists, *wheels):
            shutil.copyfile(file, dist / file.name)
    sizes = ", ".join(
        f"{file.name} {file.stat().st_size / 1e6:.1f} MB"
        for file in sorted(dist.glob(f"*{version}*"))
    )
    print(f"{dist}: {sizes}; checked, installed and run")


if __name__ == "__main__":
    main(Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "dist")
