"""Server of a live page: one machine, one user, nothing from or to a network.

It listens on 127.0.0.1 alone. The address that is printed holds a random token, which counts once:
the request with it gets a strict cookie and is sent on to an address without it, and the next
browser needs a new token. Every request must name this server as its host, a request that changes
something also as its origin. No path of a request is looked up on the disk: the files of the page
are a fixed table.

The standard library serves it. Curves go as bytes over one kept connection, and events tell all
windows of a new state; this needs no package, no build step and no policy beyond ``'self'``.
"""

import json
import secrets
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

from pydantic import ValidationError

from identification.words import InputError, WorkbenchError
from mbw.page.html import read_asset
from mbw.workbench.desk import StaleRevisionError
from mbw.workbench.requests import describe_wrong_request

HOST = "127.0.0.1"
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


@dataclass(frozen=True)
class PageAnswer:
    """Answer to a request.

    Args:
        body: its bytes.
        kind: media type.
        header: fields beside those of all answers.
    """

    body: bytes
    kind: str = "application/octet-stream"
    header: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "PageAnswer":
        """Return content as JSON."""
        return cls(json.dumps(content, allow_nan=False).encode(), "application/json")


class ServedPage(Protocol):
    """Differences between live pages; a WorkbenchError of its methods is told to the user."""

    @property
    def announce(self) -> Callable[[str], None]:
        """Told each new address; the first one is not announced."""

    @property
    def assets(self) -> Mapping[str, tuple[str, str]]:
        """Files of the page: name and media type by path."""

    def read(self, path: str, query: Mapping[str, str]) -> PageAnswer | None:
        """Return data; None if there is no such address."""

    def perform(self, task: str, content: bytes) -> PageAnswer | None:
        """Perform a task with the body of its request; None if there is no such task."""

    def wait(self, versions: tuple[int, ...], timeout_s: float) -> tuple[int, ...]:
        """Wait until the versions of what is shown differ; return them, also after the timeout."""


class PageServer(ThreadingHTTPServer):
    """HTTP server of one page.

    Args:
        page: what it serves.
        port: port on 127.0.0.1; 0 for a free one.

    Raises:
        OSError: the port is in use.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, page: ServedPage, port: int = 0) -> None:
        self.page, self._token = page, secrets.token_urlsafe(24)
        self.cookie = secrets.token_urlsafe(24)  # of the browsers that came with a token
        self._context = copy_context()  # how models are read
        super().__init__((HOST, port), _Handler)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer a request in the context of the call that made the server."""
        self._context.copy().run(super().process_request_thread, request, client_address)

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
        self.page.announce(self.address)
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
            self._refuse(400, "the address cannot be read: open the first page")
            return
        token = parse_qs(address.query).get("token", [""])[0]
        if address.path == "/" and token and self.server.use_token(token):
            self._admit()
            return
        if not self._is_admitted():
            return
        page = self.server.page
        if address.path == "/events":
            self._send_events()
        elif address.path in page.assets:
            name, kind = page.assets[address.path]
            self._send(200, PageAnswer(read_asset(name).encode(), f"{kind}; charset=utf-8"))
        else:
            query = {name: values[0] for name, values in parse_qs(address.query).items()}
            self._answer(lambda: page.read(address.path, query), "address")

    def do_POST(self) -> None:
        """Perform a task of the page."""
        content = self._content()
        if content is None or not self._is_for_us(changes=True) or not self._is_admitted():
            return
        task = self.path.removeprefix("/")
        self._answer(lambda: self.server.page.perform(task, content), "task")

    def _answer(self, compute: Callable[[], PageAnswer | None], what: str) -> None:
        """Send what a function returns, or the sentence with which it fails."""
        try:
            answer = compute()
        except ValidationError as error:
            self._refuse(*describe_wrong_request(error))
        except StaleRevisionError as error:
            self._refuse(409, str(error))
        except WorkbenchError as error:
            self._refuse(422, str(error))
        except OSError as error:
            self._refuse(507, f"the disk takes nothing more ({error.strerror}): make room for it")
        else:
            if answer is None:
                self._refuse(404, f"there is no such {what}: open the first page")
            else:
                self._send(200, answer)

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
        self._refuse(403, "this request does not come from this server's page")
        return False

    def _is_admitted(self) -> bool:
        """Return whether a request has the cookie; refuse it otherwise."""
        try:
            cookie = SimpleCookie(self.headers.get("Cookie", "")).get(self.server.cookie_name)
        except CookieError:
            cookie = None
        if cookie is not None and _equal(cookie.value, self.server.cookie):
            return True
        self._refuse(403, "open the address that the command printed: it holds the page's key")
        return False

    def _admit(self) -> None:
        """Give the cookie for the token, and send the browser on to an address without it."""
        cookie = f"{self.server.cookie_name}={self.server.cookie}"
        header = {
            "Location": "/",
            "Set-Cookie": f"{cookie}; HttpOnly; SameSite=Strict; Path=/",
        }
        self._send(303, PageAnswer(b"", "text/plain", header))

    def _refuse(self, status: int, sentence: str) -> None:
        """Refuse a request with a sentence."""
        self._send(status, PageAnswer.of({"error": sentence}))

    def _send(self, status: int, answer: PageAnswer) -> None:
        self.send_response(status)
        head = {"Content-Type": answer.kind, "Content-Length": str(len(answer.body))}
        for name, value in {**_HEADERS, **head, **answer.header}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(answer.body)

    def _send_events(self) -> None:
        """Tell a browser each new version of what the page shows."""
        self.close_connection = True
        self.send_response(200)
        for name, value in {**_HEADERS, "Content-Type": "text/event-stream"}.items():
            self.send_header(name, value)
        self.end_headers()
        versions: tuple[int, ...] = ()
        try:
            while True:
                newest = self.server.page.wait(versions, _PING_S)
                line = f"data: {' '.join(map(str, newest))}" if newest != versions else ": "
                self.wfile.write(f"{line}\n\n".encode())
                self.wfile.flush()
                versions = newest
        except OSError:  # the browser left
            return

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002  # of the library
        """Print nothing: addresses hold the token."""


def _equal(first: str, second: str) -> bool:
    """Compare secrets in a time that does not depend on where they differ."""
    return secrets.compare_digest(first.encode(), second.encode())


def start_server(page: ServedPage, port: int = 0) -> PageServer:
    """Return the server of a page, bound to its port.

    Raises:
        InputError: the port cannot be used.
    """
    try:
        return PageServer(page, port)
    except OSError as error:
        raise InputError(
            f"port {port} on {HOST} cannot be used ({error.strerror}): name another with --port, "
            "or leave the option out"
        ) from error


def list_assets(index: str, *names: str) -> dict[str, tuple[str, str]]:
    """Return the files of a page: its HTML, its scripts and styles, and what all pages share."""
    kinds = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
    shared = ("page/colours.css", "workbench/style.css", "workbench/icon.svg")
    files = {
        f"/{Path(name).name}": (name, kinds[name.rpartition(".")[2]]) for name in (*shared, *names)
    }
    return {"/": (index, "text/html"), **files}


@contextmanager
def serve_beside(page: ServedPage) -> Iterator[PageServer]:
    """Serve a page from a thread, beside what the caller does."""
    with start_server(page) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
