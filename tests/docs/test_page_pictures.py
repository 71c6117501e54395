"""Pictures of the pages of verbs: small, and each on a page of the docs with what to see on it."""

import pytest

from tests.docs.gallery_pictures import MOST_BYTES
from tests.docs.page_pictures import FOLDER, PAGES
from tests.docs.results import ROOT

TEXTS = [path.read_text("utf-8") for path in sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("name", PAGES)
def test_a_picture_is_small_and_stands_on_a_page_with_a_sentence(name):
    path = FOLDER / f"{name}.webp"
    assert path.stat().st_size <= MOST_BYTES
    (text,) = [text for text in TEXTS if f"images/pages/{path.name})" in text]
    after = text.partition(f"images/pages/{path.name})")[2]
    assert after.startswith("\n\nWhat to see: ")
