"""Coordinate systems of universal files: positions, axes of nodes, and what is said about them."""

import numpy as np
import pytest
from identification_examples import Function, a_layout, dataset, read_small, units
from scipy.spatial.transform import Rotation

from identification.readers.layout import read_layout
from identification.readers.uff_modes import read_uff_modes
from identification.readers.uff_systems import CoordinateSystem

AXES = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
ORIGIN = np.array([1.0, 0.5, -0.2])


def numbers(values, form="25.16E"):
    return "".join(f"{v:{form}}" for v in values)


def system_2420(label, kind, axes=AXES, origin=ORIGIN, name=""):
    """A system with its axes as columns; the name is blank, as some programs write it."""
    rows = [numbers(row) for row in (*axes.T, origin)]
    return [f"{label:10d}{kind:10d}{8:10d}", name, *rows]


def systems(*blocks):
    return dataset("  2420", [f"{1:10d}", "Part1", *(line for block in blocks for line in block)])


def node(number, coordinates, definition=1, displacement=1):
    fields = (number, definition, displacement, 11)
    return ["".join(f"{f:10d}" for f in fields), numbers(coordinates)]


def nodes(*rows):
    return dataset("  2411", [line for row in rows for line in row])


@pytest.fixture
def layout(tmp_path):
    def read(*blocks):
        path = tmp_path / "geometry.unv"
        path.write_bytes(b"".join(blocks))
        return read_layout(path)

    return read


@pytest.mark.parametrize("kind", [1, 2])
def test_axes_of_a_node_point_where_its_coordinates_grow(kind):
    system = CoordinateSystem(kind, ORIGIN, AXES)
    place, step = np.array([1.4, 25.0, 0.7 if kind == 1 else 130.0]), 1e-6
    slopes = [
        (system.position(place + step * unit, 1.0) - system.position(place - step * unit, 1.0))
        for unit in np.eye(3)
    ]
    directions = np.column_stack([slope / np.linalg.norm(slope) for slope in slopes])
    np.testing.assert_allclose(system.axes_at(system.position(place, 1.0)), directions, atol=1e-7)
    assert np.linalg.det(directions) == pytest.approx(1.0)


def test_positions_follow_the_definition_system_and_the_unit_of_length(layout):
    found = layout(
        units(1000.0, 1.0),
        systems(
            system_2420(2, 0, origin=1000 * ORIGIN),
            system_2420(3, 1, np.eye(3), np.zeros(3)),
            system_2420(4, 2, np.eye(3), np.zeros(3)),
        ),
        nodes(
            node(1, (100, 200, 300), 2),
            node(2, (500, 90, 40), 3),
            node(3, (500, 90, 180), 4),
            node(4, (1, 2, 3)),
        ),
    )
    expected = [ORIGIN + AXES @ (0.1, 0.2, 0.3), (0, 0.5, 0.04), (-0.5, 0, 0), (1e-3, 2e-3, 3e-3)]
    np.testing.assert_allclose(found.positions, expected, atol=1e-12)
    (remark,) = found.remarks
    assert "positions of nodes 1, 2, 3 were converted from coordinate systems 2, 3" in remark


def test_axes_of_a_site_are_those_of_the_displacement_system(layout):
    found = layout(
        systems(system_2420(2, 0), system_2420(3, 1, np.eye(3), np.zeros(3))),
        nodes(node(1, (0, 2, 0), 1, 2), node(2, (0, 2, 0), 1, 3), node(3, (0, 0, 1), 1, 3)),
    )
    np.testing.assert_allclose(found.axes[0], AXES, atol=1e-12)
    np.testing.assert_allclose(found.axes[1], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(found.axes[2], np.eye(3), atol=1e-12)  # on the axis: azimuth 0
    (remark,) = found.remarks
    assert "at nodes 1, 2 are along the axes of coordinate systems 2, 3 (cylindrical)" in remark


def system_18(label, kind, reference, points):
    first, second = np.split(np.ravel(points), [6])
    head = "".join(f"{f:10d}" for f in (label, kind, reference, 8, 1))
    return [head, "SYS", numbers(first, "13.5E"), numbers(second, "13.5E")]


def test_a_system_of_three_points_stands_in_its_reference_system(layout):
    axes, origin = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([1.0, 2.0, 3.0])
    # Given out of order: system 7 in system 5, whose own axes are x' = y, y' = z, z' = x.
    points = [(1, 0, 0), (3, 0, 0), (2, 0, 4)]
    outer = [origin, origin + 2 * axes[:, 0], origin + axes[:, 0] + 3 * axes[:, 2]]
    found = layout(
        dataset("    18", [*system_18(7, 0, 5, points), *system_18(5, 0, 0, outer)]),
        dataset("    15", [f"{1:10d}{7:10d}{5:10d}{0:10d}" + numbers((0, 0, 2), "13.5E")]),
    )
    np.testing.assert_allclose(found.axes[0], axes, atol=1e-6)
    np.testing.assert_allclose(found.positions[0], origin + axes @ (1, 0, 2), atol=1e-6)


def test_a_reference_system_may_be_cylindrical(layout):
    points = [(2, 90, 0), (2, 180, 0), (2, 90, 1)]  # origin at y = 2; +x towards x = -2, y = 0
    found = layout(
        dataset("    18", system_18(4, 0, 2, points)),
        systems(system_2420(2, 1, np.eye(3), np.zeros(3))),
        nodes(node(1, (1, 0, 0), 4, 4)),
    )
    np.testing.assert_allclose(found.positions[0], [-np.sqrt(0.5), 2 - np.sqrt(0.5), 0], atol=1e-6)
    np.testing.assert_allclose(found.axes[0][:, 2], [0, 0, 1], atol=1e-6)


def test_a_measurement_that_turns_axes_against_its_sites_is_remarked(tmp_path):
    functions = Function(np.full(40, 1 + 1j), ref=(11, 3)).content()
    turned = systems(system_2420(5, 0)) + nodes(node(7, (1, 2, 3), 1, 5), node(11, (0, 0, 1)))
    (remark,) = [
        text
        for text in read_small(tmp_path, a_uff=turned + functions).remarks
        if "axes of their sites count" in text
    ]
    assert remark.startswith("a.uff: the file turns the axes of node 7 (coordinate system 5)")
    assert remark.endswith("] in [sensor.acc7]")
    turn = [float(x) for x in remark.partition("turn = [")[2].partition("]")[0].split(",")]
    layout = a_layout()
    drawn = layout.axes[layout.points.index("acc7")]
    np.testing.assert_allclose(Rotation.from_rotvec(turn).as_matrix() @ drawn, AXES, atol=1e-3)


def test_systems_that_the_file_does_not_define_are_named_and_world_axes_used(layout):
    flat = system_2420(9, 0, np.zeros((3, 3)))
    circular = dataset("    18", system_18(8, 0, 8, np.eye(3)))
    found = layout(
        systems(flat),
        circular,
        nodes(node(1, (1, 2, 3), 0, 7), node(2, (4, 5, 6), 9, 1), node(3, (0, 0, 0), 8, 0)),
    )
    np.testing.assert_array_equal(found.axes, np.tile(np.eye(3), (3, 1, 1)))
    np.testing.assert_array_equal(found.positions[1], [4, 5, 6])
    (remark,) = found.remarks
    assert "nodes 1, 2, 3 refer to coordinate systems 7, 9, 8, which the file does not" in remark


@pytest.mark.parametrize("label", [0, 1])
def test_absent_systems_0_and_1_are_world_axes_without_a_word(layout, label):
    found = layout(nodes(node(1, (1, 2, 3), label, label), node(2, (4, 5, 6), label, label)))
    np.testing.assert_array_equal(found.positions, [[1, 2, 3], [4, 5, 6]])
    assert not found.remarks


def test_shapes_of_nodes_are_turned_to_world_axes(tmp_path):
    kinds = "".join(f"{k:10d}" for k in (1, 2, 2, 8, 2, 3))
    values = [f"{2:10d}", numbers((1, 0, 0), "13.5E")]
    head = [*["NONE"] * 5, kinds, f"{1:10d}" * 4, numbers((12.5, 1, 0.01, 0), "13.5E")]
    path = tmp_path / "turned.unv"
    blocks = systems(system_2420(5, 0)), nodes(node(2, (1, 2, 3), 1, 5))
    path.write_bytes(b"".join(blocks) + dataset("    55", [*head, *values]))
    modes = read_uff_modes(path)
    np.testing.assert_allclose(modes.values[0, :, 0], AXES[:, 0], atol=1e-12)
    assert "at node 2 are along the axes of coordinate system 5" in modes.remarks[0]
