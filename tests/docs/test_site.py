"""The site builds without a warning and asks nothing of a network."""

import re

import pytest

from tests.docs.build_site import SETTINGS, build_site
from tests.docs.offline import visit
from tests.docs.pages import markdown_pages
from tests.docs.results import ROOT
from tests.helpers.browser import CHROMIUM

pytest.importorskip("zensical", reason="the extra docs is not installed")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    return build_site(folder)


def pages_of(folder):
    return [str(page.relative_to(folder)) for page in sorted(folder.rglob("*.html"))]


def test_the_navigation_names_every_page():
    named = re.findall(r": (\S+\.(?:md|ipynb))$", (ROOT / SETTINGS).read_text("utf-8"), re.M)
    files = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "docs").rglob("*.ipynb")]
    assert sorted(named) == sorted(str(file.relative_to(ROOT / "docs")) for file in files)


def test_the_first_page_leads_to_every_page():
    first = (ROOT / "docs" / "index.md").read_text("utf-8")
    named = re.findall(r": (\S+\.(?:md|ipynb))$", (ROOT / SETTINGS).read_text("utf-8"), re.M)
    assert [page for page in named if f"({page}" not in first] == ["index.md"]


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
def test_no_request_fails_without_network(site):
    pages = [page for page in pages_of(site) if page != "404.html"]
    result = visit(site, pages)
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
    result = visit(tmp_path, ["index.html"])
    assert "/gone.png" in result.failed
    assert result.foreign == ["http://fonts.example.net/f.css", "https://example.org/x.png"]
