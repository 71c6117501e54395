"""Surfaces and lines of a machine, against where MuJoCo has its geoms."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from mbmodel import load_machine
from mbmodel.geometry.primitives import box, capsule, cylinder
from mbmodel.geometry.surfaces import machine_geometry, sharp_edges, simplify_mesh

MJCF = """
<mujoco>
  <compiler angle="degree"/>
  <option gravity="0 0 -9.81"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <asset><material name="paint" rgba="0.1 0.2 0.3 1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 0.1"/>
    <geom name="foot" type="cylinder" size="0.1 0.2" rgba="0.5 0.6 0.7 1"/>
    <body name="table" pos="0.3 0.2 0.9" euler="10 20 30">
      <joint name="table_tz" type="slide" axis="0 0 1" stiffness="2e3"/>
      <geom name="top" type="box" pos="0.1 0 0.2" euler="5 0 40" size="0.3 0.2 0.05" mass="20"
        rgba="0.9 0.1 0.2 1"/>
      <geom name="unseen" type="box" size="1 1 1" mass="0" group="3"/>
      <body name="bracket" pos="0 0 0.4" euler="0 45 0">
        <geom name="ball" type="ellipsoid" size="0.1 0.2 0.3" mass="2" material="paint"/>
        <site name="hook" pos="0.05 0 0"/>
      </body>
      <body name="bare" pos="0.5 0 0">
        <joint name="bare_ty" type="slide" axis="0 1 0" stiffness="1e4"/>
        <inertial pos="0 0 0.1" mass="3" diaginertia="0.1 0.1 0.1"/>
        <site name="eye"/>
      </body>
    </body>
    <site name="anchor" pos="1 1 1"/>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="10" springlength="0.1" rgba="0 1 0 1">
      <site site="anchor"/><site site="hook"/><site site="eye"/>
    </spatial>
  </tendon>
</mujoco>
"""


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("looks") / "looks.xml"
    path.write_text(MJCF, encoding="utf-8")
    return load_machine(path)


@pytest.fixture(scope="module")
def geometry(machine):
    return machine_geometry(machine)


@pytest.fixture(scope="module")
def settled_data(machine):
    """MuJoCo's own account of the same machine, let down by hand to where it rests."""
    model = mujoco.MjModel.from_xml_path(str(machine.source))
    model.opt.timestep = 1e-3
    model.dof_damping[:] = 50.0
    data = mujoco.MjData(model)
    for _ in range(40_000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return model, data


def by_colour(geometry, colour):
    (surface,) = [s for s in geometry.surfaces if s.colour == pytest.approx(colour)]
    return surface


def test_the_corners_of_a_box_lie_where_mujoco_has_them_at_rest(geometry, settled_data):
    model, data = settled_data
    geom = model.geom("top").id
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    axes = data.geom_xmat[geom].reshape(3, 3)
    corners = data.geom_xpos[geom] + (signs * model.geom_size[geom]) @ axes.T
    vertices = by_colour(geometry, (0.9, 0.1, 0.2, 1)).vertices
    assert np.sort(vertices, axis=0) == pytest.approx(np.sort(corners, axis=0), abs=1e-6)
    assert abs(data.qpos[0]) > 0.05  # it sags, so that the drawn place would be seen to differ


def test_a_welded_body_moves_with_the_stage_that_carries_it(geometry):
    assert by_colour(geometry, (0.1, 0.2, 0.3, 1)).stage == "table"


def test_what_stands_on_the_world_has_no_stage(geometry):
    assert by_colour(geometry, (0.5, 0.6, 0.7, 1)).stage is None


def test_planes_and_hidden_groups_are_left_out(geometry):
    # foot, top, ball, and the box of the bare stage
    assert len(geometry.surfaces) == 4


def test_a_stage_without_geom_gets_a_box_at_its_centre_of_mass(machine, geometry):
    assert geometry.boxed == ("bare",)
    (placeholder,) = [s for s in geometry.surfaces if s.stage == "bare"]
    centre = machine.layout.centres[machine.layout.bodies.index("bare")]
    assert placeholder.vertices.mean(axis=0) == pytest.approx(centre)


def test_a_tendon_runs_through_its_sites_each_with_its_own_stage(geometry, settled_data):
    model, data = settled_data
    (line,) = geometry.lines
    assert line.stages == (None, "table", "bare")
    sites = [data.site_xpos[model.site(name).id] for name in ("anchor", "hook", "eye")]
    assert line.points == pytest.approx(np.array(sites), abs=1e-6)


def test_every_vertex_of_an_ellipsoid_lies_on_it(geometry, settled_data):
    model, data = settled_data
    geom = model.geom("ball").id
    vertices = by_colour(geometry, (0.1, 0.2, 0.3, 1)).vertices
    inside = (vertices - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    assert ((inside / model.geom_size[geom]) ** 2).sum(axis=1) == pytest.approx(1.0, abs=1e-5)


SHAPES = {
    "box": (box(np.array([0.1, 0.2, 0.3])), 8 * 0.006, 1e-12),
    "cylinder": (cylinder(0.2, 0.5), np.pi * 0.04, 0.01),
    "ball": (capsule(np.full(3, 0.2), 0.0), 4 / 3 * np.pi * 0.008, 0.03),
    "capsule": (capsule(np.full(3, 0.2), 0.4), 4 / 3 * np.pi * 0.008 + np.pi * 0.04 * 0.8, 0.02),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_surface_is_closed(name):
    (_, triangles), _, _ = SHAPES[name]
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    there = {tuple(side) for side in sides}
    assert len(there) == len(sides)
    assert {(b, a) for a, b in there} == there  # each edge once in each direction


@pytest.mark.parametrize("name", SHAPES)
def test_a_surface_encloses_its_volume_and_faces_outwards(name):
    (vertices, triangles), volume, tolerance = SHAPES[name]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    enclosed = (a * np.cross(b, c)).sum() / 6  # positive only if it faces outwards
    assert enclosed == pytest.approx(volume, rel=tolerance)


def test_a_box_has_twelve_sharp_edges():
    assert len(sharp_edges(*box(np.ones(3)))) == 12


def test_a_ball_is_outlined_by_its_great_circles():
    vertices, triangles = capsule(np.ones(3), 0.0)
    edges = sharp_edges(vertices, triangles)
    ends = vertices[edges]
    assert (np.abs(ends).max(axis=1) < 1e-9).any(axis=1).all()
    assert 0 < len(edges) < len(triangles) / 5


def test_a_mesh_of_many_triangles_is_made_smaller_and_keeps_its_size():
    vertices, triangles = capsule(np.ones(3), 0.0)
    fewer_points, fewer = simplify_mesh(vertices, triangles, limit=300)
    assert 50 < len(fewer) <= 300
    assert np.ptp(fewer_points, axis=0) == pytest.approx([2, 2, 2], rel=0.15)


def test_the_legs_of_the_station_join_spindle_and_hexapod():
    path = Path(__file__).resolve().parents[2] / "assets" / "microstation" / "station_legs.xml"
    geometry = machine_geometry(load_machine(path))
    assert [line.stages for line in geometry.lines] == 6 * [("spindle", "hexapod")]
