"""``python -m tests.docs.workbench_picture [FOLDER]``: pictures of the workbench for the docs.

It identifies and tunes a copy of ``assets/demo``, moves two stiffnesses of the tuned model and
writes ``docs/images/workbench.png``. Then an appendage is added, its frequency moves up and down,
and ``docs/images/workbench.webp`` shows what follows. With a folder it writes every look of the
page there: wide and narrow, light and dark.
"""

import io
import os
import shutil
import sys
import tempfile
from pathlib import Path
from unittest import mock

import numpy as np
from PIL import Image
from typer.testing import CliRunner

from mbw.command import app
from mbw.workbench.opening import open_subject
from mbw.workbench.state import Look, Move
from tests.docs.results import ROOT
from tests.helpers.browser import Tab, open_tab
from tests.helpers.workbench_server import serve

PICTURE = ROOT / "docs" / "images" / "workbench.png"
SOFTWARE_GL = "--enable-unsafe-swiftshader"
READY = "document.documentElement?.dataset.ready"
WIDTHS = {"wide": (1280, 800), "large": (1680, 1050), "narrow": (390, 844)}
FILM = PICTURE.with_suffix(".webp")
FILM_SIZE, FRAME_MS, STEPS = (960, 600), 120, 24  # pixels; of a frame; up and down again
SIZES = ("mass", "frequency")  # of the appendage, in turn
MOVED = {"granite_bottom_rx.stiffness": 0.3, "granite_bottom_ry.stiffness": -0.2}


def film(tab: Tab) -> None:
    """Write the moving picture: an appendage is added, and two of its sizes move."""
    frames: list[Image.Image] = []

    def shoot(count: int = 1) -> None:
        picture = Image.open(io.BytesIO(tab.shot())).convert("RGB")
        frames.extend([picture.resize(FILM_SIZE, Image.Resampling.LANCZOS)] * count)

    shoot(6)
    tab.run("[...document.querySelectorAll('#adders button')].at(-1).click()")
    tab.wait("document.querySelector('#marks i.edit')")
    shoot(4)
    for size in SIZES:
        slider = f"document.getElementById('appendage1-{size}')"
        for step in range(STEPS + 1):
            share = 0.5 - 0.5 * np.cos(2 * np.pi * step / STEPS)
            tab.run(
                f"new Promise(done => {{ addEventListener('painted', done, {{once: true}});"
                f"{slider}.value = {400 * share * (1.0 if size == 'mass' else 0.35)};"
                f"{slider}.dispatchEvent(new Event('input')); }}).then(() => 0)"
            )
            shoot()
    shoot(6)
    first, *rest = frames
    first.save(FILM, save_all=True, append_images=rest, duration=FRAME_MS, loop=0, quality=60)
    print(f"{FILM} written, {FILM.stat().st_size / 1e6:.1f} MB")


def main(arguments: list[str]) -> int:
    """Write the picture of the docs, or all looks of the page into a folder."""
    with (
        tempfile.TemporaryDirectory() as name,
        mock.patch.dict(os.environ, {"XDG_STATE_HOME": f"{name}/states"}),
    ):
        campaign = Path(shutil.copytree(ROOT / "assets" / "demo", Path(name) / "station"))
        for verb in ("identify", "tune"):
            run = CliRunner().invoke(app, [verb, str(campaign), "--quiet", "--no-pictures"])
            assert run.exit_code in (0, 4), run.output
        subject = open_subject(campaign.with_name("station-tuned"), None, None)
        with serve(subject) as server, open_tab(SOFTWARE_GL) as tab:
            desk = server.page.desk
            x = subject.tuned_x()
            desk.act(0, Move(values={each: x[each] + step for each, step in MOVED.items()}))
            desk.act(1, Look(mode=7))
            looks = [(*WIDTHS["wide"], False, PICTURE)]
            if arguments:
                folder = Path(arguments[0])
                folder.mkdir(parents=True, exist_ok=True)
                looks = [
                    (*size, dark, folder / f"{width}-{'dark' if dark else 'light'}.png")
                    for width, size in WIDTHS.items()
                    for dark in (False, True)
                ]
            for width, height, dark, path in looks:
                tab.show(server.address, width, height, dark=dark)
                tab.wait(READY)
                tab.run("new Promise(requestAnimationFrame).then(() => 0)")
                tab.picture(path)
                print(f"{path} written")
            if not arguments:
                film(tab)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
