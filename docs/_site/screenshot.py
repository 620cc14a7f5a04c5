"""Pictures of pages, by a Chromium where one is there."""

import shutil
import subprocess
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")


def browser() -> str | None:
    """The path of a Chromium, None where there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


def take_picture(page: Path, picture: Path, size: tuple[int, int], scale: float = 1.0) -> None:
    """Write what a window of that size, px, shows of a page as PNG; nothing without a browser."""
    found = browser()
    if found is None:
        return
    run = [found, "--headless", "--no-sandbox", "--use-gl=swiftshader", "--hide-scrollbars"]
    run += ["--enable-unsafe-swiftshader", "--virtual-time-budget=10000"]
    run += [f"--window-size={size[0]},{size[1]}", f"--force-device-scale-factor={scale}"]
    subprocess.run([*run, f"--screenshot={picture}", page.as_uri()], capture_output=True)
