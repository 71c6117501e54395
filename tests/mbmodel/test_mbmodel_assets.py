"""The station's drawing: meshes have the mass that the MJCF states, sensors sit on them."""

import importlib
import re
import sys
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from mbmodel_examples import ROOT, STATION

from mbmodel import as_drawn, load_machine, modes_of_matrices
from mbmodel.meshes.files import read_mesh
from mbmodel.meshes.mass_properties import read_mass_properties
from mbmodel.meshes.surface import winding_number

HERE = ROOT / "assets" / "microstation"
LEGS = HERE / "station_legs.xml"
STAGES = ("granite_bottom", "granite_top", "ty", "tilt", "spindle", "hexapod")
# Table 2.1 of the report on the station, m; what the drawing is solved for.
CENTRES = {
    "granite_bottom": (0.045, 0.144, -1.251),
    "granite_top": (0.052, 0.258, -0.778),
    "ty": (0.0, 0.014, -0.6),
    "tilt": (0.0, -0.005, -0.628),
    "spindle": (0.0, 0.0, -0.58),
    "hexapod": (-0.004, 0.006, -0.319),
}
MASSES = (1700, 800, 550, 360, 290, 35)


@pytest.fixture(scope="module")
def maker():
    """The script that makes the station, with what it imports from its own folder."""
    before, written = sys.path[:], sys.dont_write_bytecode
    sys.path.insert(0, str(HERE))
    sys.dont_write_bytecode = True  # or a wheel that is built later would carry it
    yield importlib.import_module("make_station")
    sys.path[:], sys.dont_write_bytecode = before, written


@pytest.fixture(scope="module")
def meshes():
    return {name: read_mesh(HERE / "meshes" / f"{name}.stl") for name in STAGES}


def inertials(path):
    """Mass, centre and inertia of each body as written."""
    properties = {}
    for body in ElementTree.parse(path).iter("body"):
        element = body.find("inertial")
        xx, yy, zz, xy, xz, yz = map(float, element.get("fullinertia").split())
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        place = np.array(element.get("pos").split(), float)
        properties[body.get("name")] = float(element.get("mass")), place, inertia
    return properties


@pytest.mark.parametrize("path", [STATION, LEGS], ids=["station", "legs"])
def test_the_station_weighs_what_its_meshes_weigh(maker, path):
    written = inertials(path)
    assert tuple(written) == STAGES
    for name, (mass, centre, inertia) in written.items():
        solid = read_mass_properties(HERE / "meshes" / f"{name}.stl", maker.TARGETS[name].density)
        # Nine digits are written.
        assert mass == pytest.approx(solid.mass, rel=1e-8)
        np.testing.assert_allclose(centre, solid.centre, rtol=0, atol=1e-8)
        np.testing.assert_allclose(inertia, solid.inertia, rtol=0, atol=1e-8 * inertia.max())


def test_centres_of_mass_are_the_reports_within_a_hundredth_of_a_millimetre():
    for name, (_, centre, _) in inertials(STATION).items():
        np.testing.assert_allclose(centre, CENTRES[name], rtol=0, atol=1e-5)


def test_masses_are_those_chosen():
    masses = [mass for mass, _, _ in inertials(STATION).values()]
    np.testing.assert_allclose(masses, MASSES, rtol=2e-5)


def test_the_meshes_come_from_their_script(maker):
    for name, target in maker.TARGETS.items():
        shell = maker.together(target.shells(*maker.dimensions(target)))
        new = np.frombuffer(maker.stl_bytes(shell, name)[84:], maker.FACET)
        committed = np.frombuffer((HERE / "meshes" / f"{name}.stl").read_bytes()[84:], maker.FACET)
        # Rounded to micrometres, which another computer's arithmetic may once do the other way.
        np.testing.assert_allclose(new["corners"], committed["corners"], rtol=0, atol=1.5e-6)
        assert len(committed) <= 1500


def test_the_station_with_legs_is_in_step_with_the_station(maker, tmp_path):
    maker.write_legs(STATION.read_text(encoding="utf-8"), tmp_path / "legs.xml")
    assert (tmp_path / "legs.xml").read_text(encoding="utf-8") == LEGS.read_text(encoding="utf-8")


def _distance(point, corners):
    """Distance of a point to triangles (n, 3, 3): to their planes inside, else to their edges."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("ni,ni->n", a, normal)
    foot = height[:, None] * normal
    inside = np.ones(len(a), bool)
    best = np.full(len(a), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        inside &= np.einsum("ni,ni->n", np.cross(edge, foot - start), normal) >= 0
        along = np.clip(-np.einsum("ni,ni->n", start, edge) / (edge**2).sum(axis=1), 0, 1)
        best = np.minimum(best, np.linalg.norm(start + along[:, None] * edge, axis=1))
    return np.where(inside, np.abs(height), best).min()


def test_every_accelerometer_sits_on_its_stage(meshes):
    model = mujoco.MjModel.from_xml_path(str(STATION))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sites = [s for s in range(model.nsite) if model.site(s).name.startswith("acc")]
    assert len(sites) == 23
    for site in sites:
        mesh = meshes[model.body(model.site_bodyid[site]).name]
        assert _distance(data.site_xpos[site], mesh.points[mesh.triangles]) < 0.001


def test_stages_stand_beside_each_other(meshes):
    # Points of one stage, drawn a hair inwards, are in no other; they may touch.
    for name, mesh in meshes.items():
        for neighbour, obstacle in meshes.items():
            if name == neighbour:
                continue
            corners = obstacle.points[obstacle.triangles]
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            middles = np.vstack([mesh.points, mesh.points[mesh.triangles].mean(axis=1)])
            near = middles[((middles > low) & (middles < high)).all(axis=1)]
            winding = [winding_number(corners - point) for point in near]
            assert max(winding, default=0) < 0.75, (name, neighbour)


def test_geoms_are_for_the_eye_only():
    model = mujoco.MjModel.from_xml_path(str(STATION))
    assert model.nmesh == 6
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


def test_the_stations_first_modes_are_those_of_the_suspension(station_model):
    modes = modes_of_matrices(station_model.matrices(station_model.drawn))
    assert 10 < modes.freq_hz[0] < 15  # 11.9 Hz in the report
    assert 15 <= (modes.freq_hz < 200).sum() <= 18  # 16 in the report


@pytest.fixture(scope="module")
def legs():
    return load_machine(LEGS)


def test_six_legs_carry_the_hexapod_as_the_header_says(legs, maker):
    header = LEGS.read_text(encoding="utf-8").split("-->")[0]
    stated = dict(re.findall(r"^ +([tr][xyz]) +(\S+) \(joint", header, re.MULTILINE))
    rows = [name.startswith("hexapod_") for name in legs.coordinates]
    springs = [spring for spring in legs.springs if spring.name.startswith("leg")]
    assert len(springs) == 6
    total = sum(s.stiffness * np.outer(s.direction, s.direction) for s in springs)
    stiffness = total[np.ix_(rows, rows)]
    # A force between spindle and hexapod moves nothing but their joint, but for rounding.
    assert np.abs(total[~np.array(rows)]).max() < 1e-12 * total.max()
    # The joint's coordinates are motions about the joint: the matrix is the closed form's.
    expected = importlib.import_module("legs").stiffness_at(np.array([0, 0, -0.42]))
    np.testing.assert_allclose(stiffness, expected, rtol=0, atol=1e-5 * expected.max())
    for name, value in zip(("tx", "ty", "tz", "rx", "ry", "rz"), np.diag(stiffness), strict=True):
        assert float(stated[name]) == pytest.approx(value, rel=2e-3)
    assert stiffness[2, 2] == pytest.approx(1e8, rel=1e-4)


def test_legs_lose_as_much_as_the_hexapods_joint_does(legs):
    for spring in legs.springs:
        if spring.name.startswith("leg"):
            assert spring.damping == pytest.approx(7e-5 * spring.stiffness)
        if spring.name.startswith("hexapod"):
            assert spring.stiffness == spring.damping == 0


def test_ends_of_legs_are_no_accelerometers(legs, station):
    numbered = [point for point in legs.layout.points if point[-1].isdigit()]
    assert numbered == [*station.layout.points]
    assert sum(point.startswith("leg") for point in legs.layout.points) == 12


def test_the_station_with_legs_has_36_oscillating_modes(legs):
    model = as_drawn(legs)
    modes = modes_of_matrices(model.matrices(model.drawn))
    assert len(modes.freq_hz) == 36
    assert 10 < modes.freq_hz[0] < 15
    assert (modes.damping > 0.01).all()
