"""Run the deep tests and write what came out to deep.txt beside this file: date, command, versions, result, the slowest tests."""

import os
import platform
import re
import subprocess
import sys
import time
from datetime import date
from pathlib import Path

import numba
import numpy

HERE = Path(__file__).resolve().parent


def main() -> int:
    """The deep tests compiled, then all short tests without the compiler."""
    lines, failed = [f"make deep, {date.today().isoformat()}"], 0
    lines += [
        f"Python {platform.python_version()}, numba {numba.__version__}, numpy {numpy.__version__}, {os.cpu_count()} cores"
    ]
    for marks, off in (("deep", ""), ("short", "1")):
        begin = time.perf_counter()
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-n",
            "2",
            "--dist",
            "worksteal",
            "-m",
            marks,
            "--durations=10",
        ]
        environment = os.environ | ({"NUMBA_DISABLE_JIT": off} if off else {})
        done = subprocess.run(
            command, cwd=HERE.parent, env=environment, capture_output=True, text=True
        )
        print(done.stdout)
        failed |= done.returncode
        kept = [
            line
            for line in done.stdout.splitlines()
            if re.search(r"^(FAILED|ERROR)|\d+ (passed|failed)|s (call|setup)", line)
        ]
        lines += [
            "",
            f"pytest -m '{marks}'{' without the compiler' * bool(off)}: {time.perf_counter() - begin:.0f} s",
            *kept,
        ]
    (HERE / "deep.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return failed


if __name__ == "__main__":
    sys.exit(main())
