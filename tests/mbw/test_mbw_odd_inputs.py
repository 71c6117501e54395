"""Odd but plausible inputs of every verb: never an internal error, a hang or many lines."""

import os
import shutil
from pathlib import Path

import pytest
from campaign_folder import write_folder
from typer.testing import CliRunner

from mbw.command import app

GONDOLA = Path(__file__).parents[2] / "assets" / "gondola"
SHAPES = str(GONDOLA / "shapes.vtu")
FIRST = {
    "identify": ["identify"],
    "tune": ["tune"],
    "diagnose": ["diagnose"],
    "predict": ["predict", "--no-pictures"],
    "match": ["match", SHAPES],
    "place": ["place"],
    "report": ["report"],
    "blind": ["blind", "--cases", "1"],
    "modes": ["tune", "camp", "--residual", "modal", "--from-modes"],
    "against": ["identify", "camp", "--against"],
    "check": ["place", SHAPES, "--check"],
    "frequencies": ["place", SHAPES, "--frequencies"],
}
ODD = (
    *("empty", "empty.xml", "binary.xml", "emptyfolder", "folder.xml", "folder.toml", "loop"),
    *("pipe", "zero.xml", "none", "n" * 300, "", "/", "a\x01b", "[b] ä %s {x} 100%", "\udcff"),
    *("camp/impact.mat", "camp/campaign.toml.txt", "-", "emptycampaign"),
)


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    folder = tmp_path_factory.mktemp("odd")
    write_folder(folder / "camp", lines=40)
    shutil.copyfile(folder / "camp" / "campaign.toml", folder / "camp" / "campaign.toml.txt")
    for name in ("empty", "empty.xml"):
        (folder / name).touch()
    (folder / "binary.xml").write_bytes(bytes(range(256)) * 20)
    for name in ("emptyfolder", "folder.xml", "folder.toml", "emptycampaign"):
        (folder / name).mkdir()
    (folder / "emptycampaign" / "campaign.toml").touch()
    (folder / "loop").symlink_to("loop")
    (folder / "zero.xml").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe")
    return folder


@pytest.mark.parametrize("verb", FIRST)
def test_what_is_no_input_of_a_verb_is_one_sentence(odd, monkeypatch, verb):
    monkeypatch.chdir(odd)
    before = sorted(path.name for path in odd.iterdir())
    for name in ODD:
        done = CliRunner().invoke(app, [*FIRST[verb], name])
        assert done.exit_code in (2, 3), (name, done.stderr)
        last = done.stderr.strip().splitlines()[-1]
        assert "internal" not in last
        assert len(last) < 1200
        assert done.stdout == "" or verb in ("place", "against"), name
    assert sorted(path.name for path in odd.iterdir()) == before


def test_a_campaign_whose_name_is_odd_is_read(odd, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    name = "[b] mäß %s {x} 100% 'q'"
    shutil.copytree(odd / "camp", tmp_path / name)
    for verb in ("identify", "tune"):
        done = CliRunner().invoke(app, [verb, name, "--quiet"])
        assert done.exit_code in (0, 4), done.stderr
    report = CliRunner().invoke(app, ["report", f"{name}-tuned"])
    assert report.exit_code == 0, report.stderr


@pytest.mark.parametrize("band", [("nan", "100"), ("10", "nan"), ("-inf", "-1"), ("1e400", "inf")])
@pytest.mark.parametrize("verb", ["identify", "tune", "diagnose"])
def test_a_band_that_is_none_is_refused(odd, monkeypatch, tmp_path, verb, band):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [verb, str(odd / "camp"), "--band", *band])
    assert done.exit_code in (2, 3)
    assert "internal" not in done.stderr
    assert list(tmp_path.iterdir()) == []
