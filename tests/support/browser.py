"""Chromium without a window, for tests that look at a page as a person would; None where there is none."""

import base64
import fcntl
import json
import os
import shutil
import subprocess
import time

import pytest

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
NO_CHROMIUM = "Chromium not found (chromium, chromium-browser or google-chrome)"
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)

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
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
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


class Driven:
    """A page in Chromium, a file or an address of this machine, that a test drives through DevTools, in
    real time: `with Driven(path, folder) as page: page.run("2 + 2")`."""

    def __init__(self, path, folder, width=1300, height=900):
        down, up = os.pipe(), os.pipe()  # DevTools reads from file descriptor 3, writes to 4

        def connect():
            ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (down[0], up[1])]
            os.dup2(ends[0], 3), os.dup2(ends[1], 4)

        flags = [flag for flag in FLAGS if "virtual-time" not in flag and "window-size" not in flag]
        self.process = subprocess.Popen(
            [
                CHROMIUM,
                *flags,
                f"--window-size={width},{height}",
                f"--user-data-dir={folder / 'driven'}",
                "--remote-debugging-pipe",
                "about:blank",
            ],
            preexec_fn=connect,
            pass_fds=(3, 4),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(down[0]), os.close(up[1])
        self.sending, self.receiving = os.fdopen(down[1], "wb"), os.fdopen(up[0], "rb")
        self.number, self.session = 0, None
        pages = self.call("Target.getTargets")["targetInfos"]
        (target,) = [each["targetId"] for each in pages if each["type"] == "page"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        self.call("Page.navigate", url=str(path) if "://" in str(path) else f"file://{path}")
        self.until("document.body && document.readyState === 'complete'")

    def call(self, method, **parameters):
        """What a method of DevTools returns."""
        self.number += 1
        asked = {"id": self.number, "method": method, "params": parameters}
        asked |= {"sessionId": self.session} if self.session else {}
        self.sending.write(json.dumps(asked).encode() + b"\0")
        self.sending.flush()
        while True:
            said = bytearray()
            while not said.endswith(b"\0"):
                byte = self.receiving.read(1)
                assert byte, "the browser is gone"
                said += byte
            answer = json.loads(said[:-1])
            if answer.get("id") == self.number:
                assert "error" not in answer, answer
                return answer["result"]

    def run(self, script):
        """The value of an expression in the page, awaited."""
        done = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def until(self, script, seconds=60):
        """Wait until an expression is true."""
        end = time.monotonic() + seconds
        while not self.run(f"Boolean({script})"):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.02)

    def picture(self, path, width, height):
        """Write what the window shows at this size, px, as PNG."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.run("new Promise(done => setTimeout(done, 300))")
        shown = self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shown["data"]))

    def drag(self, *places):
        """Press the mouse at the first of places (x, y), move it over the others, let it go."""
        for kind, (x, y) in [
            ("mouseMoved", places[0]),
            ("mousePressed", places[0]),
            *(("mouseMoved", place) for place in places[1:]),
            ("mouseReleased", places[-1]),
        ]:
            held = {} if kind == "mouseMoved" and (x, y) == places[0] else {"button": "left"}
            clicks = {} if kind == "mouseMoved" else {"clickCount": 1}
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held, **clicks)

    def point(self, x, y):
        """Move the mouse."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key):
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.sending.close()
        self.process.kill()
        self.process.wait()
        self.receiving.close()
