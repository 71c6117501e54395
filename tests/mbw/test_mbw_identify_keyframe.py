"""The result of ``mbw identify`` keeps the keyframe: its page shows the pose of the test."""

import json

import pytest
from campaign_folder import write_folder
from typer.testing import CliRunner

import mbw.identify.page
from mbmodel import load_machine
from mbw.command import app


@pytest.fixture
def keyed(tmp_path):
    """A campaign that states the keyframe ``far``, beside ``home``."""
    folder = write_folder(tmp_path / "campaign")
    path = folder / "model.xml"
    keys = '<key name="home" ctrl="3e5"/><key name="far" ctrl="-3e5"/>'
    path.write_text(
        path.read_text(encoding="utf-8").replace(
            "</mujoco>",
            '<actuator><motor name="push" joint="base_tx"/></actuator>'
            f"<keyframe>{keys}</keyframe></mujoco>",
        ),
        encoding="utf-8",
    )
    toml = folder / "campaign.toml"
    toml.write_text('key = "far"\n' + toml.read_text(encoding="utf-8"), encoding="utf-8")
    return folder


def test_the_page_is_made_again_at_the_stated_keyframe(keyed, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run = CliRunner().invoke(app, ["identify", str(keyed), "--out", str(out)])
    assert run.exit_code == 0, run.output
    assert json.loads((out / "modes.json").read_text("utf-8"))["keyframe"] == "far"
    loaded = []

    def record(path, **options):
        loaded.append(load_machine(path, **options))
        return loaded[-1]

    monkeypatch.setattr(mbw.identify.page, "load_machine", record)
    mbw.identify.page.render_result(out)
    assert [machine.keyframe for machine in loaded] == ["far"]
