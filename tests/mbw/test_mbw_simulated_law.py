"""A nonlinear joint, its virtual hammer test, and the diagnosis of the records."""

import json

import pytest
from simulate_command import run
from typer.testing import CliRunner

from mbw.command import app

K3 = 2e13
MJCF = """
<mujoco model="mass"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body name="mass">
    <inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
    <joint name="x" type="slide" axis="1 0 0" stiffness="1.82e6" damping="85"/>
    <site name="acc1" pos="0 0 0"/><site name="hit1" pos="0 0 0"/>
  </body>
</worldbody></mujoco>
"""


def test_records_tell_the_cubic_stiffness_under_a_soft_hammer_tip(tmp_path):
    model = tmp_path / "mass.xml"
    model.write_text(MJCF, encoding="utf-8")
    levels = [value for level in (40, 100, 200) for value in ("--level", level)]
    law = ("--law", f"x:hardening:k3={K3}", "--seed", 5, "--jobs", 1)
    hits = ("--hammer", "hit1:+tx", "--hits", 6, "--block", 2, "--pulse", 8e-3)
    run(model, *law, *levels, *hits, "--out", tmp_path / "test")
    call = ["diagnose", str(tmp_path / "test"), "--out", str(tmp_path / "gap"), "--quiet"]
    result = CliRunner().invoke(app, call)
    assert result.exit_code == 0, result.output
    first = json.loads((tmp_path / "gap" / "verdict.json").read_text())["causes"][0]
    assert (first["effect"], first["location"], first["dof"]) == ("hardening", "joint:mass", "tx")
    assert first["parameters"]["k3"] == pytest.approx(K3, rel=0.2)
