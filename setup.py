"""The library of kernels in what is built, what it then depends on, and the README as a package
index can show it; everything else stands in pyproject.toml.

STRAPDOWN_LIBRARY=1 builds it, the name of a folder takes the one there, else there is none
(docs/how-to/library.md). Where it cannot be built, what is built works without it and says so.
"""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
PACKAGE = HERE / "src" / "strapdown"
SAID = os.environ.get("STRAPDOWN_LIBRARY", "").strip()
WANTED = SAID not in ("", "0")
MANIFEST = "kernels.json"


def readme() -> str:
    """README.md for a package index, where links into the checkout lead nowhere: they lead to the
    address of the repository, where pyproject.toml has one in project.urls, else they are plain
    text, and pictures are left out."""
    told = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    base = told.get("urls", {}).get("Repository", "").rstrip("/")
    text = (HERE / "README.md").read_text(encoding="utf-8")
    inside = r"\((?!\w+:|#)([^)\s]+)\)"
    if base:
        text = re.sub(rf"(!\[[^\]]*\]){inside}", rf"\1({base}/raw/HEAD/\2)", text)
        return re.sub(rf"(\[[^\]]*\]){inside}", rf"\1({base}/blob/HEAD/\2)", text)
    text = re.sub(rf"!\[[^\]]*\]{inside}\n*", "", text)
    return re.sub(rf"\[([^\]]*)\]{inside}", r"\1", text)


def dependencies() -> list[str]:
    """Packages that strapdown runs with. The compiler is one where the library is not known to be
    there before the build: what is built without it compiles on use."""
    told = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))
    compiler = told["project"]["optional-dependencies"]["compile"]
    brings_kernels = SAID not in ("", "0", "1") and not why_unusable(Path(SAID))
    return told["tool"]["strapdown"]["dependencies"] + ([] if brings_kernels else compiler)


def build_library(folder: Path, levels: list[str]) -> str:
    """Build it into a folder; what is missing where that fails."""
    paths = [str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-m", "strapdown.native.build", str(folder), *levels],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stderr=subprocess.PIPE,
        text=True,
    )
    last = ""
    for line in process.stderr or ():
        if line[:1].isdigit():
            print(line, end="", file=sys.stderr, flush=True)
        last = line.strip() or last
    return last.removeprefix("no library of kernels: ") if process.wait() else ""


def why_unusable(source: Path) -> str:
    """Why the library in a folder is none of these sources; empty where it is."""
    try:
        made = json.loads((source / MANIFEST).read_bytes())
        for file, digest in made["files"].items():
            if hashlib.sha256((PACKAGE / file).read_bytes()).hexdigest() != digest:
                return f"{file} is another than the library in {source} was made from"
        for each in made["libraries"].values():
            if not (source / each["file"]).is_file():
                return f"{source} lacks {each['file']}"
    except (OSError, ValueError, KeyError) as error:
        return f"{source} holds no library of kernels ({error})"
    return ""


def copy_library(source: Path, folder: Path) -> str:
    """Take the one of a folder; why not, where it cannot be used."""
    if why := why_unusable(source):
        return why
    made = json.loads((source / MANIFEST).read_bytes())
    folder.mkdir(parents=True, exist_ok=True)
    for name in (MANIFEST, *(each["file"] for each in made["libraries"].values())):
        shutil.copyfile(source / name, folder / name)
    return ""


class Build(build_py):
    """Python files, then the library beside them."""

    def run(self) -> None:
        """As setuptools asks."""
        super().run()
        in_place = getattr(self, "editable_mode", False)
        folder = PACKAGE / "lib" if in_place else Path(self.build_lib) / "strapdown" / "lib"
        if not in_place:
            shutil.rmtree(folder, ignore_errors=True)  # that of a build before
        if WANTED:
            why = (
                build_library(folder, [] if in_place else ["--levels", "all"])
                if SAID == "1"
                else copy_library(Path(SAID), folder)
            )
            if why:
                print(f"strapdown: kernels will be compiled on use: {why}", file=sys.stderr)


class Wheel(bdist_wheel):
    """One for every Python on a platform, or for any where it has no library."""

    platform = ""

    def run(self) -> None:
        """As setuptools asks."""
        self.run_command("build")
        manifest = (
            Path(self.get_finalized_command("build_py").build_lib) / "strapdown/lib" / MANIFEST
        )
        if manifest.exists():
            self.platform = json.loads(manifest.read_bytes())["tag"]
        if self.platform not in ("", "any"):
            self.root_is_pure = False
            self.distribution.has_ext_modules = lambda: True  # installed where machine code belongs
        super().run()

    def get_tag(self) -> tuple[str, str, str]:
        """Python, ABI and platform."""
        return ("py3", "none", self.platform) if self.platform else super().get_tag()


setup(
    cmdclass={"build_py": Build, "bdist_wheel": Wheel},
    install_requires=dependencies(),
    setup_requires=dependencies() if SAID == "1" else [],  # the package compiles its kernels itself
    long_description=readme(),
    long_description_content_type="text/markdown",
)
