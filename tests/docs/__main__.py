"""``python -m tests.docs``: make the generated parts of README and docs anew, in place.

These are the figures between ``<!-- bench:KEY -->`` markers, and the pages of the command line and
of the gallery.
``--list`` prints the key and the present value of every figure instead.
"""

import sys
from pathlib import Path

from tests.docs.command_page import COMMAND_PAGE, command_page
from tests.docs.figures import FIGURES
from tests.docs.gallery_page import GALLERY_PAGE, gallery_page
from tests.docs.markers import regenerate
from tests.docs.pages import markdown_pages
from tests.docs.results import ROOT


def main(arguments: list[str]) -> int:
    """Write all pages whose generated parts have changed, or list the figures."""
    if arguments == ["--list"]:
        for key, figure in FIGURES.items():
            text = figure()
            print(f"{key}:{chr(10) if chr(10) in text else ' '}{text}")
        return 0
    for page in markdown_pages():
        _write(page, regenerate(page.read_text(encoding="utf-8"), FIGURES))
    _write(COMMAND_PAGE, command_page())
    _write(GALLERY_PAGE, gallery_page())
    return 0


def _write(page: Path, text: str) -> None:
    if not page.is_file() or page.read_text(encoding="utf-8") != text:
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")
        print(f"{page.relative_to(ROOT)} written")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
