"""Points on solid bodies: rows against cross products, finite rotations and the power balance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from identification.words import Dof, Layout, UsageError, is_hammer_point, node_number

RNG = np.random.default_rng(8)
AXES = np.stack([Rotation.random(random_state=seed).as_matrix() for seed in range(5)])
AXES[2, :, 1] *= -1  # a flipped channel: left-handed
LAYOUT = Layout(
    bodies=("base", "table", "holder"),
    centres=RNG.normal(size=(3, 3)),
    points=("acc1", "acc12", "hit1", "hit7", "corner"),
    body_of=np.array([0, 2, 0, 1, 2]),
    positions=RNG.normal(size=(5, 3)),
    axes=AXES,
)
POINTS = list(LAYOUT.points)
DOFS = [Dof.of(point, axis, sign) for point in POINTS for axis in range(6) for sign in (1, -1)]


def arm_and_body(point):
    index = POINTS.index(point)
    body = int(LAYOUT.body_of[index])
    return LAYOUT.positions[index] - LAYOUT.centres[body], body, LAYOUT.axes[index]


@pytest.mark.parametrize("dof", DOFS, ids=str)
def test_a_row_holds_the_axis_and_its_moment_arm(dof):
    (row,) = LAYOUT.rows([dof])
    (x, y, z), body, axes = arm_and_body(dof.point)
    a = dof.sign * axes[:, dof.axis % 3]
    expected = np.zeros(18)
    if dof.axis > 2:
        expected[6 * body + 3 : 6 * body + 6] = a
    else:
        expected[6 * body : 6 * body + 3] = a
        moment = [y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0]]
        expected[6 * body + 3 : 6 * body + 6] = moment
    # The same three products in another order of rounding.
    np.testing.assert_allclose(row, expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("point", POINTS)
def test_translation_rows_are_the_slope_of_a_finite_motion(point):
    arm, body, axes = arm_and_body(point)
    rows = LAYOUT.rows([Dof.of(point, axis) for axis in range(3)])[:, 6 * body : 6 * body + 6]
    step = 1e-5
    for column in range(6):
        motion = np.zeros(6)
        motion[column] = step

        def moved(motion):
            return motion[:3] + Rotation.from_rotvec(motion[3:]).apply(arm) - arm

        slope = (moved(motion) - moved(-motion)) / (2 * step)
        # Truncation step^2 / 6 = 2e-11, rounding 1e-16 / step = 1e-11.
        np.testing.assert_allclose(rows[:, column], axes.T @ slope, atol=1e-10)


@pytest.mark.parametrize("point", POINTS)
def test_rotation_rows_are_the_slope_of_a_finite_rotation(point):
    _, body, axes = arm_and_body(point)
    rows = LAYOUT.rows([Dof.of(point, axis) for axis in range(3, 6)])[:, 6 * body : 6 * body + 6]
    turn = np.array([0.3, -0.2, 0.4])
    rate = Rotation.from_rotvec(1e-5 * turn).as_rotvec() / 1e-5
    np.testing.assert_allclose(rows @ np.r_[np.zeros(3), rate], axes.T @ turn, rtol=1e-10)


def test_a_body_is_a_point_at_its_centre_in_world_axes():
    rows = LAYOUT.rows([Dof.of("table", axis) for axis in range(6)])
    np.testing.assert_array_equal(rows, np.eye(18)[6:12])


def test_the_dofs_of_all_bodies_are_the_identity():
    np.testing.assert_array_equal(LAYOUT.rows(LAYOUT.body_dofs()), np.eye(18))


@given(st.sampled_from(DOFS), st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_a_force_at_a_point_does_the_work_that_its_wrench_does_at_the_centre(dof, motion):
    # Power balance: f times the motion at the point = wrench times the motion of the body.
    arm, body, axes = arm_and_body(dof.point)
    v, theta = np.array(motion[:3]), np.array(motion[3:])
    at_point = theta if dof.is_rotation else v + np.cross(theta, arm)
    work = dof.sign * axes[:, dof.axis % 3] @ at_point
    whole = np.zeros(18)
    whole[6 * body : 6 * body + 6] = motion
    force = 1.7
    wrench = LAYOUT.rows([dof])[0] * force
    # Sums of up to nine terms of size up to 2 x |arm|.
    assert wrench @ whole == pytest.approx(force * work, rel=1e-12, abs=1e-13)


def test_a_force_column_balances_force_and_moment():
    arm, body, axes = arm_and_body("hit7")
    column = LAYOUT.rows([Dof.parse("hit7:-ty")])[0][6 * body : 6 * body + 6]
    np.testing.assert_allclose(column[:3], -axes[:, 1], rtol=1e-15)
    np.testing.assert_allclose(column[3:], np.cross(arm, -axes[:, 1]), rtol=1e-15)


def test_no_dof_gives_no_row():
    assert LAYOUT.rows([]).shape == (0, 18)


def test_an_unknown_point_is_named_with_those_there_are():
    with pytest.raises(UsageError, match=r"'acc9' is neither .* acc1, .* holder"):
        LAYOUT.rows([Dof.parse("acc9:+tx")])


@pytest.mark.parametrize(
    ("point", "body"),
    {
        "acc1": "base",
        "acc12": "holder",
        "hit7": "table",
        "corner": "holder",
        "table": "table",
    }.items(),
)
def test_a_point_knows_its_body(point, body):
    assert LAYOUT.body_name(point) == body


@pytest.mark.parametrize(("node", "name"), [(1, "acc1"), (12, "acc12"), (2, None), (7, None)])
def test_a_sensor_is_found_by_its_whole_node_number(node, name):
    assert LAYOUT.sensor_at_node(node) == name


@pytest.mark.parametrize(
    ("node", "name"), [(1, "hit1"), (7, "hit7"), (12, "acc12"), (2, None), (11, None)]
)
def test_the_hammer_hits_at_its_own_point_or_else_at_the_sensor(node, name):
    assert LAYOUT.hammer_at_node(node) == name


@pytest.mark.parametrize(
    ("site", "node"),
    [
        *(("acc11", 11), ("acc007", 7), ("11", 11), ("a1b22", 22), ("hit3", 3)),
        *(("acc", None), ("acc1x", None), ("", None)),
    ],
)
def test_a_node_is_the_number_at_the_end_of_a_name(site, node):
    assert node_number(site) == node


@pytest.mark.parametrize(
    ("site", "hammer"),
    [
        *(("hit3", True), ("hit30", True)),
        *(("whit3", False), ("hit", False), ("hit3b", False), ("hitter3", False), ("acc3", False)),
    ],
)
def test_only_hit_and_a_number_is_a_hammer_point(site, hammer):
    assert is_hammer_point(site) is hammer


def test_turning_a_point_changes_its_rows_only():
    axes = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    turned = LAYOUT.with_point_axes("acc12", axes)
    for point in POINTS:
        dofs = [Dof.of(point, axis) for axis in range(3)]
        if point == "acc12":
            (arm, body, _) = arm_and_body(point)
            columns = slice(6 * body, 6 * body + 3)
            np.testing.assert_allclose(turned.rows(dofs)[:, columns], axes.T, rtol=1e-15)
            moment = turned.rows(dofs)[:, 6 * body + 3 : 6 * body + 6]
            np.testing.assert_allclose(moment, np.cross(arm, axes.T), rtol=1e-14)
        else:
            np.testing.assert_array_equal(turned.rows(dofs), LAYOUT.rows(dofs))


def test_turning_can_move_a_point_to_another_body_at_the_same_place():
    moved = LAYOUT.with_point_axes("acc1", np.eye(3), body="table")
    assert moved.body_name("acc1") == "table"
    np.testing.assert_array_equal(moved.positions, LAYOUT.positions)
    row = moved.rows([Dof.parse("acc1:+tz")])[0]
    arm = LAYOUT.positions[0] - LAYOUT.centres[1]
    np.testing.assert_allclose(row[6:12], [0, 0, 1, arm[1], -arm[0], 0], rtol=1e-15)
    assert not row[:6].any()


def test_turning_leaves_the_layout_it_came_from():
    before = LAYOUT.axes.copy()
    LAYOUT.with_point_axes("corner", np.eye(3), body="base")
    np.testing.assert_array_equal(LAYOUT.axes, before)
    assert LAYOUT.body_name("corner") == "holder"


@pytest.mark.parametrize("name", ["centres", "body_of", "positions", "axes"])
def test_arrays_of_a_layout_are_read_only(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(LAYOUT, name)[...] = 0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"centres": np.zeros((2, 3))}, "centres has shape"),
        ({"centres": np.full((3, 3), np.nan)}, "centres is not finite"),
        ({"positions": np.zeros((3, 5))}, "positions has shape"),
        ({"positions": np.full((5, 3), np.inf)}, "positions is not finite"),
        ({"axes": np.zeros((5, 9))}, "axes has shape"),
        ({"body_of": np.array([0, 2, 0, 1])}, "body_of has shape"),
        ({"body_of": np.array([0, 3, 0, 1, 2])}, "index that no body has"),
        ({"body_of": np.array([0, -1, 0, 1, 2])}, "index that no body has"),
        ({"bodies": ("base", "table", "base")}, "base names more than one"),
        ({"points": ("acc1", "acc12", "hit1", "acc1", "corner")}, "acc1 names more than one"),
        ({"points": ("acc1", "acc12", "hit1", "hit7", "table")}, "table names more than one"),
    ],
)
def test_a_layout_that_contradicts_itself_is_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        replace(LAYOUT, **changed)


def test_a_layout_without_points_is_one():
    bare = Layout(("a",), np.zeros((1, 3)), (), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    assert bare.sensor_at_node(1) is None
    assert len(bare.body_dofs()) == 6


def test_axes_that_are_no_unit_vectors_are_refused_when_built():
    with pytest.raises(ValueError, match="unit vectors"):
        Layout(("b",), [[0, 0, 0]], ("p",), [0], [[0, 0, 0]], [2 * np.eye(3)])
