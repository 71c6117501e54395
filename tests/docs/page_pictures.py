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

PAGES = {
    "identify": (f"identify {AXIS}", "identify.html"),
    "tune": (f"tune {AXIS}", "report.html"),
    "diagnose": (f"report {AXIS}-diagnosed", "report.html"),
}


def write_page(name: str, folder: Path) -> Path:
    """Run the verb of a page into a folder; return the page."""
    words, page = PAGES[name]
    out = folder / name
    run_verb(*words.split(), "--out", str(out))
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
