"""Rigid directions of a stage that stands askew: along the joint's own axes, by world names."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mbmodel_examples import mjcf, numbers, question
from scipy.spatial.transform import Rotation

from diagnosis import Scene
from diagnosis.effects import missing_dof
from diagnosis.search.free_force import _directions
from mbmodel import Model, as_drawn, linearise, load_machine, loosened, spring_parts, write_mjcf

HIGHEST = 160.0
DOFS = ("tx", "ty", "tz", "rx", "ry", "rz")
ASKEW = Rotation.from_euler("XYZ", [20, -15, 35], degrees=True).as_matrix()
QUARTER = Rotation.from_euler("XYZ", [0, 0, 90], degrees=True).as_matrix()
LEVEL = np.eye(3)
# Axes of the stage, and of its joints, in world axes.
STANDS = {
    "level": (LEVEL, LEVEL),
    "a quarter turned": (QUARTER, QUARTER),
    "askew": (ASKEW, ASKEW),
    "joints alone askew": (LEVEL, ASKEW),
    "stage alone askew": (ASKEW, LEVEL),
}


def stage(folder, frame, axes, dofs=DOFS):
    """A machine of one stage with some joints."""
    quat = Rotation.from_matrix(frame).as_quat()[[3, 0, 1, 2]]
    joints = "".join(
        f'<joint name="top_{dof}" type="{"slide" if dof[0] == "t" else "hinge"}" pos="0.1 0 -0.2" '
        f'axis="{numbers(frame.T @ axes[:, "xyz".index(dof[1])])}" '
        f'stiffness="{1e6 * (2 + number)}" damping="{100 + 20 * number}"/>'
        for number, dof in enumerate(DOFS)
        if dof in dofs
    )
    path = folder / f"{len(dofs)}.xml"
    sites = '<site name="acc1" pos="0.2 0.1 0.3"/><site name="acc2" pos="-0.3 0.2 0.1"/>'
    inertial = '<inertial pos="0.02 0.03 0.1" mass="40" diaginertia="1 1.2 1.5"/>'
    body = f'<body name="top" pos="0.1 0.2 0.3" quat="{numbers(quat)}">{joints}{inertial}{sites}'
    path.write_text(mjcf(f"{body}</body>"), encoding="utf-8")
    return load_machine(path)


@pytest.mark.parametrize("stands", STANDS)
@pytest.mark.parametrize("gone", DOFS)
def test_what_is_held_is_the_joint_that_the_drawing_lacks(tmp_path, gone, stands):
    frame, axes = STANDS[stands]
    whole = stage(tmp_path, frame, axes)
    rigid = stage(tmp_path, frame, axes, [dof for dof in DOFS if dof != gone])
    wider, (held,) = loosened(rigid, HIGHEST)
    column = whole.jacobian[:, DOFS.index(gone)]
    own = wider.jacobian[:, held.coordinate]
    along = axes[:, "xyz".index(gone[1])]
    nearest = int(np.argmax(np.abs(along)))
    assert held.dof == gone[0] + "xyz"[nearest]
    np.testing.assert_allclose(own, np.sign(along[nearest]) * column, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_rigid_directions_of_a_stage_stand_at_right_angles_and_no_two_are_called_alike(
    tmp_path_factory, seed
):
    random = np.random.default_rng(seed)
    frame, axes = (Rotation.random(rng=random).as_matrix() for _ in range(2))
    machine = stage(tmp_path_factory.mktemp("one"), frame, axes, ["ty"])
    wider, held = loosened(machine, HIGHEST)
    assert len({one.dof for one in held}) == len(held) == 5
    found = {one.dof: wider.axles[k + 1].axis for k, one in enumerate(held)}
    turning = np.array([found[f"r{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(turning @ turning.T, np.eye(3), atol=1e-12)
    assert (np.diag(turning) >= 0).all()
    sliding = np.array([axis for dof, axis in found.items() if dof[0] == "t"])
    np.testing.assert_allclose(sliding @ axes[:, 1], 0.0, atol=1e-12)


def test_joints_at_odd_angles_leave_the_axes_of_the_stage(tmp_path):
    odd = ASKEW @ np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]).T
    wider, held = loosened(stage(tmp_path, ASKEW, odd, ["tx", "ty"]), HIGHEST)
    assert [one.dof for one in held] == ["tz", "rx", "ry", "rz"]
    axes = [axle.axis for axle in wider.axles[2:]]
    np.testing.assert_allclose(axes, ASKEW.T[[2, 0, 1, 2]], atol=1e-12)


def test_what_gives_way_askew_is_written_along_its_own_axis_and_pushed_by_its_name(tmp_path):
    whole = stage(tmp_path, ASKEW, ASKEW)
    rigid = stage(tmp_path, ASKEW, ASKEW, DOFS[:5])
    wider, held = loosened(rigid, HIGHEST)
    model = Model(wider, spring_parts(wider))
    scene = Scene(SimpleNamespace(model=model), model.drawn, held)
    (one,) = missing_dof.propose(scene)
    assert one.key == ("missing_dof", "joint:top", "rz")
    assert ("joint:top", "rz") in [(place, dof) for place, dof, _ in _directions(scene)]
    loose = Model(wider, (*model.parts, *one.parts))
    theta = np.append(model.drawn, [50.0, 1.0])
    target = tmp_path / "written.xml"
    assert write_mjcf(rigid.source, target, loose.edits(theta)) == ()
    found = load_machine(target)
    np.testing.assert_allclose(found.jacobian[:, 5], whole.jacobian[:, 5], atol=1e-12)
    asked = question(found, np.arange(5.0, HIGHEST, 5.0))
    values, expected = (
        linearise(machine, at, asked).values
        for machine, at in ((as_drawn(found), as_drawn(found).drawn), (loose, theta))
    )
    np.testing.assert_allclose(values, expected, atol=1e-9 * np.abs(expected).max())
