"""``python -m tests.docs.build_site``: build the pages into build/site; a warning is an error.

Zensical, which succeeds Material for MkDocs, builds copies of the pages. Before, notebooks become
pages of their names and links to them follow; after, equations become MathML. A page needs nothing
from a network.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import plotly

from tests.docs.equations import replace_equations
from tests.docs.notebook_pages import SCRIPT, link_pages, notebook_markdown
from tests.docs.results import ROOT

SETTINGS = "mkdocs.yml"


def build_site(folder: Path) -> Path:
    """Build the site and return its folder.

    Args:
        folder: of the copies and the site; what it holds of an earlier build is replaced.

    Raises:
        CalledProcessError: a page, link or anchor that does not exist.
        ValueError: an equation that cannot be converted, or a notebook with an error.
    """
    pages, site = folder / "docs", folder / "site"
    for earlier in (pages, site):
        shutil.rmtree(earlier, ignore_errors=True)
    shutil.copytree(ROOT / "docs", pages)
    for notebook in sorted(pages.rglob("*.ipynb")):
        root = "../" * len(notebook.relative_to(pages).parts)
        cells = json.loads(notebook.read_text(encoding="utf-8"))
        text = "\n\n".join(notebook_markdown(cells, root))
        notebook.with_suffix(".md").write_text(text, encoding="utf-8")
        notebook.unlink()
    for page in pages.rglob("*.md"):
        page.write_text(link_pages(page.read_text(encoding="utf-8")), encoding="utf-8")
    script = pages / SCRIPT
    script.parent.mkdir(exist_ok=True)
    shutil.copy(Path(plotly.__file__).parent / "package_data" / "plotly.min.js", script)
    settings = (ROOT / SETTINGS).read_text(encoding="utf-8").replace(".ipynb", ".md")
    (folder / SETTINGS).write_text(settings, encoding="utf-8")
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    subprocess.run(
        command, cwd=folder, check=True, env=os.environ | {"PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
    )
    for page in site.rglob("*.html"):
        page.write_text(replace_equations(page.read_text(encoding="utf-8")), encoding="utf-8")
    return site


if __name__ == "__main__":
    print(f"{build_site(ROOT / 'build')}/index.html")
