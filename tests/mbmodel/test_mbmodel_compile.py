"""Meshes in an MJCF: mass by what they enclose, whatever the format; refusals by name."""

import itertools
import struct

import meshio
import mujoco
import numpy as np
import pytest
from mesh_examples import BOX_TETRAHEDRA, box, l_shape, l_solid, obj_text, stl_text, together
from scipy.spatial.transform import Rotation

from identification.words import InputError
from mbmodel import load_machine
from mbmodel.meshes.mass_properties import read_mass_properties
from mbmodel.mjcf.read import compile_mjcf

DENSITY = 2700.0
PLACE, TURN = np.array([0.1, -0.3, 0.2]), Rotation.from_euler("XYZ", [0.4, -0.2, 0.7])
# MuJoCo holds vertices in single precision: 6e-8 of a coordinate of some decimetres.
SINGLE = 5e-7


def l_file(folder, kind):
    """The L of the examples as a file of a format."""
    points, triangles = l_shape()
    path = folder / f"shape.{kind.split()[0]}"
    if kind == "stl text":
        path.write_text(stl_text(points, triangles), encoding="utf-8")
    elif kind == "obj":
        path.write_text(obj_text(points, triangles), encoding="utf-8")
    elif kind == "msh own":
        path.write_bytes(mujocos_msh(points, triangles))
    elif kind == "msh":
        meshio.Mesh(points, {"triangle": triangles}).write(path, file_format="gmsh")
    else:
        meshio.Mesh(points, {"triangle": triangles}).write(path, binary=True)
    return path


def mujocos_msh(points, triangles):
    head = struct.pack("<4i", len(points), 0, 0, len(triangles))
    return head + points.astype("<f4").tobytes() + triangles.astype("<i4").tobytes()


def machine_text(
    *, mesh='file="shape.stl"', geom="", inertial="", compiler="", joint="<joint/>", more=""
):
    """One body with one mesh geom, turned and shifted."""
    quat = " ".join(f"{x:.17g}" for x in TURN.as_quat(scalar_first=True))
    place = " ".join(map(str, PLACE))
    return (
        f'<mujoco><compiler angle="radian" {compiler}/><option gravity="0 0 0"/>'
        f'<asset><mesh name="shape" {mesh}/></asset><worldbody><body name="a" pos="1 0 0">'
        f'{inertial}{joint}<geom type="mesh" mesh="shape" pos="{place}" quat="{quat}" '
        f'density="{DENSITY}" {geom}/>{more}</body></worldbody></mujoco>'
    )


def load(folder, **changes):
    path = folder / "machine.xml"
    path.write_text(machine_text(**changes), encoding="utf-8")
    return load_machine(path)


def place_and_turn(mass, centre, inertia):
    """A body's properties where the geom stands."""
    turn = TURN.as_matrix()
    return mass, turn @ centre + PLACE + [1, 0, 0], turn @ inertia @ turn.T


def agree(machine, expected, *, rtol=SINGLE):
    mass, centre, inertia = expected
    assert machine.body_mass[0, 0] == pytest.approx(mass, rel=rtol)
    np.testing.assert_allclose(machine.layout.centres[0], centre, rtol=0, atol=rtol)
    scale = np.abs(inertia).max()
    np.testing.assert_allclose(machine.body_mass[3:, 3:], inertia, rtol=0, atol=rtol * scale)


@pytest.mark.parametrize("kind", ["stl", "stl text", "obj", "msh", "vtu"])
def test_a_body_weighs_what_its_mesh_encloses_in_every_format(tmp_path, kind):
    path = l_file(tmp_path, kind)
    solid = read_mass_properties(path, DENSITY)
    machine = load(tmp_path, mesh=f'file="{path.name}"')
    agree(machine, place_and_turn(solid.mass, solid.centre, solid.inertia))
    agree(machine, place_and_turn(*l_solid(DENSITY)))


def test_mujocos_own_msh_is_summed_exactly_too(tmp_path):
    l_file(tmp_path, "msh own")
    agree(load(tmp_path, mesh='file="shape.msh"'), place_and_turn(*l_solid(DENSITY)))


def test_mujocos_default_would_have_been_wrong(tmp_path):
    # What makes this file necessary.
    l_file(tmp_path, "stl")
    path = tmp_path / "machine.xml"
    path.write_text(machine_text(), encoding="utf-8")
    mass = mujoco.MjModel.from_xml_path(str(path)).body_mass[1]
    assert mass > 1.01 * l_solid(DENSITY)[0]
    (remark,) = load_machine(path).remarks
    assert "kg, the exact volume of its meshes" in remark
    assert f"default gives {mass:.4g} kg" in remark
    assert load(tmp_path, mesh='file="shape.stl" inertia="exact"').remarks == ()


def test_the_authors_word_legacy_stays(tmp_path):
    l_file(tmp_path, "stl")
    machine = load(tmp_path, mesh='file="shape.stl" inertia="legacy"')
    alone = mujoco.MjModel.from_xml_path(str(tmp_path / "machine.xml"))
    assert machine.body_mass[0, 0] == pytest.approx(alone.body_mass[1], rel=SINGLE)


def test_parts_that_overlap_are_doubted(tmp_path):
    write_stl(tmp_path / "shape.stl", *together(box((1, 1, 1)), box((1, 1, 1), (0.6, 0, 0))))
    remarks = load(tmp_path).remarks
    assert any("two of its parts overlap near" in remark for remark in remarks)


def test_the_tetrahedra_of_a_volume_mesh_give_mass_and_their_surface_is_seen(tmp_path):
    points, _ = box((0.2, 0.3, 0.4), (0.1, 0, 0))
    meshio.Mesh(points, {"tetra": BOX_TETRAHEDRA}).write(tmp_path / "shape.vtu")
    solid = read_mass_properties(tmp_path / "shape.vtu", DENSITY)
    machine = load(tmp_path, mesh='file="shape.vtu"')
    agree(machine, place_and_turn(solid.mass, solid.centre, solid.inertia))
    assert compile_mjcf(tmp_path / "machine.xml").mesh_facenum.tolist() == [12]


def test_vertices_written_in_the_mjcf_are_summed_exactly_too(tmp_path):
    points, triangles = l_shape()
    vertex = " ".join(f"{x:.17g}" for x in points.ravel())
    face = " ".join(map(str, triangles.ravel()))
    agree(
        load(tmp_path, mesh=f'vertex="{vertex}" face="{face}"'), place_and_turn(*l_solid(DENSITY))
    )


def test_scale_stretches_and_mirrors_the_solid(tmp_path):
    l_file(tmp_path, "vtu")
    points, triangles = l_shape()
    factor = np.array([-2.0, 1.0, 0.5])
    mirrored = tmp_path / "mirrored.vtu"
    meshio.Mesh(points * factor, {"triangle": triangles[:, ::-1]}).write(mirrored)
    solid = read_mass_properties(mirrored, DENSITY)
    machine = load(tmp_path, mesh='file="shape.vtu" scale="-2 1 0.5"')
    agree(machine, place_and_turn(solid.mass, solid.centre, solid.inertia), rtol=2 * SINGLE)


def test_a_reference_frame_of_the_mesh_moves_the_solid(tmp_path):
    # Vertices x become R'(x - p) in the geom's frame.
    l_file(tmp_path, "vtu")
    mass, centre, inertia = l_solid(DENSITY)
    turn = Rotation.from_quat([0.2, 0.4, -0.1, 0.8]).as_matrix().T
    expected = mass, turn @ (centre - [0.3, 0.1, -0.2]), turn @ inertia @ turn.T
    frame = 'refpos="0.3 0.1 -0.2" refquat="0.8 0.2 0.4 -0.1"'
    agree(load(tmp_path, mesh=f'file="shape.vtu" {frame}'), place_and_turn(*expected))


def test_a_mass_instead_of_a_density_spreads_over_the_solid(tmp_path):
    l_file(tmp_path, "obj")
    mass, centre, inertia = l_solid(DENSITY)
    expected = place_and_turn(12.0, centre, inertia * 12 / mass)
    agree(load(tmp_path, mesh='file="shape.obj"', geom='mass="12"'), expected)


def test_meshes_are_found_in_their_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    l_file(tmp_path / "parts", "vtu")
    machine = load(tmp_path, mesh='file="shape.vtu"', compiler='meshdir="parts"')
    agree(machine, place_and_turn(*l_solid(DENSITY)))


def write_stl(path, points, triangles):
    meshio.Mesh(points, {"triangle": triangles}).write(path, binary=True)


INERTIAL = '<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>'
FOR_THE_EYE = {
    "an inertial counts": {"inertial": INERTIAL},
    "no density": {"geom": 'mass="0"', "more": '<geom size="0.1"/>'},
    "a group that gives no mass": {
        "geom": 'group="2"', "compiler": 'inertiagrouprange="0 1"', "more": '<geom size="0.1"/>',
    },
    "inertials only": {"inertial": INERTIAL, "compiler": 'inertiafromgeom="false"'},
}  # fmt: skip


@pytest.mark.parametrize("case", FOR_THE_EYE)
@pytest.mark.parametrize("fault", ["open", "inside out", "open and of another format"])
def test_a_mesh_for_the_eye_is_not_checked(tmp_path, case, fault):
    points, triangles = l_shape()
    wrong = triangles[:, ::-1] if fault == "inside out" else triangles[3:]
    name = "shape.vtu" if "format" in fault else "shape.stl"
    meshio.Mesh(points, {"triangle": wrong}).write(tmp_path / name, binary=True)
    machine = load(tmp_path, mesh=f'file="{name}"', **FOR_THE_EYE[case])
    expected = 3 if "inertial" in FOR_THE_EYE[case] else DENSITY
    assert machine.body_mass[0, 0] in (pytest.approx(expected), pytest.approx(4.18879, rel=1e-4))


def test_a_mesh_on_what_cannot_move_is_not_checked(tmp_path):
    points, triangles = l_shape()
    write_stl(tmp_path / "shape.stl", points, triangles[1:])
    child = f'<body name="b">{INERTIAL}<joint/></body>'
    assert load(tmp_path, joint="", more=child).layout.bodies == ("b",)


def test_an_inertial_that_does_not_count_is_no_excuse(tmp_path):
    points, triangles = l_shape()
    write_stl(tmp_path / "shape.stl", points, triangles[1:])
    with pytest.raises(InputError, match="one face only"):
        load(tmp_path, inertial=INERTIAL, compiler='inertiafromgeom="true"')


def test_a_mesh_on_a_welded_child_is_checked(tmp_path):
    points, triangles = l_shape()
    write_stl(tmp_path / "shape.stl", points, triangles[1:])
    child = '<body name="b"><geom type="mesh" mesh="shape"/></body>'
    with pytest.raises(InputError, match="mesh 'shape'"):
        load(tmp_path, inertial=INERTIAL, more=child)


def test_the_authors_word_convex_stays(tmp_path):
    l_file(tmp_path, "stl")
    machine = load(tmp_path, mesh='file="shape.stl" inertia="convex"')
    # The outline's hull lacks the corner beyond (0.7, 0.2) - (0.25, 0.5): 0.35 - 0.135 / 2.
    assert machine.body_mass[0, 0] == pytest.approx(DENSITY * 0.3 * (0.35 - 0.0675), rel=SINGLE)


SHAPE = l_shape()
REFUSED = {
    "open": (SHAPE[0], SHAPE[1][1:], "belong to one face only"),
    "inside out": (SHAPE[0], SHAPE[1][:, ::-1], "inside out"),
    "a turned face": (
        SHAPE[0], np.vstack([SHAPE[1][:1, ::-1], SHAPE[1][1:]]), "turned against each other",
    ),
    "a part inside out": (
        *together(SHAPE, (SHAPE[0] / 2 + 2, SHAPE[1][:, ::-1])),
        "is inside out: reverse the faces of that part",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("suffix", ["stl", "vtu", "msh", "inline"])
def test_a_mesh_that_is_no_solid_is_refused_by_name(tmp_path, case, suffix):
    points, triangles, words = REFUSED[case]
    if suffix == "inline":
        vertex = " ".join(map(str, points.ravel()))
        mesh = f'vertex="{vertex}" face="{" ".join(map(str, triangles.ravel()))}"'
    else:
        mesh, path = f'file="shape.{suffix}"', tmp_path / f"shape.{suffix}"
        kind = {"stl": "stl", "vtu": "vtu", "msh": "gmsh"}[suffix]
        meshio.Mesh(points, {"triangle": triangles}).write(path, file_format=kind, binary=True)
    with pytest.raises(InputError) as caught:
        load(tmp_path, mesh=mesh)
    for word in (str(tmp_path / "machine.xml"), "mesh 'shape'", words):
        assert word in str(caught.value)


def test_an_open_mesh_in_mujocos_own_format_is_refused(tmp_path):
    points, triangles = l_shape()
    (tmp_path / "shape.msh").write_bytes(mujocos_msh(points, triangles[1:]))
    with pytest.raises(InputError, match="mesh 'shape': the surface does not bound a solid"):
        load(tmp_path, mesh='file="shape.msh"')


@pytest.mark.parametrize("suffix", ["stl", "vtu", "msh", "obj"])
@pytest.mark.parametrize("content", [b"", b"hello\n", None])
def test_a_mesh_file_that_cannot_be_read_is_refused(tmp_path, suffix, content):
    if content is not None:
        (tmp_path / f"shape.{suffix}").write_bytes(content)
    with pytest.raises(InputError, match=rf"shape\.{suffix}|mesh 'shape'"):
        load(tmp_path, mesh=f'file="shape.{suffix}"')


def test_bodies_that_share_a_mesh_each_have_its_mass(tmp_path):
    l_file(tmp_path, "vtu")
    child = '<body name="b"><joint/><geom type="mesh" mesh="shape" density="2700"/></body>'
    machine = load(tmp_path, mesh='file="shape.vtu"', more=child)
    masses = np.diag(machine.body_mass)[::6]
    np.testing.assert_allclose(masses, l_solid(DENSITY)[0], rtol=SINGLE)


def test_every_turn_of_the_faces_triangles_is_the_same_shape(tmp_path):
    # The order of triangles and of corners within them is the exporter's affair.
    points, triangles = l_shape()
    turned = [np.roll(t, k) for t, k in zip(triangles[::-1], itertools.cycle(range(3)))]
    write_stl(tmp_path / "shape.stl", points, np.array(turned))
    agree(load(tmp_path), place_and_turn(*l_solid(DENSITY)))
