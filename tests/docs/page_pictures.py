"""``python -m tests.docs.page_pictures [NAME ...]``: pictures of the pages that verbs write.

Each row of ``PAGES`` is a call on built-in data and the page that it leaves; Chromium shows the top
of the page. ``docs/images/pages`` holds the pictures, and each stands on the page of the docs that
speaks of the verb.
"""

import io
import os
import sys
import tempfile
from pathlib import Path

from PIL import Image

from tests.docs.gallery_pictures import MOST_BYTES, QUALITIES
from tests.docs.results import ROOT
from tests.docs.workbench_picture import SOFTWARE_GL
from tests.gallery.machines import run_verb
from tests.helpers.browser import Tab, open_tab

FOLDER = ROOT / "docs" / "images" / "pages"
WINDOW, SIZE = (1280, 960), (960, 720)  # pixels, of the browser and of the picture
PAINTED = "new Promise(done => setTimeout(() => requestAnimationFrame(() => done(0)), 1500))"
ASSETS = Path("assets")  # from the root of the repository: pages print these paths
AXIS = ASSETS / "gallery" / "servo-axis"

BODIES, LINEAR = ASSETS / "two_bodies.xml", ASSETS / "axis" / "axis.xml"
BUDGET = f"--budget {LINEAR.parent / 'budget.toml'}"
HEAVY = 'mass="80"', 'mass="88"'  # the stage of the second visit
HITS = "--hammer acc1 --hammer acc3 --hits 5 --rate 512 --block 4 --no-pictures"

# Calls of each page, with {out} for its folder, and the page's file.
PAGES = {
    "identify": (f"identify {AXIS} --out {{out}}", "identify.html"),
    "tune": (f"tune {AXIS} --out {{out}}", "report.html"),
    "diagnose": (f"report {AXIS}-diagnosed --out {{out}}", "report.html"),
    "predict": (f"predict {LINEAR} {BUDGET} --out {{out}}", "predict.html"),
    "simulate": (
        f"simulate {LINEAR} {BUDGET} --signal move --at reference:x --amplitude 0.01 "
        "--limits 0.1,1,50,1e4 --duration 0.6 --out {out}",
        "simulate.html",
    ),
    "compare": (
        f"simulate {BODIES} {HITS} --seed 1 --out {{out}}/march; "
        f"simulate {{out}}/heavy.xml --nominal {BODIES} {HITS} --seed 2 --out {{out}}/june; "
        "compare {out}/march {out}/june --band 20 200 --out {out}/compared",
        "page.html",
    ),
    "blind": (
        f"blind {BODIES} --cases 16 --effect mass_error --effect missing_dof --effect appendage "
        "--out {out}",
        "blind.html",
    ),
    "match": (
        f"match {ASSETS / 'gondola/shapes.vtu'} {ASSETS / 'gondola/campaign'} --out {{out}}",
        "match.html",
    ),
    "excite": (
        f"excite {LINEAR} --drives motor --limit motor:force=150,stroke=5e-3,speed=0.2 "
        "--band 5 200 --out {out}",
        "excitation.html",
    ),
}


def write_page(name: str, folder: Path) -> Path:
    """Run the verbs of a page in a folder; return the page."""
    calls, page = PAGES[name]
    out = folder / name
    out.mkdir()
    (out / "heavy.xml").write_text(BODIES.read_text("utf-8").replace(*HEAVY), encoding="utf-8")
    for call in calls.format(out=out).split("; "):
        run_verb(*call.split())
    return next(iter(sorted(out.rglob(page))))


def shoot(tab: Tab, page: Path) -> bytes:
    """Return the top of a page, in the best quality that is small enough."""
    tab.send("Emulation.setScrollbarsHidden", hidden=True)
    tab.show(page.as_uri(), *WINDOW)
    tab.wait("document.readyState == 'complete'")
    tab.run(PAINTED)
    picture = Image.open(io.BytesIO(tab.shot())).convert("RGB")
    picture = picture.resize(SIZE, Image.Resampling.LANCZOS)
    for quality in QUALITIES:
        content = io.BytesIO()
        picture.save(content, "WEBP", quality=quality, method=6)
        if content.tell() <= MOST_BYTES:
            break
    return content.getvalue()


def main(names: list[str]) -> int:
    """Write the pictures of the named pages, or of all."""
    FOLDER.mkdir(exist_ok=True)
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as folder, open_tab(SOFTWARE_GL) as tab:
        for name in names or PAGES:
            path = FOLDER / f"{name}.webp"
            path.write_bytes(shoot(tab, write_page(name, Path(folder))))
            print(f"{path} written, {path.stat().st_size / 1000:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
