"""A built site, opened page by page in Chromium without network, and the requests that it makes."""

import json
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

from tests.helpers.browser import CHROMIUM

DRIVER = "offline-driver.html"
DRIVER_PAGE = """<!doctype html><title>driver</title><link rel="icon" href="data:,">
<iframe></iframe><pre id="state">open</pre>
<script>
const frame = document.querySelector("iframe");
async function visit(page) {
  await new Promise(done => {
    frame.onload = () => setTimeout(done, 200);
    frame.src = page;
  });
}
(async () => {
  for (const page of PAGES) await visit(page);
  document.getElementById("state").textContent = "all visited";
})();
</script>
"""
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
    "--virtual-time-budget=120000",
)


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


def visit(site: Path, pages: Sequence[str], folder: Path) -> Visit:
    """Open pages of a site one after the other in one browser.

    Args:
        site: folder of the site.
        pages: addresses relative to it.
        folder: for the browser's profile and log.
    """
    log = folder / "net.json"
    with _serving(site, pages) as (address, answers):
        done = subprocess.run(
            [
                str(CHROMIUM),
                *FLAGS,
                f"--user-data-dir={folder / 'profile'}",
                f"--log-net-log={log}",
                "--dump-dom",
                f"{address}/{DRIVER}",
            ],
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
        )
    if ">all visited<" not in done.stdout:
        raise RuntimeError(f"the browser did not open all pages: {done.stderr[-2000:]}")
    foreign = sorted({url for url in _requests(log, address) if not url.startswith(address)})
    loaded = sorted({path for path, status in answers if status < 400})
    failed = sorted({path for path, status in answers if status >= 400})
    return Visit(loaded, failed, foreign)


def _requests(log: Path, origin: str) -> Iterator[str]:
    """Yield the addresses on the web that pages of an origin asked for, answered or not."""
    content = json.loads(log.read_text(encoding="utf-8"))
    for event in content["events"]:
        parameters = event.get("params", {})
        url = parameters.get("url", "")
        # Requests of the browser itself have no web page as their initiator.
        is_of_page = parameters.get("initiator", "").startswith(origin)
        if is_of_page and urlsplit(url).scheme in ("http", "https", "ws", "wss"):
            yield url


@contextmanager
def _serving(site: Path, pages: Sequence[str]) -> Iterator[tuple[str, list[tuple[str, int]]]]:
    """Serve a site on this machine; yield its address and the list of answers."""
    answers: list[tuple[str, int]] = []

    class Handler(SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == f"/{DRIVER}":
                body = DRIVER_PAGE.replace("PAGES", json.dumps(list(pages))).encode()
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.end_headers()
                self.wfile.write(body)
            else:
                super().do_GET()

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
