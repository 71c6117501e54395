"""Server of the workbench's page: one machine, one user, nothing from or to a network.

It listens on 127.0.0.1 alone. The address that is printed holds a random token, which counts once:
the request with it gets a strict cookie and is sent on to an address without it, and the next
browser needs a new token. Every request must name this server as its host, a request that changes
something also as its origin. No path of a request is looked up on the disk: the files of the page
are a fixed table.

The standard library serves it. Curves go as bytes over one kept connection, and events tell other
windows of a new state; this needs no package, no build step and no policy beyond ``'self'``.
"""

import json
import re
import secrets
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from pydantic import ValidationError

from identification.words import WorkbenchError
from mbw.page.html import read_asset
from mbw.workbench.desk import Desk, StaleRevisionError
from mbw.workbench.jobs import JobQueue
from mbw.workbench.requests import (
    ActRequest,
    JobRequest,
    PreviewRequest,
    describe_wrong_request,
)
from mbw.workbench.session_data import scene_data, session_data
from mbw.workbench.state import History

HOST = "127.0.0.1"
_ASSETS = {
    "/": ("workbench/index.html", "text/html"),
    "/colours.css": ("page/colours.css", "text/css"),
    "/workbench.css": ("workbench/style.css", "text/css"),
    "/icon.svg": ("workbench/icon.svg", "image/svg+xml"),
    **{
        f"/{name}.js": (f"workbench/{name}.js", "text/javascript")
        for name in ("main", "curves", "scene", "sliders", "edits", "jobs", "exchange")
    },
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_MAX_REQUEST_BYTES = 2**18  # values of some thousand parameters
_PING_S = 10.0  # between signs of life of a connection for events
_IDLE_S = 120.0  # after which a connection without a request is closed


@dataclass(frozen=True, eq=False)
class Workbench:
    """State, frames and tasks that the server offers to the page.

    Args:
        desk: state and frames.
        jobs: verbs of the command line that run on what the page shows.
        tasks: what the page's buttons ask for, by name: each returns sentences.
        announce: told each new address; the first one is not announced.
        cookie: secret of the browsers that came with a token.
    """

    desk: Desk
    jobs: JobQueue
    tasks: dict[str, Callable[[], list[str]]]
    announce: Callable[[str], None] = field(default=lambda address: None)
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(24))


_DATA: dict[str, Callable[[Workbench], dict[str, Any]]] = {
    "/session": lambda shown: session_data(shown.desk.subject, shown.desk.plant),
    "/scene": lambda shown: scene_data(shown.desk.subject, shown.desk.plant.subject),
    "/study": lambda shown: shown.desk.study(),
    "/jobs": lambda shown: {"jobs": shown.jobs.list_jobs()},
}


class PageServer(ThreadingHTTPServer):
    """HTTP server of one workbench.

    Args:
        workbench: what it serves.
        port: port on 127.0.0.1; 0 for a free one.

    Raises:
        OSError: the port is in use.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, workbench: Workbench, port: int = 0) -> None:
        self.workbench, self._token = workbench, secrets.token_urlsafe(24)
        super().__init__((HOST, port), _Handler)

    def handle_error(self, request: object, client_address: object) -> None:
        """Report a failure of the server, but no browser that left before its answer."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]

    @property
    def host(self) -> str:
        """Host and port, as requests have to name them."""
        return f"{HOST}:{self.server_address[1]}"

    @property
    def address(self) -> str:
        """Address with the token, for the first request of a browser."""
        return f"http://{self.host}/?token={self._token}"

    def use_token(self, token: str) -> bool:
        """Return whether a token is the present one; if so, make and announce the next."""
        if not _equal(token, self._token):
            return False
        self._token = secrets.token_urlsafe(24)
        self.workbench.announce(self.address)
        return True

    @property
    def cookie_name(self) -> str:
        """Name of the cookie, which browsers do not keep apart by port."""
        return f"mbw-{self.server_address[1]}"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "mbw", ""
    disable_nagle_algorithm = True
    wbufsize = -1  # header and body in one packet
    timeout = _IDLE_S
    server: PageServer

    def do_GET(self) -> None:  # name of the library
        """Answer with a file of the page, data, or events."""
        if not self._is_for_us():
            return
        try:
            address = urlsplit(self.path)
        except ValueError:
            self._refuse(400, "the address cannot be read: open the workbench's first page")
            return
        token = parse_qs(address.query).get("token", [""])[0]
        if address.path == "/" and token and self.server.use_token(token):
            self._admit()
            return
        if not self._is_admitted():
            return
        desk = self.server.workbench.desk
        if address.path in _ASSETS:
            name, kind = _ASSETS[address.path]
            self._send(200, read_asset(name).encode(), f"{kind}; charset=utf-8")
        elif address.path in _DATA:
            self._send_data(lambda: _DATA[address.path](self.server.workbench))
        elif address.path == "/frame":
            self._send_frame(*desk.frame())
        elif number := re.fullmatch(r"/result/(\d{1,6})", address.path):
            self._send_result(int(number[1]))
        elif address.path == "/events":
            self._send_events(desk)
        else:
            self._refuse(404, "the workbench has no such address: open its first page")

    def do_POST(self) -> None:
        """Do an action, show a preview of one, or run a task."""
        content = self._content()
        if content is None or not self._is_for_us(changes=True) or not self._is_admitted():
            return
        workbench, task = self.server.workbench, self.path.removeprefix("/")
        try:
            if task == "act":
                asked = ActRequest.model_validate_json(content)
                self._send_frame(*workbench.desk.act(asked.revision, asked.action))
            elif task == "preview":
                wanted = PreviewRequest.model_validate_json(content)
                frame = workbench.desk.preview(wanted.values, wanted.edit)
                self._send(200, frame, "application/octet-stream")
            elif task == "jobs":
                request = JobRequest.model_validate_json(content)
                sentences = request.run(workbench.jobs, workbench.desk)
                self._send_json(200, {"sentences": sentences})
            elif task in workbench.tasks:
                self._send_json(200, {"sentences": workbench.tasks[task]()})
            else:
                self._refuse(404, "the workbench has no such task: open its first page")
        except ValidationError as error:
            self._refuse(*describe_wrong_request(error))
        except StaleRevisionError as error:
            self._refuse(409, str(error))
        except WorkbenchError as error:
            self._refuse(422, str(error))
        except OSError as error:
            self._refuse(507, f"the disk takes nothing more ({error.strerror}): make room for it")

    def _content(self) -> bytes | None:
        """Return the body of a request; refuse one that is too long or has no length."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or len(length) > 9 or int(length) > _MAX_REQUEST_BYTES:
            self.close_connection = True
            self._refuse(413, "the request is too long or has no length")
            return None
        return self.rfile.read(int(length))

    def _is_for_us(self, *, changes: bool = False) -> bool:
        """Return whether a request names this server, so that no other page sent it; else refuse.

        Another name that leads to this computer (DNS rebinding) is another host.
        """
        host, origin = self.headers.get_all("Host", []), self.headers.get("Origin")
        site = self.headers.get("Sec-Fetch-Site", "none")
        is_same_origin = origin == f"http://{self.server.host}"
        if (
            host == [self.server.host]
            and (is_same_origin or (origin is None and not changes))
            and site in ("none", "same-origin")
        ):
            return True
        self._refuse(403, "this request does not come from the workbench's page")
        return False

    def _is_admitted(self) -> bool:
        """Return whether a request has the cookie; refuse it otherwise."""
        try:
            cookie = SimpleCookie(self.headers.get("Cookie", "")).get(self.server.cookie_name)
        except CookieError:
            cookie = None
        if cookie is not None and _equal(cookie.value, self.server.workbench.cookie):
            return True
        self._refuse(403, "open the address that mbw open printed: it holds the key to this page")
        return False

    def _admit(self) -> None:
        """Give the cookie for the token, and send the browser on to an address without it."""
        cookie = f"{self.server.cookie_name}={self.server.workbench.cookie}"
        further = {
            "Location": "/",
            "Set-Cookie": f"{cookie}; HttpOnly; SameSite=Strict; Path=/",
        }
        self._send(303, b"", "text/plain", further)

    def _send_frame(self, history: History, frame: bytes) -> None:
        """Send a frame with its revision and whether there is something to undo and redo."""
        further = {
            "Revision": str(history.revision),
            "Undo-Steps": str(len(history.past)),
            "Redo-Steps": str(len(history.future)),
        }
        self._send(200, frame, "application/octet-stream", further)

    def _send_json(self, status: int, content: dict[str, Any]) -> None:
        self._send(status, json.dumps(content, allow_nan=False).encode(), "application/json")

    def _send_result(self, number: int) -> None:
        """Send the page of a job's result, whose scripts get no access to this server.

        It has a policy of its own, which allows its scripts by their hashes.
        """
        page = self.server.workbench.jobs.page(number)
        if page is None:
            self._refuse(404, "this job has no page")
            return
        alone = {
            "Content-Security-Policy": "sandbox allow-scripts; frame-ancestors 'none'",
            "Cross-Origin-Opener-Policy": "unsafe-none",
        }
        self._send(200, page.read_bytes(), "text/html; charset=utf-8", alone)

    def _send_data(self, compute: Callable[[], dict[str, Any]]) -> None:
        """Send what a function returns, or the sentence with which it fails."""
        try:
            content = compute()
        except WorkbenchError as error:
            self._refuse(422, str(error))
        else:
            self._send_json(200, content)

    def _refuse(self, status: int, sentence: str) -> None:
        """Refuse a request with a sentence."""
        self._send_json(status, {"error": sentence})

    def _send(
        self, status: int, body: bytes, kind: str, further: dict[str, str] | None = None
    ) -> None:
        self.send_response(status)
        head = {**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}
        for name, value in {**head, **(further or {})}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def _send_events(self, desk: Desk) -> None:
        """Tell a browser each new revision, and how many results jobs have brought."""
        self.close_connection = True
        self.send_response(200)
        for name, value in {**_HEADERS, "Content-Type": "text/event-stream"}.items():
            self.send_header(name, value)
        self.end_headers()
        versions = -1, -1
        try:
            while True:
                newest = desk.wait(versions, _PING_S)
                text = "data: {} {}\n\n".format(*newest) if newest != versions else ": \n\n"
                self.wfile.write(text.encode())
                self.wfile.flush()
                versions = newest
        except OSError:  # the browser left
            return

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  # of the library
        """Print nothing: addresses hold the token."""


def _equal(first: str, second: str) -> bool:
    """Compare secrets in a time that does not depend on where they differ."""
    return secrets.compare_digest(first.encode(), second.encode())
