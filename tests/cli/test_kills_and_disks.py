"""Commands that are killed, and whose disk is full or read-only: whole sets of files or none, one
line, nothing stray.

The disks are real: a small file system in memory, mounted in a name space of its own.
"""

import os
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from hop import SCENARIO
from killed import killed
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.cli import app
from strapdown.core.compile.jit import COMPILED
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.fileio.locks import PART

pytestmark = [
    pytest.mark.deep,
    pytest.mark.skipif(not COMPILED, reason="a process without the compiler is too slow"),
]
FUSE = ("fuse", "hop.nc", "--heading", "30")
COMMANDS = {
    "fuse": (*FUSE, "--also", "gpx,csv.xz"),
    "study": ("study", "hop.toml", "--runs", "4"),
    "compare": ("compare", "hop.nc", "--filters", "closed-loop,open-loop", "--outages", "12:15"),
    "demo": ("demo",),
    "calibrate": ("calibrate", "tumble.nc"),
}
PAGE = 4096
"""Of a file system in memory: bytes of which it gives whole ones."""


def tumble():
    """A magnetometer that is turned through all directions."""
    t = np.arange(1, 1201) / 20.0
    rates = np.stack([np.sin(0.3 * t + k) * (0.5 + 0.2 * k) for k in range(3)], axis=1)
    C = [Rotation.identity()]
    for turn in Rotation.from_rotvec(rates / 20):
        C.append(C[-1] * turn)
    body = Rotation.concatenate(C[1:]).inv()
    noise = np.random.default_rng(3).normal(0, 1e-7, (len(t), 3))
    y = body.apply([20e-6, 1e-6, 44e-6]) + [3e-5, -2e-5, 4e-5] + noise
    field = Source("magnetic-field", t, y, np.full(y.shape, 3e-7), (20e-6, 1e-6, 44e-6), name="m")
    imu = Imu(t, np.full(len(t), 0.05), rates / 20, body.apply([0, 0, -9.81]) / 20)
    return Recording(imu, (field,), None, {"name": "tumble"})


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with what the commands read."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "hop.toml").write_text(SCENARIO)
    sd.write_recording(sd.simulate(folder / "hop.toml", seed=4), folder / "hop.nc")
    sd.write_recording(tumble(), folder / "tumble.nc")
    return folder


def out_of(name, folder):
    """The words by which a command writes into a folder."""
    return ("--out", str(folder / "report.html" if name == "demo" else folder))


OF_STUDY = {"manifest.json", "lock", "summary.csv", "runs.csv"}

ON_A_DISK = """
mount -t tmpfs -o size={room} tmpfs {disk} && echo old > {disk}/report.html
mount -o remount,{mode} {disk} && "$@"
echo "exit $?"; find {disk} -mindepth 1 -type f -printf '%P %b\n'
"""


def on_a_disk(name, files, disk, room=2**26, mode="rw"):
    """(exit code, lines of standard error, {path of a file that is left: its bytes on the disk}) of
    a command whose folder for results is a disk of its own with that many bytes, of which one old
    file takes a PAGE."""
    script = ON_A_DISK.format(room=room, disk=disk, mode=mode)
    words = (sys.executable, "-m", "strapdown", *COMMANDS[name], *out_of(name, disk))
    space = ("unshare", "--user", "--map-root-user", "--mount")
    done = subprocess.run(
        [*space, "sh", "-c", script, "sh", *words], cwd=files, capture_output=True, text=True
    )
    *_, code, left = done.stdout.partition("exit ")
    code, *left = left.split()
    shown = [line for line in done.stderr.splitlines() if not line.startswith("compiling")]
    return int(code), shown, {at: 512 * int(size) for at, size in zip(left[::2], left[1::2])}


@pytest.fixture
def disk(tmp_path):
    """A folder for a disk; the test is skipped where none can be mounted."""
    probe = ["unshare", "--user", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs"]
    if (
        not shutil.which("unshare")
        or subprocess.run([*probe, tmp_path], capture_output=True).returncode
    ):
        pytest.skip("this system mounts no disks for users")
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_is_one_line_and_keeps_what_was_there(name, files, disk):
    """Disks for half of what the command writes where it has room, and for all but two pages of
    it."""
    code, shown, written = on_a_disk(name, files, disk)
    assert (code, shown) == (0, [])
    for room in (sum(written.values()) // 2, sum(written.values()) - PAGE):
        code, shown, left = on_a_disk(name, files, disk, room)
        assert code == 2 and len(shown) == 1 and shown[0].startswith(f"strapdown: {disk}/"), shown
        assert "cannot be written (No space left on device); choose another folder" in shown[0]
        # a study's finished chunks and whole tables are kept, and what says of which study they are;
        # the same command adds what is missing
        mine = {at for at in left if at in OF_STUDY or at.startswith("chunks/")}
        assert {*left} - mine == {"report.html"} and left["report.html"] == PAGE


@pytest.mark.parametrize("name", COMMANDS)
def test_a_read_only_disk_is_one_line(name, files, disk):
    code, shown, left = on_a_disk(name, files, disk, mode="ro")
    assert code == 2 and {*left} == {"report.html"}
    assert shown == [
        f"strapdown: --out {disk}: nothing can be written there (Read-only file system); "
        f"choose another folder"
    ]


def content(folder):
    """{name: bytes} of the whole files in a folder, without the minute that a page says it is of."""
    files = [path for path in folder.iterdir() if not path.name.endswith(PART)]
    minute = rb"\d{4}-\d\d-\d\d \d\d:\d\d UTC"
    return {path.name: re.sub(minute, b"", path.read_bytes()) for path in files}


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_fuse_killed_thirty_times_leaves_whole_sets(files, tmp_path, monkeypatch, command):
    """Half of the kills fall anywhere in a run, half while files are written."""
    monkeypatch.chdir(files)
    sets = {}
    for name, seconds in (("old", 25), ("new", 30), ("new", 30)):  # the last with all loaded
        begin = time.perf_counter()
        folder = tmp_path / name
        code, _, _ = command(*FUSE, "--to", seconds, "--out", folder)
        assert code == 0
        sets[name], whole = content(folder), time.perf_counter() - begin
    out, words = tmp_path / "out", ("strapdown", *FUSE, "--to", "30", "--out")

    def work():
        sys.argv = [*words, str(out)]
        app.main()

    def parts():
        return set(out.glob(f".*{PART}"))

    ends, strays, mixed = [], 0, 0
    for longest, while_writing in ((2 * whole, False), (whole / 5, True)):
        for _ in range(15):
            shutil.copytree(tmp_path / "old", out, dirs_exist_ok=True)
            before = parts()
            begun = (lambda before=before: parts() - before) if while_writing else None
            list(killed(work, 1, longest, len(ends), begun))
            found = content(out)
            ends.append(found == sets["new"])
            strays += bool(parts() - before)
            for name, held in found.items():
                assert held in (sets["old"][name], sets["new"][name]), f"{name} is not whole"
            mixed += found not in sets.values()
    # a kill between two renames would leave files of both sets; that takes some microseconds
    assert not mixed, f"{mixed} kills left files of both sets"
    assert strays and {True, False} == set(ends), "the kills missed the writing"
    code, _, _ = command(*FUSE, "--to", 30, "--out", out)
    assert code == 0 and content(out) == sets["new"] and not parts()
    assert len(os.listdir(out)) == len(sets["new"])
