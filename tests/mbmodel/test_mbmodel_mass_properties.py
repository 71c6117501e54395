"""Mass properties of meshes against closed form, in every format."""

import meshio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_examples import (
    BOX_FACES,
    BOX_TETRAHEDRA,
    box,
    box_solid,
    l_shape,
    l_solid,
    obj_text,
    prism,
    sum_solids,
    together,
    write_as,
)
from scipy.spatial.transform import Rotation

from mbmodel.meshes.mass_properties import (
    outward_faces,
    read_mass_properties,
    surface_mass_properties,
    volume_mass_properties,
)
from mbmodel.meshes.surface import find_overlap, merge_points

DENSITY = 2800.0
SIZE, CENTRE = (0.3, 0.5, 0.7), (1.0, -2.0, 3.0)
CUBOID = box(SIZE, CENTRE)


def agree(properties, expected, *, rtol=1e-12):
    """Same mass, centre and inertia: lengths and moments relative to their largest."""
    mass, centre, inertia = expected
    assert properties.mass == pytest.approx(mass, rel=rtol)
    np.testing.assert_allclose(properties.centre, centre, rtol=0, atol=rtol * np.abs(centre).max())
    np.testing.assert_allclose(
        properties.inertia, inertia, rtol=0, atol=rtol * np.abs(inertia).max()
    )


def test_a_box_away_from_the_origin_has_its_textbook_inertia():
    agree(surface_mass_properties(*CUBOID, DENSITY), box_solid(SIZE, CENTRE, DENSITY))


def test_a_kilometre_away_no_digits_of_the_inertia_are_lost():
    # Coordinates of 1000 m are rounded to 1e-13 m, that is 4e-13 of the smallest side.
    far = box(SIZE, (1000.0, 0, 0))
    agree(
        surface_mass_properties(*far, DENSITY), box_solid(SIZE, (1000.0, 0, 0), DENSITY), rtol=3e-12
    )


def test_a_turned_box_has_its_inertia_turned():
    turn = Rotation.from_euler("zyx", [0.3, -0.7, 1.1]).as_matrix()
    mass, centre, inertia = box_solid(SIZE, CENTRE, DENSITY)
    points, triangles = CUBOID
    turned = surface_mass_properties(points @ turn.T, triangles, DENSITY)
    agree(turned, (mass, turn @ centre, turn @ inertia @ turn.T))


def test_a_tetrahedron_on_the_axes_has_its_closed_form():
    # Volume abc/6; int x^2 = a^2 V/10, int xy = ab V/20 about the corner.
    a, b, c = 0.2, 0.3, 0.5
    points = np.array([[0, 0, 0], [a, 0, 0], [0, b, 0], [0, 0, c]])
    mass = DENSITY * a * b * c / 6
    second = mass / 20 * np.array([[2 * a * a, a * b, a * c], [a * b, 2 * b * b, b * c],
                                   [a * c, b * c, 2 * c * c]])  # fmt: skip
    centre = np.array([a, b, c]) / 4
    second -= mass * np.outer(centre, centre)
    expected = mass, centre, np.trace(second) * np.eye(3) - second
    agree(
        surface_mass_properties(points, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], DENSITY),
        expected,
    )
    agree(volume_mass_properties(points, [[0, 1, 2, 3]], DENSITY), expected)


def test_a_polygonal_cylinder_has_its_closed_form():
    # Regular n-gon of circumradius r: area n r^2 sin(2 pi/n) / 2, about its axis
    # m r^2 (2 + cos(2 pi/n)) / 6, which is twice that about a diameter.
    n, r, h = 17, 0.2, 0.4
    angle = 2 * np.pi * np.arange(n) / n
    fan = [[0, k, k + 1] for k in range(1, n - 1)]
    points, triangles = prism(r * np.c_[np.cos(angle), np.sin(angle)], h, fan)
    mass = DENSITY * h * n * r**2 * np.sin(2 * np.pi / n) / 2
    axial = mass * r**2 * (2 + np.cos(2 * np.pi / n)) / 6
    across = axial / 2 + mass * h**2 / 12
    expected = mass, np.array([0, 0, h / 2]), np.diag([across, across, axial])
    agree(surface_mass_properties(points, triangles, DENSITY), expected)


def test_a_shape_that_is_not_convex_is_the_sum_of_its_boxes():
    agree(surface_mass_properties(*l_shape(), DENSITY), l_solid(DENSITY))


def test_a_shell_turned_inward_inside_another_is_a_cavity():
    points, triangles = box((0.1, 0.2, 0.1), (1.05, -2.1, 3.0))
    hollow = together(CUBOID, (points, triangles[:, ::-1]))
    hole = box_solid((0.1, 0.2, 0.1), (1.05, -2.1, 3.0), -DENSITY)
    agree(
        surface_mass_properties(*hollow, DENSITY),
        sum_solids(box_solid(SIZE, CENTRE, DENSITY), hole),
    )


def test_two_bodies_in_one_file_are_summed():
    second = box((0.2, 0.2, 0.2), (2.0, 0, 0))
    expected = sum_solids(
        box_solid(SIZE, CENTRE, DENSITY), box_solid((0.2, 0.2, 0.2), (2.0, 0, 0), DENSITY)
    )
    agree(surface_mass_properties(*together(CUBOID, second), DENSITY), expected)


@pytest.mark.parametrize("where", [(0.3, 0, 0), (0.3, 0.5, 0), (0.3, 0.5, 0.7)])
def test_shells_that_share_a_face_an_edge_or_a_corner_are_summed(where):
    # With points merged, an edge then belongs to four faces.
    second_centre = np.add(CENTRE, where)
    expected = sum_solids(box_solid(SIZE, CENTRE, DENSITY), box_solid(SIZE, second_centre, DENSITY))
    agree(surface_mass_properties(*together(CUBOID, box(SIZE, second_centre)), DENSITY), expected)


def test_a_body_inside_a_cavity_counts():
    points, triangles = box((0.2, 0.2, 0.2), CENTRE)
    nested = together(CUBOID, (points, triangles[:, ::-1]), box((0.1, 0.1, 0.1), CENTRE))
    expected = sum_solids(
        box_solid(SIZE, CENTRE, DENSITY),
        box_solid((0.2, 0.2, 0.2), CENTRE, -DENSITY),
        box_solid((0.1, 0.1, 0.1), CENTRE, DENSITY),
    )
    agree(surface_mass_properties(*nested, DENSITY), expected)


@given(
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    shift=st.tuples(*[st.floats(-5, 5)] * 3),
    order=st.permutations(range(20)),
)
def test_turning_shifting_and_relabelling_only_turn_and_shift_the_result(turn, shift, order):
    points, triangles = l_shape()
    matrix = Rotation.from_rotvec(turn).as_matrix()
    moved = surface_mass_properties(points @ matrix.T + shift, triangles[list(order)], DENSITY)
    mass, centre, inertia = l_solid(DENSITY)
    # A shift of 5 m rounds coordinates to 1e-15 m.
    assert moved.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(moved.centre, matrix @ centre + shift, atol=1e-13)
    np.testing.assert_allclose(moved.inertia, matrix @ inertia @ matrix.T, rtol=0, atol=1e-11)


def test_tetrahedra_and_their_boundary_enclose_the_same():
    points, _ = CUBOID
    agree(volume_mass_properties(points, BOX_TETRAHEDRA, DENSITY), box_solid(SIZE, CENTRE, DENSITY))
    boundary = outward_faces(BOX_TETRAHEDRA)
    assert len(boundary) == 12
    agree(surface_mass_properties(points, boundary, DENSITY), box_solid(SIZE, CENTRE, DENSITY))


FORMATS = [
    "stl",
    "stl text",
    "stl solid",
    "obj",
    "msh gmsh",
    "msh gmsh binary",
    "msh gmsh22",
    "vtu",
]


@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_gives_the_same_body(tmp_path, kind):
    points, triangles = l_shape()
    path = write_as(tmp_path, kind, points, {"triangle": triangles})
    # Binary STL holds single precision.
    rtol = 2e-7 if kind in ("stl", "stl solid") else 1e-12
    agree(read_mass_properties(path, DENSITY), l_solid(DENSITY), rtol=rtol)


@pytest.mark.parametrize("kind", ["msh gmsh22", "vtu"])
def test_a_volume_mesh_is_summed_over_its_cells_only(tmp_path, kind):
    points, triangles = CUBOID
    cells = {"tetra": BOX_TETRAHEDRA, "triangle": triangles[:3], "line": np.array([[0, 1]])}
    path = write_as(tmp_path, kind, points, cells)
    agree(read_mass_properties(path, DENSITY), box_solid(SIZE, CENTRE, DENSITY))


def test_quadrilaterals_and_polygons_are_divided(tmp_path):
    points, _ = l_shape()
    floor = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11]]
    walls = [[k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6] for k in range(6)]
    path = tmp_path / "l.obj"
    path.write_text(obj_text(points, [*floor, *walls]), encoding="utf-8")
    agree(read_mass_properties(path, DENSITY), l_solid(DENSITY))


def test_hexahedra_wedges_and_pyramids_are_divided(tmp_path):
    # A box of a hexahedron, two wedges and five others: six pyramids about the middle of a third.
    points = np.array([[x, y, z] for x in (0, 1, 2, 3) for z in (0, 1) for y in (0, 1)], float)
    points = np.vstack([points, [2.5, 0.5, 0.5]])

    def brick(k):
        a = 4 * k
        return [a, a + 4, a + 5, a + 1, a + 2, a + 6, a + 7, a + 3]

    second, third = brick(1), brick(2)
    wedges = [[second[k] for k in (0, 1, 2, 4, 5, 6)], [second[k] for k in (0, 2, 3, 4, 6, 7)]]
    outward = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    pyramids = [[*(third[k] for k in side[::-1]), 16] for side in outward]
    cells = {"hexahedron": [brick(0)], "wedge": wedges, "pyramid": pyramids}
    path = tmp_path / "bricks.vtu"
    meshio.Mesh(points * 0.1, {k: np.array(v) for k, v in cells.items()}).write(path)
    expected = box_solid((0.3, 0.1, 0.1), (0.15, 0.05, 0.05), DENSITY)
    agree(read_mass_properties(path, DENSITY), expected)


def test_neighbours_agree_on_a_face_that_is_not_plane(tmp_path):
    # Two hexahedra in a bent pile: whatever the middle face does, the whole keeps its volume.
    points, _ = box((2, 1, 1), (1, 0.5, 0.5))
    middle = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]], float)
    middle[:, 0] += [0.2, -0.1, 0.3, -0.2]
    everything = np.vstack([points, middle])
    cells = np.array([[0, 8, 9, 3, 4, 11, 10, 7], [8, 1, 2, 9, 11, 5, 6, 10]])
    path = tmp_path / "bent.vtu"
    meshio.Mesh(everything, {"hexahedron": cells}).write(path)
    agree(read_mass_properties(path, DENSITY), box_solid((2, 1, 1), (1, 0.5, 0.5), DENSITY))


def test_a_file_in_millimetres_is_scaled(tmp_path):
    points, triangles = l_shape()
    path = write_as(tmp_path, "vtu", 1000 * points, {"triangle": triangles})
    agree(read_mass_properties(path, DENSITY, scale=0.001), l_solid(DENSITY))


def test_corners_that_differ_by_rounding_are_one_point():
    # Each triangle with corners of its own, each rounded to single precision on its own way.
    points, triangles = l_shape()
    corners = points[triangles].reshape(-1, 3)
    noise = np.random.default_rng(2).choice([-1, 0, 1], corners.shape) * 4e-8
    corner_numbers = np.arange(len(corners)).reshape(-1, 3)
    agree(
        surface_mass_properties(corners * (1 + noise), corner_numbers, DENSITY),
        l_solid(DENSITY),
        rtol=1e-6,
    )


def test_the_boxes_of_these_tests_are_turned_outward():
    corners = CUBOID[0][BOX_FACES] - np.array(CENTRE)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", normals, corners[:, 0]) > 0).all()


@pytest.mark.parametrize(
    ("shapes", "overlap"),
    [
        ((box((1, 1, 1)), box((1, 1, 1), (0.6, 0, 0))), True),  # faces in common planes
        ((box((4, 0.3, 0.3)), box((0.3, 4, 0.25), (0.1, 0.2, 0.01))), True),  # no corner inside
        ((box((1, 1, 1)), box((1, 1, 1), (1.0, 0, 0))), False),  # they touch
        ((box((1, 1, 1)), box((1, 1, 1), (1.4, 0.2, 0.1))), False),
        ((box((1, 1, 1)),), False),
    ],
    ids=["in common planes", "crossing bars", "touching", "apart", "single"],
)
def test_shells_that_overlap_in_part_are_found(shapes, overlap):
    place = find_overlap(*merge_points(*together(*shapes)))
    assert (place is not None) == overlap
    if overlap:
        assert all(
            (np.abs(place - points.mean(axis=0)) < np.ptp(points, axis=0) / 2).all()
            for points, _ in shapes
        )


def test_a_cavity_is_no_overlap():
    points, faces = box((0.5, 0.5, 0.5))
    hollow = together(box((1, 1, 1)), (points, faces[:, ::-1]))
    assert find_overlap(*hollow) is None
