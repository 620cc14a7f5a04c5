"""Chromium without a window, for tests that look at a page as a person would; None where there is none."""

import shutil
import subprocess

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--virtual-time-budget=60000",
    "--window-size=1300,1700",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--enable-logging=stderr",
    "--log-level=0",
]
OF_THE_DRIVER = ("GL Driver Message", "fallback to software WebGL", "willReadFrequently")
"""What Chromium says of three dimensions without a graphics card."""


def browse(tmp_path, *options):
    done = subprocess.run(
        [
            CHROMIUM,
            *FLAGS,
            f"--user-data-dir={tmp_path / 'profile'}",
            *options,
            f"file://{tmp_path / 'a.html'}",
        ],
        capture_output=True,
        timeout=180,
        cwd=tmp_path,
    )
    said = [
        line
        for line in done.stderr.decode(errors="replace").splitlines()
        if ":CONSOLE" in line and not any(text in line for text in OF_THE_DRIVER)
    ]
    assert done.returncode == 0 and not said, said
    return done.stdout.decode(errors="replace")
