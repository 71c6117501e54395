"""Rigid directions of a stage that stands askew: along the joint's own axes, by world names."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mbmodel_examples import mjcf, numbers, random_request
from scipy.spatial.transform import Rotation

from diagnosis import Scene
from diagnosis.effects import missing_dof
from diagnosis.search.free_force import _list_directions
from mbmodel import (
    Model,
    as_drawn,
    linearise,
    load_machine,
    model_edits,
    release_rigid_directions,
    spring_parts,
    write_mjcf,
)

HIGHEST = 160.0
DOFS = ("tx", "ty", "tz", "rx", "ry", "rz")
ASKEW = Rotation.from_euler("XYZ", [20, -15, 35], degrees=True).as_matrix()
QUARTER = Rotation.from_euler("XYZ", [0, 0, 90], degrees=True).as_matrix()
LEVEL = np.eye(3)
# Axes of the stage, and of its joints, in world axes.
FRAMES = {
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


@pytest.mark.parametrize("case", FRAMES)
@pytest.mark.parametrize("removed", DOFS)
def test_a_rigid_direction_is_the_joint_that_the_drawing_lacks(tmp_path, removed, case):
    frame, axes = FRAMES[case]
    whole = stage(tmp_path, frame, axes)
    rigid = stage(tmp_path, frame, axes, [dof for dof in DOFS if dof != removed])
    extended, (rigid_directions,) = release_rigid_directions(rigid, HIGHEST)
    column = whole.jacobian[:, DOFS.index(removed)]
    released = extended.jacobian[:, rigid_directions.coordinate]
    along = axes[:, "xyz".index(removed[1])]
    nearest = int(np.argmax(np.abs(along)))
    assert rigid_directions.dof == removed[0] + "xyz"[nearest]
    np.testing.assert_allclose(released, np.sign(along[nearest]) * column, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_rigid_directions_of_a_stage_are_orthogonal_and_have_different_names(
    tmp_path_factory, seed
):
    random = np.random.default_rng(seed)
    frame, axes = (Rotation.random(rng=random).as_matrix() for _ in range(2))
    machine = stage(tmp_path_factory.mktemp("one"), frame, axes, ["ty"])
    extended, rigid_directions = release_rigid_directions(machine, HIGHEST)
    assert len({direction.dof for direction in rigid_directions}) == len(rigid_directions) == 5
    axis_of = {
        direction.dof: extended.axles[k + 1].axis for k, direction in enumerate(rigid_directions)
    }
    turning = np.array([axis_of[f"r{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(turning @ turning.T, np.eye(3), atol=1e-12)
    assert (np.diag(turning) >= 0).all()
    sliding = np.array([axis for dof, axis in axis_of.items() if dof[0] == "t"])
    np.testing.assert_allclose(sliding @ axes[:, 1], 0.0, atol=1e-12)


def test_joints_at_odd_angles_leave_the_axes_of_the_stage(tmp_path):
    odd = ASKEW @ np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]).T
    extended, rigid_directions = release_rigid_directions(
        stage(tmp_path, ASKEW, odd, ["tx", "ty"]), HIGHEST
    )
    assert [direction.dof for direction in rigid_directions] == ["tz", "rx", "ry", "rz"]
    axes = [axle.axis for axle in extended.axles[2:]]
    np.testing.assert_allclose(axes, ASKEW.T[[2, 0, 1, 2]], atol=1e-12)


def test_a_direction_released_askew_is_written_along_its_own_axis_and_pushed_by_its_name(tmp_path):
    whole = stage(tmp_path, ASKEW, ASKEW)
    rigid = stage(tmp_path, ASKEW, ASKEW, DOFS[:5])
    extended, rigid_directions = release_rigid_directions(rigid, HIGHEST)
    model = Model(extended, spring_parts(extended))
    scene = Scene(SimpleNamespace(model=model), model.drawn, rigid_directions)
    (hypothesis,) = missing_dof.propose(scene)
    assert hypothesis.key == ("missing_dof", "joint:top", "rz")
    assert ("joint:top", "rz") in [(place, dof) for place, dof, _ in _list_directions(scene)]
    released_model = Model(extended, (*model.parts, *hypothesis.parts))
    theta = np.append(model.drawn, [50.0, 1.0])
    target = tmp_path / "written.xml"
    assert write_mjcf(rigid.source, target, model_edits(released_model, theta)) == ()
    written = load_machine(target)
    np.testing.assert_allclose(written.jacobian[:, 5], whole.jacobian[:, 5], atol=1e-12)
    frf_request = random_request(written, np.arange(5.0, HIGHEST, 5.0))
    values, expected = (
        linearise(machine, at, frf_request).values
        for machine, at in ((as_drawn(written), as_drawn(written).drawn), (released_model, theta))
    )
    np.testing.assert_allclose(values, expected, atol=1e-9 * np.abs(expected).max())
