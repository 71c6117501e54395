"""``mbw models``: which models of a folder have a linear model, and why others have none."""

import json

import pytest
from closed_machines import linkage
from mbmodel_examples import mass_on_spring, mjcf
from typer.testing import CliRunner

from mbw.command import app

RUNNER = CliRunner()
FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'
BOX = '<geom name="foot" type="box" size="0.1 0.1 0.1"/>'
SPRUNG = mjcf(mass_on_spring(4, 3e4, 7))
FILTER = (
    '<actuator><general name="servo" joint="a_j" dyntype="filter" dynprm="0.1" gainprm="100" '
    'biastype="affine" biasprm="0 -100 -2"/></actuator>'
)
MODELS = {
    "plain.xml": SPRUNG,
    "touching.xml": mjcf(
        FLOOR + mass_on_spring(4, 3e4, 7, pos="0 0 0.05").replace("<site", BOX + "<site")
    ),
    "sticky.xml": SPRUNG.replace(' damping="', ' frictionloss="2" damping="'),
    "stopped.xml": SPRUNG.replace(' damping="', ' limited="true" range="0.1 1" damping="'),
    "loop.xml": linkage(),
    "prefix.xml": SPRUNG.replace('body name="a"', 'body name="left:a"'),
    "filter.xml": SPRUNG.replace("</mujoco>", FILTER + "</mujoco>"),
    "deep/broken.xml": SPRUNG.replace("stiffness=", "stifness="),
    "cut.xml": '<mujoco model="m"><worldb',
    "part.xml": "<mujocoinclude><body/></mujocoinclude>",
}


@pytest.fixture
def folder(tmp_path):
    for name, text in MODELS.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_folder_has_a_table_of_models_and_reasons(folder):
    done = RUNNER.invoke(app, ["models", str(folder), "--json", "-"])
    assert done.exit_code == 0, done.output
    table = json.loads(done.stdout)
    rows = {row["model"]: row for row in table["models"]}
    assert set(rows) == set(MODELS) - {"part.xml"}
    refused = {name: row["reason"] for name, row in rows.items() if row["coordinates"] is None}
    damaged = {"deep/broken.xml", "cut.xml"}
    assert set(refused) == {"touching.xml", "sticky.xml", "stopped.xml"} | damaged
    assert "stifness" in refused["deep/broken.xml"]
    assert table["accepted"] == 4
    assert rows["loop.xml"]["error"] is None
    for name in ("plain.xml", "prefix.xml", "filter.xml"):
        assert rows[name]["error"] < 1e-6


def test_what_is_left_out_of_all_models_is_said(folder):
    done = RUNNER.invoke(app, ["models", str(folder), "--without", "contact, friction,limits"])
    assert done.exit_code == 0
    lines = dict(line.split("\t", 1) for line in done.stdout.splitlines())
    damaged = [name for name, rest in lines.items() if rest.startswith("no\t")]
    assert damaged == ["cut.xml", "deep/broken.xml"]
    path = str(folder / "stopped.xml")
    said = RUNNER.invoke(app, ["predict", path, "--modes", "--without", "limits"])
    assert said.exit_code == 0
    assert "Left out as requested: limits (1)" in said.stderr
    unknown = RUNNER.invoke(app, ["predict", path, "--without", "weight"])
    assert unknown.exit_code == 2
    assert "contact, friction, limits, gravity" in unknown.stderr


def test_a_folder_without_models_is_refused(tmp_path):
    assert RUNNER.invoke(app, ["models", str(tmp_path)]).exit_code == 3


def test_a_machine_that_falls_is_taken_without_gravity(tmp_path):
    body = '<body name="b"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>'
    (tmp_path / "free.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    falls = RUNNER.invoke(app, ["models", str(tmp_path), "--json", "-"])
    assert "--without gravity" in json.loads(falls.stdout)["models"][0]["reason"]
    floats = RUNNER.invoke(app, ["models", str(tmp_path), "--without", "gravity", "--json", "-"])
    row = json.loads(floats.stdout)["models"][0]
    assert row["coordinates"] == 6
    assert row["error"] < 1e-6
