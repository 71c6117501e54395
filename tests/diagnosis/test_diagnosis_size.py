"""The diagnosis stays readable: short files, and one algorithm that fits on a page."""

from pathlib import Path

import pytest

import diagnosis

ROOM = Path(diagnosis.__file__).parent


@pytest.mark.parametrize("file", sorted(ROOM.rglob("*.py")), ids=lambda file: file.name)
def test_a_file_has_at_most_250_lines(file):
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 250


def test_the_algorithm_is_ten_sentences():
    text = diagnosis.diagnose.__doc__ or ""
    assert [f"{number}. " in text for number in range(1, 11)] == [True] * 10
