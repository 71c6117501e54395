"""The Markdown pages of the project that readers see, and the links that they hold."""

import re
from collections.abc import Iterator
from pathlib import Path

from tests.docs.results import ROOT

DOCS = ROOT / "docs"
LINK = re.compile(r"!?\[[^\]]*\]\(<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\)|\bsrc=\"([^\"]+)\"")


def markdown_pages() -> list[Path]:
    """Return README and all Markdown pages under docs."""
    return [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def relative_links(page: Path) -> Iterator[tuple[str, Path]]:
    """Yield every relative link of a page with the file that it points to; code does not count."""
    text = re.sub(r"^(```+).*?^\1", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for match in LINK.finditer(re.sub(r"`[^`\n]*`", "", text)):
        target = match[1] or match[2]
        if not re.match(r"[a-z]+:|#", target):
            yield target, page.parent / target.partition("#")[0]
