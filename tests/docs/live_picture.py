"""``python -m tests.docs.live_picture [FOLDER]``: picture of the page of ``mbw live`` for the docs.

It plays a virtual hammer test with bad hits on a machine with a stage that is too heavy, stops it
half way, waits for findings, and writes ``docs/images/live.png``. With a folder it writes every
look of the page there: wide and narrow, light and dark, half way and at the end.
"""

import os
import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

from typer.testing import CliRunner

from mbw.command import app
from mbw.live.findings import FullRefits
from mbw.live.page import LivePage
from mbw.live.session import LiveSession
from mbw.workbench.server import serve_beside
from tests.docs.results import ROOT
from tests.docs.workbench_picture import READY, WIDTHS
from tests.helpers.browser import open_tab

PICTURE = ROOT / "docs" / "images" / "live.png"
MODEL = ROOT / "assets" / "two_bodies.xml"
MASSES = 'mass="80"', 'mass="104"'  # of the stage, as drawn and as it is
OPTIONS = "--hammer acc1 --hammer acc3 --hits 3 --bad-hits 0.2 --seed 3 --live 0 --no-pictures"
N_FILES = 14  # on the first picture; the last one is refused
WAIT_S = 300.0  # for findings


def watch(session: LiveSession, files: list[Path], n_findings: int) -> None:
    """Let files come, one by one in their order, and wait for findings."""
    folder = session.test.source.parent
    for path in files:
        (folder / path.name).write_bytes(path.read_bytes())
        time.sleep(0.02)  # files are told apart by their times
    end = time.monotonic() + WAIT_S
    while len(session.findings) < n_findings and time.monotonic() < end:
        session.step()
        time.sleep(0.1)


def main(arguments: list[str]) -> int:
    """Write the picture of the docs, or all looks of the page into a folder."""
    with (
        tempfile.TemporaryDirectory() as name,
        mock.patch.dict(os.environ, {"XDG_STATE_HOME": f"{name}/states"}),
        mock.patch.object(FullRefits, "ask"),
    ):
        played, folder = Path(name) / "played", Path(name) / "granite"
        model = Path(name) / "machine.xml"
        model.write_text(MODEL.read_text("utf-8").replace(*MASSES), encoding="utf-8")
        words = ["simulate", str(model), "--nominal", str(MODEL), *OPTIONS.split(), "--quiet"]
        words += ["--out", str(played)]
        run = CliRunner().invoke(app, words)
        assert run.exit_code == 0, run.output
        folder.mkdir()
        for file in (path for path in played.iterdir() if path.suffix in (".toml", ".xml")):
            (folder / file.name).write_bytes(file.read_bytes())
        files = sorted(played.glob("*.npz"))
        session = LiveSession.open(folder, print)
        with serve_beside(LivePage(session)) as server, open_tab() as tab:
            stages = {"": files[:N_FILES]}
            if arguments:
                Path(arguments[0]).mkdir(parents=True, exist_ok=True)
                stages = {"half-": files[:N_FILES], "end-": files[N_FILES:]}
            for number, (stage, new) in enumerate(stages.items(), start=1):
                watch(session, new, number)
                for width, size in WIDTHS.items() if arguments else [("wide", WIDTHS["wide"])]:
                    for dark in (False, True) if arguments else (False,):
                        look = f"{stage}{width}-{'dark' if dark else 'light'}.png"
                        path = Path(arguments[0]) / look if arguments else PICTURE
                        tab.show(server.address, *size, dark=dark)
                        tab.wait(READY)
                        tab.run("new Promise(requestAnimationFrame).then(() => 0)")
                        tab.picture(path)
                        print(f"{path} written")
        session.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
