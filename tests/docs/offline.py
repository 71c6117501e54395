"""A built site, opened page by page in Chromium without network, and the requests that it makes."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from tests.helpers.browser import open_tab

# A page is complete, and has painted once more since.
LOADED = "document.readyState === 'complete' && (window.seen ? true : (window.seen = true, false))"


@dataclass(frozen=True)
class Visit:
    """What the browser asked for.

    Attributes:
        loaded: addresses that the site's own server gave.
        failed: addresses on the site that it does not have.
        foreign: addresses on other hosts.
    """

    loaded: Sequence[str]
    failed: Sequence[str]
    foreign: Sequence[str]


def visit(site: Path, pages: Sequence[str]) -> Visit:
    """Open pages of a site one after the other in one browser.

    Args:
        site: folder of the site.
        pages: addresses relative to it.
    """
    with _serving(site) as (address, answers), open_tab() as tab:
        for page in pages:
            tab.show(f"{address}/{page}")
            tab.wait(f"location.pathname.endsWith({page!r}) && {LOADED}")
        asked = {
            event["params"]["request"]["url"]
            for event in tab.events
            if event.get("method") == "Network.requestWillBeSent"
        }
    foreign = {url for url in asked if urlsplit(url).scheme in ("http", "https", "ws", "wss")}
    loaded = sorted({path for path, status in answers if status < 400})
    failed = sorted({path for path, status in answers if status >= 400})
    return Visit(loaded, failed, sorted(url for url in foreign if not url.startswith(address)))


@contextmanager
def _serving(site: Path) -> Iterator[tuple[str, list[tuple[str, int]]]]:
    """Serve a site on this machine; yield its address and the list of answers."""
    answers: list[tuple[str, int]] = []

    class Handler(SimpleHTTPRequestHandler):
        def log_request(self, code: object = "-", size: object = "-") -> None:
            answers.append((self.path, int(getattr(code, "value", code))))

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}", answers
        finally:
            server.shutdown()
