"""``mbw identify`` in-process."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from mbw.assets import asset_path
from mbw.command import app

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("identified")
    arguments = ["identify", str(asset_path("demo")), "--out", str(folder / "out")]
    return RUNNER.invoke(app, [*arguments, "--json", str(folder / "m.json")]), folder


def test_modes_are_printed_and_written(result):
    outcome, folder = result
    assert outcome.exit_code == 0, outcome.stderr
    content = json.loads((folder / "m.json").read_text())
    assert content == json.loads((folder / "out" / "modes.json").read_text())
    rows = outcome.stdout.splitlines()
    assert len(rows) == len(content["modes"]) + 1
    assert f"{content['modes'][0]['frequency']:.3f}" in rows[1]
    assert "modes in" in outcome.stderr


def test_the_model_answers_at_the_noise(result):
    _, folder = result
    content = json.loads((folder / "m.json").read_text())
    assert 0.8 < content["misfit"] < 1.3
    assert 12 <= len(content["modes"]) <= 18
    assert all(0 < mode["damping"] < 0.4 for mode in content["modes"])
    with np.load(folder / "out" / "modes.npz") as arrays:
        error = np.linalg.norm(arrays["synthesised"] - arrays["measured"], axis=0)
        error /= np.linalg.norm(arrays["measured"], axis=0)
        assert np.sqrt((error**2).mean()) < 0.1
        assert arrays["shapes"].shape == (69, len(arrays["poles"]))
        assert arrays["inside_band"].sum() == len(content["modes"])


def test_a_folder_without_a_campaign_is_refused(tmp_path):
    outcome = RUNNER.invoke(app, ["identify", str(tmp_path)])
    assert outcome.exit_code == 3
    assert "campaign.toml" in outcome.stderr


def test_a_wrong_unit_is_said_beside_the_modes(tmp_path):
    shutil.copytree(asset_path("two_bodies"), tmp_path / "c")
    toml = tmp_path / "c" / "campaign.toml"
    toml.write_text(toml.read_text("utf-8").replace("averages", 'unit = "g/N"\naverages'), "utf-8")
    outcome = RUNNER.invoke(app, ["identify", str(tmp_path / "c"), "--no-pictures"])
    assert outcome.exit_code == 0, outcome.stderr
    assert "nominal model's, as if values in m/s^2/N were read as g/N" in outcome.stderr


def test_classical_methods_stand_beside_and_agree_where_a_mode_is_alone(result):
    _, folder = result
    modes = json.loads((folder / "m.json").read_text())["modes"]
    circles = [mode for mode in modes if mode["by_hand"]["circle_damping"] is not None]
    assert len(circles) >= len(modes) / 2
    for mode in circles:
        off = abs(mode["by_hand"]["circle_frequency"] / mode["frequency"] - 1)
        assert off < mode["damping"], "within half the half-power band"
    assert all(m["by_hand"]["reason"] for m in modes if m["by_hand"]["circle_damping"] is None)
