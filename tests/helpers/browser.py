"""What a page holds, read from its text and, with probes, in a real browser."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import axe_core_python
import numpy as np

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
CATCH = """<script>window.FAULTS = [];
addEventListener("error", event => FAULTS.push(event.message));
addEventListener("unhandledrejection", event => FAULTS.push(String(event.reason)));
addEventListener("securitypolicyviolation",
  event => FAULTS.push(`refused: ${event.violatedDirective} ${event.blockedURI}`));
console.error = (...words) => FAULTS.push(words.join(" "));</script>"""


SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def sha256(text):
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def data_of(text):
    return json.loads(re.search(r"^const DATA = (.*);$", text, re.MULTILINE)[1])


def unpacked(packed, kind="<f4"):
    return np.frombuffer(base64.b64decode(packed), kind)


def browse(page, folder, *flags, probe):
    """What a probe, a script that leaves JSON in a pre of id found, finds in the page."""
    # CATCH stands before the policy of the page; the probe is allowed like the page's own scripts.
    probed = page.replace("<head>", "<head>" + CATCH, 1).replace("</body>", probe + "</body>")
    allowed = " ".join(f"'sha256-{sha256(text)}'" for text in SCRIPT.findall(probe))
    probed = probed.replace("script-src ", f"script-src {allowed} ", 1)
    (folder / "probed.html").write_text(probed, encoding="utf-8")
    with tempfile.TemporaryDirectory() as profile:
        done = subprocess.run(
            [
                CHROMIUM, "--headless", "--no-sandbox", "--no-first-run",
                "--disable-background-networking", "--disable-component-update",
                "--disable-sync", "--disable-quic", f"--user-data-dir={profile}",
                "--force-prefers-reduced-motion", "--virtual-time-budget=15000",
                "--window-size=1280,1600", *flags, "--dump-dom",
                (folder / "probed.html").as_uri(),
            ],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout)
    assert match, done.stderr[-2000:]
    return json.loads(match[1].replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&"))


# Gives a browser the pipes of its protocol: commands on 3, answers on 4.
PIPES = """import fcntl, os, sys
for number, name in zip((3, 4), [fcntl.fcntl(int(f), fcntl.F_DUPFD, 10) for f in sys.argv[1:3]]):
    os.dup2(name, number)
os.execv(sys.argv[3], sys.argv[3:])"""


class Tab:
    """A tab of a real browser, driven by its own protocol over two pipes: no package, no port."""

    def __init__(self, process, commands, answers):
        self._process, self._commands, self._answers = process, commands, answers
        self._number, self._buffer, self._session, self.events = 0, b"", None, []
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network"):
            self.send(f"{domain}.enable")
        catch = CATCH.removeprefix("<script>").removesuffix("</script>")
        self.send("Page.addScriptToEvaluateOnNewDocument", source=catch)

    def send(self, method, **parameters):
        """Send a command and return its result; events that come first are kept."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._commands.write(json.dumps(message).encode() + b"\0")
        self._commands.flush()
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _read(self):
        while b"\0" not in self._buffer:
            part = os.read(self._answers.fileno(), 2**16)
            assert part, "the browser has ended"
            self._buffer += part
        line, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(line)

    def run(self, script):
        """Return what an expression or a promise of it comes to."""
        answer = self.send(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True,
            userGesture=True,
        )  # fmt: skip
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, condition):
        """Wait until an expression is true, asked at each frame that the browser paints."""
        return self.run(
            "new Promise((done, fail) => { const end = performance.now() + 60000;"
            f"const look = () => ({condition}) ? done(true) : performance.now() > end ? "
            f"fail(Error({condition!r})) : requestAnimationFrame(look); look(); }})"
        )

    def show(self, address, width=1280, height=800, dark=False, still=True):
        """Open an address in a window of a size, with the user's wishes of look and motion."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        wishes = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if still else "no-preference",
        }
        features = [{"name": name, "value": value} for name, value in wishes.items()]
        self.send("Emulation.setEmulatedMedia", features=features)
        self.send("Page.navigate", url=address)

    def press(self, key, modifiers=0, code=0):
        """Press and release a key, by its name in the DOM."""
        for kind in ("keyDown", "keyUp"):
            self.send(
                "Input.dispatchKeyEvent", type=kind, key=key, code=key, modifiers=modifiers,
                windowsVirtualKeyCode=code,
            )  # fmt: skip

    def find_barriers(self):
        """Violations that axe reports on the page, each with its elements."""
        axe = Path(axe_core_python.__file__).with_name("axe.min.js")
        self.run(axe.read_text("utf-8") + "; 0")
        return self.run(
            "axe.run().then(result => result.violations.map(each => [each.id, "
            "...each.nodes.map(node => node.target[0] + ' ' + node.failureSummary)]))"
        )

    def shot(self):
        """Picture of the tab as PNG."""
        return base64.b64decode(self.send("Page.captureScreenshot")["data"])

    def picture(self, path):
        """Write what the tab shows as PNG."""
        path.write_bytes(self.shot())


@contextmanager
def open_tab(*flags):
    """Yield a tab of a browser that reaches this computer alone."""
    in_read, in_write = os.pipe()
    out_read, out_write = os.pipe()

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [
                sys.executable, "-c", PIPES, str(in_read), str(out_write),
                CHROMIUM, "--headless", "--no-sandbox", "--no-first-run", "--remote-debugging-pipe",
                "--disable-background-networking", "--disable-component-update", "--disable-sync",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                f"--user-data-dir={profile}", *flags,
            ],
            pass_fds=(in_read, out_write), stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(in_read)
        os.close(out_write)
        try:
            with os.fdopen(in_write, "wb") as commands, os.fdopen(out_read, "rb") as answers:
                yield Tab(process, commands, answers)
        finally:
            process.terminate()
            process.wait(30)
