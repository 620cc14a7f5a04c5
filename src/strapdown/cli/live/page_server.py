"""The live page: HTTP on 127.0.0.1 that answers GET of the page and of its events, and nothing else.

Any page in a browser may send requests to 127.0.0.1, and a name of its own may lead there. So a request is
answered only where its Host, and its Origin where it has one, are those of the page.
"""

import json
import socket
import sys
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

from ...checks import DataError, check_number
from ...pages.shell import POLICY
from .dashboard import Dashboard

HOST = "127.0.0.1"
NAMES = ("127.0.0.1", "localhost", "[::1]")
"""Names of this machine by which a browser may ask."""
MAX_VIEWERS = 8
MAX_CONNECTIONS = 32
"""Connections at a time, those of viewers included; further ones are closed."""
TIMEOUT = 10.0
"""s for which a request may take to arrive, and a viewer may not read."""
QUIET = 1.0
"""s without a look after which a viewer gets a comment, which shows whether it is still there."""
SEND_BUFFER = 1 << 16
"""Bytes to a viewer that the system keeps."""
RETRY = "retry: 1000\n\n"
"""ms after which a browser connects again."""
HEADERS = {
    "Content-Security-Policy": f"{POLICY}; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class PageServer:
    """A page about the numbers of a dashboard, in threads of its own.

    Raises DataError where another program has the port.
    """

    def __init__(self, dashboard: Dashboard, port: int) -> None:
        port = int(check_number(port, "page", "", least=0, most=65535, whole=True))
        try:
            self._server = _Server(dashboard, port)
        except OSError as error:
            why = error.strerror or error
            raise DataError(f"page: port {port} of {HOST}: {why}; name another one") from None
        self.url = f"http://{HOST}:{self._server.server_port}/"
        serve = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)
        serve.start()

    def close(self) -> None:
        """Answer no more."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    # elsewhere it only lets a restart have the port at once
    allow_reuse_address = sys.platform != "win32"

    def __init__(self, dashboard: Dashboard, port: int) -> None:
        self.dashboard, self.page = dashboard, page_html().encode()
        self._connections = threading.BoundedSemaphore(MAX_CONNECTIONS)
        self.viewers = threading.BoundedSemaphore(MAX_VIEWERS)
        super().__init__((HOST, port), _Handler)
        ends = ("", f":{port}") if port == 80 else (f":{self.server_port}",)
        self.hosts = {name + end for name in NAMES for end in ends}

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread, or close the connection where there are too many."""
        if self._connections.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, in the thread."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that has gone."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = TIMEOUT
    server_version, sys_version = "strapdown", ""

    def __getattr__(self, name: str) -> Callable[[], None]:
        if not name.startswith("do_"):
            raise AttributeError(name)
        return lambda: self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, "only GET is answered")

    def do_GET(self) -> None:
        """Send the page, or the events as they come."""
        if not self._is_own():
            host = f"127.0.0.1:{self.server.server_port}"
            self._refuse(HTTPStatus.FORBIDDEN, f"only pages of http://{host} are answered")
        elif self.path == "/":
            self._head(HTTPStatus.OK, "text/html; charset=utf-8", len(self.server.page))
            self.wfile.write(self.server.page)
        elif self.path != "/events":
            self._refuse(HTTPStatus.NOT_FOUND, "there are / and /events")
        elif not self.server.viewers.acquire(blocking=False):
            text = f"{MAX_VIEWERS} viewers are connected already"
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, text)
        else:
            try:
                with self.server.dashboard.count_viewer():
                    self._send_events()
            finally:
                self.server.viewers.release()

    def _is_own(self) -> bool:
        """Return True for requests of the page itself, or of somebody who types its address."""
        hosts, origins = (self.headers.get_all(name, []) for name in ("Host", "Origin"))
        own = len(hosts) == 1 and hosts[0].lower() in self.server.hosts
        own = own and all(each.lower() == f"http://{hosts[0].lower()}" for each in origins)
        # events are for the page alone; a link to the page may be anywhere
        site = self.headers.get("Sec-Fetch-Site", "none")
        return own and (self.path == "/" or site in ("none", "same-origin"))

    def _send_events(self) -> None:
        """Send the newest numbers whenever there are new ones. A viewer that is slow gets the next
        ones when it has read these."""
        # what a slow viewer has not read is old, so little of it waits
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8", None)
        self.wfile.write(RETRY.encode())
        dashboard, look = self.server.dashboard, 0
        while not dashboard.closed:
            if dashboard.wait(look, QUIET):
                look, shown = dashboard.since(look)
                text = json.dumps(shown, allow_nan=False, separators=(",", ":"))
                self.wfile.write(f"data: {text}\n\n".encode())
            else:
                self.wfile.write(b":\n\n")

    def _head(self, status: HTTPStatus, kind: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.end_headers()

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        body = f"{text}\n".encode()
        self.send_response(status)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", "GET")
        self.send_header("Content-Type", "text/plain; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *given: object) -> None:
        """Say nothing."""


def page_html() -> str:
    """Return the page, which needs nothing but its events: style and script stand in it."""
    texts = {
        "STYLE": _text("strapdown.pages", "page.css") + _text(__package__, "live_page.css"),
        "SCRIPT": _text(__package__, "live_page.js"),
    }
    html = _text(__package__, "live_page.html")
    for mark, text in texts.items():
        html = html.replace(f"{{{mark}}}", text)
    return html


def _text(package: str, name: str) -> str:
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")
