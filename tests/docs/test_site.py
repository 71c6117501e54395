"""The site builds without a warning and asks nothing of a network."""

import os
import re
import subprocess
import sys

import pytest

from tests.docs.offline import visit
from tests.docs.pages import markdown_pages
from tests.docs.results import ROOT
from tests.helpers.browser import CHROMIUM

pytest.importorskip("mkdocs", reason="the extra docs is not installed")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


def pages_of(folder):
    return [str(page.relative_to(folder)) for page in sorted(folder.rglob("*.html"))]


def test_no_page_names_another_host_for_what_it_loads(site):
    loads = re.compile(r"<(?:script|img|link|iframe)[^>]*(?:src|href)=[\"']?(?:https?:)?//")
    for page in pages_of(site):
        assert not loads.search((site / page).read_text(encoding="utf-8")), page


def test_no_page_needs_a_script_for_drawings_or_equations():
    for page in markdown_pages():
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"^ *```+ *mermaid|mathjax|katex", text, re.I | re.M), page


def test_equations_are_mathml(site):
    pages = {page: (site / page).read_text(encoding="utf-8") for page in pages_of(site)}
    assert any("<math" in text for text in pages.values())
    assert [page for page, text in pages.items() if 'class="arithmatex"' in text] == []


@needs_browser
def test_no_request_fails_without_network(site, tmp_path):
    pages = [page for page in pages_of(site) if page != "404.html"]
    result = visit(site, pages, tmp_path)
    assert {f"/{page}" for page in pages} <= set(result.loaded)
    assert result.failed == []
    assert result.foreign == []


@needs_browser
def test_requests_that_fail_are_seen(tmp_path):
    (tmp_path / "index.html").write_text(
        '<img src="gone.png"><img src="https://example.org/x.png">'
        '<link rel="stylesheet" href="//fonts.example.net/f.css">',
        encoding="utf-8",
    )
    result = visit(tmp_path, ["index.html"], tmp_path)
    assert "/gone.png" in result.failed
    assert result.foreign == ["http://fonts.example.net/f.css", "https://example.org/x.png"]
