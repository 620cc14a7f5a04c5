"""What a wheel says of itself; and wheels with and without a library, which pip makes."""

import json
import os
import subprocess
import sys
import zipfile

import pytest

from strapdown.core.compile import library
from strapdown.native import wheel


def test_file_size_tag_and_levels_are_told(tmp_path):
    made = tmp_path / "strapdown-0.2.0-py3-none-manylinux_2_17_x86_64.whl"
    with zipfile.ZipFile(made, "w") as file:
        file.writestr("strapdown/lib/kernels.json", json.dumps({"libraries": {"x86-64-v2": {}}}))
        file.writestr("strapdown/lib/kernels-x86-64-v2.bin", bytes(1_500_000))
    said = wheel.describe_wheel(made)
    assert said == f"{made}, 1.5 MB, py3-none-manylinux_2_17_x86_64: kernels for x86-64-v2"
    plain = tmp_path / "strapdown-0.2.0-py3-none-any.whl"
    zipfile.ZipFile(plain, "w").close()
    assert "0.0 MB, py3-none-any: without kernels, which numba compiles" in wheel.describe_wheel(
        plain
    )


def requirements(made):
    """The lines of a wheel's metadata on what it needs."""
    with zipfile.ZipFile(made) as file:
        name = next(name for name in file.namelist() if name.endswith("METADATA"))
        lines = file.read(name).decode().splitlines()
    return "\n".join(line for line in lines if line.startswith("Requires-Dist"))


@pytest.mark.deep
def test_pip_makes_a_wheel_with_the_library_of_a_folder_and_without_a_stale_one(tmp_path):
    """Built anew is tested by hand: that would install numba for the build."""

    def built(name, said):
        done = subprocess.run(
            [sys.executable, "-m", "pip", "wheel", "-v", "--no-deps", "-w", tmp_path / name, "."],
            env={**os.environ, library.SETTING: str(said)},
            cwd=wheel.CHECKOUT,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        (made,) = (tmp_path / name).glob("*.whl")
        return made, done.stdout + done.stderr

    folder = tmp_path / "lib"
    folder.mkdir()
    (folder / "one.bin").write_bytes(b"machine code")
    manifest = {
        "tag": "manylinux_2_17_x86_64",
        "libraries": {"x86-64-v2": {"file": "one.bin"}},
        "files": {"checks.py": "0"},
    }
    (folder / "kernels.json").write_text(json.dumps(manifest), encoding="utf-8")
    stale, said = built("stale", folder)
    assert stale.name.endswith("-py3-none-any.whl")
    assert "checks.py is another than the library" in said
    assert "Requires-Dist: numba" in requirements(stale)
    (folder / "kernels.json").write_text(json.dumps({**manifest, "files": {}}), encoding="utf-8")
    with_library, _ = built("with", folder)
    told = requirements(with_library)
    assert "Requires-Dist: numpy" in told and 'numba>=0.61; extra == "compile"' in told
    assert "numba" not in told.replace('numba>=0.61; extra == "compile"', "")
    assert with_library.name.endswith("-py3-none-manylinux_2_17_x86_64.whl")
    with zipfile.ZipFile(with_library) as file:
        assert file.read("strapdown/lib/one.bin") == b"machine code"
    plain, _ = built("plain", "")
    assert plain.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(plain) as file:
        assert not [name for name in file.namelist() if name.startswith("strapdown/lib/")]
