"""Time until a machine of the gallery is open: from the start of the command to its first frame.

``mbw open gallery:NAME --no-browser`` runs as a process of its own with a new state. Then the page,
its session, its scene and its first frame are read over HTTP, as a browser reads them.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from mbw.gallery import read_gallery

RUNS = 5
READ = ("/", "/session", "/scene", "/frame")  # by the page before it is shown
MOST_CORE_S = 3.0


def open_machine(name: str, folder: Path) -> tuple[float, float]:
    """Return wall seconds and core seconds until the first frame of a machine."""
    began = time.perf_counter()
    words = [sys.executable, "-m", "mbw", "open", f"gallery:{name}", "--no-browser"]
    with subprocess.Popen(
        words,
        cwd=folder,
        env={**os.environ, "XDG_STATE_HOME": str(folder), "COLUMNS": "200"},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stderr is not None
            said = (re.search(r"workbench of .*: (http\S+)", line) for line in process.stderr)
            address = urlsplit(next(match[1] for match in said if match))
            with closing(HTTPConnection(address.netloc, timeout=60)) as line:
                line.request("GET", f"{address.path}?{address.query}")
                answer = line.getresponse()
                answer.read()
                cookie = str(answer.getheader("Set-Cookie")).partition(";")[0]
                for path in READ:
                    line.request("GET", path, headers={"Cookie": cookie})
                    answer = line.getresponse()
                    assert answer.read()
                    assert answer.status == 200, path
            wall = time.perf_counter() - began
            ticks = Path(f"/proc/{process.pid}/stat").read_text("utf-8").rpartition(")")[2].split()
        finally:
            process.terminate()
    return wall, (int(ticks[11]) + int(ticks[12])) / os.sysconf("SC_CLK_TCK")


def run() -> list[dict[str, object]]:
    """Return the times of each machine: median and largest of some runs."""
    rows: list[dict[str, object]] = []
    for name in read_gallery():
        times = []
        for _ in range(RUNS):
            with tempfile.TemporaryDirectory() as folder:
                times.append(open_machine(name, Path(folder)))
        wall, core = np.array(times).T
        rows.append(
            {
                "machine": name,
                "runs": RUNS,
                "core_s": round(float(np.median(core)), 2),
                "core_s_max": round(float(core.max()), 2),
                "wall_s": round(float(np.median(wall)), 2),
                "wall_s_max": round(float(wall.max()), 2),
                "within_3_s": bool(core.max() <= MOST_CORE_S),
            }
        )
    return rows
