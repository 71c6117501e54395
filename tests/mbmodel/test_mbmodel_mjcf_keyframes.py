"""Keyframes: the pose and the controls at which a machine is linearised."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from mbmodel_examples import mjcf
from test_mbmodel_mjcf_features import assert_agrees

from identification.words import InputError
from mbmodel import (
    Addition,
    as_drawn,
    load_machine,
    machine_geometry,
    modes_of_matrices,
    suspended_mass_elements,
    write_mjcf,
)
from mbmodel.mjcf.edit import Element

BOX = '<geom type="box" size=".1 .2 .15" mass="10" contype="0" conaffinity="0"/>'
BODIES = (
    '<body name="hand" mocap="true" pos="1 0 2"><site name="fix"/></body>'
    '<body name="a"><joint name="turn" axis="0 0 1" damping=".1"/>'
    '<joint name="x" type="slide" axis="1 0 0"/>' + BOX + '<site name="acc1" pos=".1 0 .2"/>'
    '<body name="b" pos="0 0 .3"><joint name="s" axis="0 1 0" stiffness="40"/>' + BOX + "</body>"
    '</body><body name="c" pos="0 3 0"><joint name="t" axis="1 0 0" stiffness="30"/>' + BOX
    + '<site name="acc2"/></body>'
)  # fmt: skip
AFTER = (
    '<tendon><spatial name="rope" stiffness="900" springlength=".5"><site site="fix"/>'
    '<site site="acc1"/></spatial></tendon>'
    '<actuator><position name="hold" joint="x" kp="800"/></actuator>'
)


def keyed(**keys):
    """Return a machine whose frequencies differ at each keyframe."""
    frames = "".join(f'<key name="{name}" {text}/>' for name, text in keys.items())
    return mjcf(BODIES, gravity="0 0 -9.81").replace(
        "</mujoco>", f"{AFTER}<keyframe>{frames}</keyframe></mujoco>"
    )


HOME = 'qpos=".8 .2 0 0" ctrl=".3" mpos="0 1 1.5"'
AWAY = 'qpos="-1 .4 .1 0" ctrl="-.4"'


def save(folder: Path, text: str, name="m.xml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def frequencies(machine):
    model = as_drawn(machine)
    return np.sort(modes_of_matrices(model.matrices(model.drawn)).freq_hz)


@pytest.mark.parametrize(
    ("keys", "stated", "used"),
    [
        ({"away": AWAY, "home": HOME}, None, "home"),
        ({"away": AWAY, "home": HOME}, "away", "away"),
        ({"away": AWAY, "home": HOME}, "", ""),
        ({"away": AWAY}, None, ""),
        ({"": AWAY}, "0", "0"),
    ],
)
def test_the_keyframe_that_counts_gives_pose_controls_and_mocap_bodies(
    tmp_path, keys, stated, used
):
    path = save(tmp_path, keyed(**keys))
    machine = assert_agrees(path, key=stated)
    assert machine.keyframe == used
    assert frequencies(machine)[-1] > 0.1
    words = f"keyframe '{used}' gives pose and controls" if used else "of which none is used"
    assert any(words in remark for remark in machine.remarks)
    # The pictures show the same pose: a surface's middle is where its body's centre is.
    surface = next(s for s in machine_geometry(machine).surfaces if s.stage == "a")
    np.testing.assert_allclose(surface.vertices.mean(axis=0), machine.layout.centres[0], atol=1e-9)


def test_the_poses_of_keyframes_are_different_machines(tmp_path):
    path = save(tmp_path, keyed(away=AWAY, home=HOME))
    centres = [load_machine(path, key=key).layout.centres[0] for key in ("home", "away", "")]
    assert min(np.linalg.norm(centres[i] - centres[i - 1]) for i in range(3)) > 0.05


def test_a_keyframe_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    path = save(tmp_path, keyed(away=AWAY, home=HOME))
    with pytest.raises(InputError, match=r"no keyframe 'rest': choose one of away, home"):
        load_machine(path, key="rest")
    with pytest.raises(InputError, match="no keyframe 'home': it has none"):
        load_machine(save(tmp_path, mjcf(BODIES)), key="home")


def test_velocities_of_a_keyframe_are_said_not_to_count(tmp_path):
    path = save(tmp_path, keyed(home=HOME + ' qvel="3 0 0 0"'))
    assert any("its velocities are not used" in text for text in load_machine(path).remarks)


def test_added_joints_and_bodies_keep_the_poses_of_keyframes(tmp_path):
    path = save(tmp_path, keyed(away=AWAY, home=HOME + ' qvel="3 1 2 4"'))
    machine = load_machine(path)
    joint = Element("joint", {"name": "new", "type": "slide", "axis": "0 1 0", "stiffness": 3e8})
    mass = suspended_mass_elements(
        "cover", machine, "a", (machine.layout.centres[0], np.eye(3)[2]), np.array([0.1, 3e8, 1.0])
    )
    target = tmp_path / "tuned.xml"
    assert write_mjcf(path, target, [Addition("new", "a", joint), *mass]) == ()
    keys = {key.get("name"): key.attrib for key in ElementTree.parse(target).iter("key")}
    assert keys["away"]["qpos"].split() == ["-1", ".4", "0", ".1", "0", "0"]
    assert keys["home"]["qvel"].split() == ["3", "1", "0", "2", "4", "0"]
    again = load_machine(target)
    assert again.keyframe == "home"
    places = [again.coordinates.index(name) for name in machine.coordinates]
    assert len(again.coordinates) == len(machine.coordinates) + 2
    np.testing.assert_allclose(
        again.drawing.joints["x"].position, machine.drawing.joints["x"].position
    )
    np.testing.assert_allclose(again.jacobian[:6][:, places], machine.jacobian[:6], atol=2e-3)
