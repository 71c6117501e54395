"""What a page holds, read from its text and, with probes, in a real browser."""

import base64
import hashlib
import json
import re
import shutil
import subprocess
import tempfile

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
