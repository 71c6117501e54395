"""Options of ``mbw simulate``: levels that return, and options that do not fit one another."""

import pytest
from small_machine import MJCF
from typer.testing import CliRunner

from identification import read_settings
from identification.level_check import group_visits
from mbw.command import app
from tuning import open_campaign

RUNNER = CliRunner()
SHORT = ("--hits", "2", "--rate", "256", "--block", "0.5", "--jobs", "1")


def run(*arguments, code=0):
    result = RUNNER.invoke(app, ["simulate", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return path


def test_a_level_that_returns_is_a_further_visit(model, tmp_path):
    levels = ("--level", 20, "--level", 50.5, "--level", 20, "--setups", 2)
    run(model, "--hammer", "3:+tx", *levels, *SHORT, "--out", tmp_path)
    _, settings = read_settings(tmp_path)
    assert [(test.file, test.level, test.setup) for test in settings.test] == [
        ("hits_20N_a.npz", 20, "a"),
        ("hits_20N_b.npz", 20, "b"),
        ("hits_50.5N_a.npz", 50.5, "a"),
        ("hits_50.5N_b.npz", 50.5, "b"),
        ("hits_20N_visit2_a.npz", 20, "a"),
        ("hits_20N_visit2_b.npz", 20, "b"),
    ]
    _, _, campaign = open_campaign(tmp_path)
    visits = group_visits(campaign)
    assert [level for level, _ in visits] == [20, 50.5, 20]
    assert [len(visited.tests) for _, visited in visits] == [2, 2, 2]
