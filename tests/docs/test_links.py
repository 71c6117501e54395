"""Relative links of README and docs point to files that exist."""

import pytest

from tests.docs.pages import markdown_pages, relative_links
from tests.docs.results import ROOT

PAGES = [str(page.relative_to(ROOT)) for page in markdown_pages()]


@pytest.mark.parametrize("page", PAGES)
def test_links_resolve(page):
    missing = [link for link, target in relative_links(ROOT / page) if not target.exists()]
    assert missing == []


def test_links_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        '[a](b.md#c) ![d](e.svg) [f](https://g.org) [h](#i) `[j](k.md)` [l](<m.md> "n")\n'
        '```\n[o](p.md)\n```\n<img src="q.svg">\n',
        encoding="utf-8",
    )
    assert [link for link, _ in relative_links(page)] == ["b.md#c", "e.svg", "m.md", "q.svg"]
