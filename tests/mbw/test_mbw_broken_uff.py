"""Broken universal files through the command: exit 3, one sentence, nothing written."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mbw.command import app

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"


def _truncated(content):
    return content[: len(content) // 2]


def _unequal(content):
    """Another frequency step in a record in the middle."""
    start = content.index(b"2.50000e-01", len(content) // 2)
    return content[:start] + b"2.60000e-01" + content[start + 11 :]


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (_truncated, ["impact_200N.uff", "record", "truncated", "again"]),
        (_unequal, ["impact_200N.uff", "records", "unequal frequency axes", "export"]),
    ],
)
def test_a_broken_file_exits_3_and_writes_nothing(tmp_path, broken, words):
    campaign = tmp_path / "campaign"
    shutil.copytree(DEMO, campaign)
    path = campaign / "impact_200N.uff"
    path.write_bytes(broken(path.read_bytes()))
    result = CliRunner().invoke(app, ["tune", str(campaign), "--out", str(tmp_path / "out")])
    assert result.exit_code == 3, result.stderr
    (sentence,) = result.stderr.strip().splitlines()
    for word in words:
        assert word in sentence
    assert not (tmp_path / "out").exists()
