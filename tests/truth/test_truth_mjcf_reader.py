"""The reader takes what it can honour, and refuses the rest by name."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from truth.errors import TruthError
from truth.machine.mjcf_reader import read_station
from truth.machine.station import GROUND

GOOD = """
<mujoco model="small">
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0" mass="0" rgba="1 0 0 1"/></default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="base" pos="1 2 3">
      <inertial pos="0.1 0 0" mass="10" fullinertia="1 1.1 1.2 0.1 0.2 0.3"/>
      <joint name="base_tz" type="slide" axis="0 0 2" pos="0 0 0.5" stiffness="1e6" damping="10"/>
      <geom type="box" size="1 1 1" euler="0 0 0.5"/>
      <geom type="capsule" size="0.1" fromto="0 0 0 0 0 1"/>
      <site name="acc7" pos="0 0 1"/>
      <site name="hit7" pos="0 1 0"/>
      <site name="focus" pos="0 0 0"/>
      <body name="top" pos="10 0 0">
        <inertial mass="5" diaginertia="1 1 1"/>
        <joint name="top_rx" axis="1 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def read(text, tmp_path):
    (tmp_path / "model.xml").write_text(text)
    return read_station(tmp_path / "model.xml")


def test_positions_are_counted_from_the_world(tmp_path):
    station = read(GOOD, tmp_path)
    base, top = station.stages
    assert (base.parent, top.parent) == (GROUND, 0)
    np.testing.assert_allclose(base.com, [1.1, 2, 3])
    np.testing.assert_allclose(base.joints[0].position, [1, 2, 3.5])
    np.testing.assert_allclose(base.joints[0].axis, [0, 0, 1])
    np.testing.assert_allclose(base.sensors[0].position, [1, 2, 4])
    np.testing.assert_allclose(base.hit_points[0].position, [1, 3, 3])
    np.testing.assert_allclose(top.com, [11, 2, 3])
    np.testing.assert_allclose(top.joints[0].position, [11, 2, 3])
    assert top.joints[0].stiffness == 0


def test_inertia_is_read_in_the_order_of_mjcf(tmp_path):
    expected = [[1, 0.1, 0.2], [0.1, 1.1, 0.3], [0.2, 0.3, 1.2]]
    np.testing.assert_array_equal(read(GOOD, tmp_path).stages[0].inertia, expected)


def test_shapes_are_carried_over_with_their_defaults(tmp_path):
    box, capsule = (dict(shape.attributes) for shape in read(GOOD, tmp_path).stages[0].shapes)
    assert box["rgba"] == "1 0 0 1"
    assert box["mass"] == "0"
    assert box["pos"] == "1 2 3"
    assert box["euler"] == "0 0 0.5"
    assert capsule["fromto"] == "1 2 3 1 2 4"


def test_mesh_files_are_read_from_their_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "case.stl").write_bytes(b"facets")
    (tmp_path / "parts" / "lid.obj").write_bytes(b"faces")
    asset = (
        '<asset><mesh file="case.stl" scale="2 2 2"/><mesh name="top" file="lid.obj"/>'
        '<texture type="skybox" builtin="flat"/></asset><worldbody>'
    )
    text = GOOD.replace('angle="radian"', 'angle="radian" meshdir="parts"')
    text = text.replace("<worldbody>", asset).replace(
        'type="box" size="1 1 1"', 'type="mesh" mesh="case"'
    )
    case, lid = read(text, tmp_path).meshes
    assert (case.name, case.file, case.content) == ("case", "case.stl", b"facets")
    assert case.attributes == (("scale", "2 2 2"),)
    assert (lid.name, lid.file, lid.content) == ("top", "top.obj", b"faces")
    shape = dict(read(text, tmp_path).stages[0].shapes[0].attributes)
    assert (shape["mesh"], shape["pos"], shape["mass"]) == ("case", "1 2 3", "0")


def test_a_mesh_with_mass_is_refused(tmp_path):
    (tmp_path / "case.stl").write_bytes(b"facets")
    text = GOOD.replace("<worldbody>", '<asset><mesh file="case.stl"/></asset><worldbody>')
    text = text.replace('type="box" size="1 1 1"', 'type="mesh" mesh="case" mass="1"')
    with pytest.raises(TruthError, match='must have mass="0"'):
        read(text, tmp_path)


def test_a_mesh_is_named_once(tmp_path):
    (tmp_path / "case.stl").write_bytes(b"facets")
    two = '<asset><mesh file="case.stl"/><mesh file="case.stl"/></asset><worldbody>'
    with pytest.raises(TruthError, match="mesh case: the name is given twice"):
        read(GOOD.replace("<worldbody>", two), tmp_path)


def test_the_nominal_station_is_read_whole(nominal):
    assert [stage.name for stage in nominal.stages][::5] == ["granite_bottom", "hexapod"]
    assert all(len(stage.joints) == 6 for stage in nominal.stages)
    assert sorted(sensor.node for _, sensor in nominal.sensors()) == list(range(1, 24))
    assert [mesh.name for mesh in nominal.meshes] == [stage.name for stage in nominal.stages]


CHANGES = {
    "turned body": (
        'name="top" pos="10 0 0"',
        'name="top" quat="1 0 0 0"',
        "<body> top: its 'quat'",
    ),
    "turned inertia": (
        'mass="5"',
        'mass="5" euler="0 0 1"',
        "<inertial> in <body> top: its 'euler'",
    ),
    "turned sensor": ('name="acc7"', 'name="acc7" euler="0 0 1"', "<site> acc7: its 'euler'"),
    "limit": ('name="top_rx"', 'name="top_rx" range="0 1"', "<joint> top_rx: its 'range'"),
    "friction": ('name="top_rx"', 'name="top_rx" frictionloss="1"', "'frictionloss'"),
    "ball": ('name="top_rx"', 'name="top_rx" type="ball"', "<joint> top_rx: type 'ball'"),
    "free joint": (
        '<joint name="top_rx" axis="1 0 0"/>',
        "<freejoint/>",
        "<freejoint> in <body> top",
    ),
    "polynomial": ('stiffness="1e6"', 'stiffness="1e6 1 1"', "base_tz: stiffness is '1e6 1 1'"),
    "negative": ('stiffness="1e6"', 'stiffness="-1"', "joint base_tz: stiffness -1.0 is negative"),
    "no length": ('axis="0 0 2"', 'axis="0 0 0"', "joint base_tz: its axis has no length"),
    "not a number": ('mass="5"', 'mass="five"', "mass is 'five'"),
    "no mass": ('mass="5"', "", "mass is None"),
    "weightless": ('mass="5"', 'mass="0"', "body top: mass 0.0 must be positive"),
    "impossible": ('diaginertia="1 1 1"', 'diaginertia="1 1 3"', "body top: no solid body"),
    "no inertia": ('diaginertia="1 1 1"', "", "<body> top: its <inertial> has no diaginertia"),
    "two masses": (
        "<inertial mass",
        '<inertial mass="1"/><inertial mass',
        "exactly one <inertial>",
    ),
    "heavy shape": ('size="1 1 1"', 'size="1 1 1" mass="2"', '<geom>: a shape must have mass="0"'),
    "touching": ('size="1 1 1"', 'size="1 1 1" contype="1"', "<geom>: it may touch"),
    "height field": ('type="box"', 'type="hfield"', "<geom>: type 'hfield' is not handled"),
    "no such mesh": ('type="box"', 'type="mesh" mesh="case"', "<geom>: there is no mesh 'case'"),
    "mesh without a name": ('type="box"', 'type="mesh"', "<geom>: there is no mesh None"),
    "mesh without a file": (
        "<worldbody>",
        '<asset><mesh name="case" file="case.stl"/></asset><worldbody>',
        "<mesh> case: ",
    ),
    "mesh in a strange name": (
        "<worldbody>",
        '<asset><mesh name="../case" file="case.stl"/></asset><worldbody>',
        "<mesh> '../case': give it a name",
    ),
    "drawn mesh": (
        "<worldbody>",
        '<asset><mesh name="case" vertex="0 0 0"/></asset><worldbody>',
        "<mesh> case: its 'vertex'",
    ),
    "height field asset": (
        "<worldbody>",
        '<asset><hfield name="case"/></asset><worldbody>',
        "<hfield> case in <asset>: is not handled",
    ),
    "folder of textures": ('angle="radian"', 'angle="radian" texturedir="a"', "'texturedir'"),
    "bad shape": ('fromto="0 0 0 0 0 1"', 'fromto="0 0 0"', "fromto is '0 0 0', expected 6"),
    "gravity": ('gravity="0 0 0"', 'gravity="0 0 -9.81"', "<option>: gravity is on"),
    "silent gravity": ('<option gravity="0 0 0"/>', "", "<option>: gravity is on"),
    "viscosity": ('gravity="0 0 0"', 'gravity="0 0 0" viscosity="1"', "<option>: its 'viscosity'"),
    "degrees": ('angle="radian"', 'angle="degree"', "<geom>: is turned in degrees"),
    "tendon": ("</worldbody>", "</worldbody><tendon/>", "<tendon> in <mujoco>"),
    "joint default": ("<default>", '<default><joint damping="1"/>', "<default>: it sets <joint>"),
    "site default": ("<default>", '<default><site euler="1 0 0"/>', "<default>: it sets euler"),
    "material": ('size="1 1 1"', 'size="1 1 1" material="steel"', "class and material"),
    "class": ('name="top" pos', 'name="top" childclass="a" pos', "'childclass'"),
    "nameless body": ('name="top" ', "", "<body>: it has no name"),
    "same body": ('name="top"', 'name="base"', "body base: the name is given twice"),
    "same joint": ('name="top_rx"', 'name="base_tz"', "joint base_tz: the name is given twice"),
    "same site": ('name="hit7"', 'name="acc7"', "site acc7: the name is given twice"),
    "other number": ('name="focus"', 'name="focus2"', "<site> focus2: call it acc"),
    "ground site": (
        "<light pos",
        '<site name="acc1"/><light pos',
        "<site> acc1: it sits on the ground",
    ),
}


@pytest.mark.parametrize("case", CHANGES)
def test_what_would_not_be_honoured_is_refused_by_name(case, tmp_path):
    before, after, words = CHANGES[case]
    assert before in GOOD
    with pytest.raises(TruthError) as refusal:
        read(GOOD.replace(before, after), tmp_path)
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not xml", "is not XML"),
        ("<robot/>", "starts with <robot>"),
        ('<mujoco><option gravity="0 0 0"/></mujoco>', "has no body"),
    ],
)
def test_a_file_that_is_no_machine_is_refused(text, words, tmp_path):
    with pytest.raises(TruthError, match=words):
        read(text, tmp_path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(TruthError, match="cannot be read"):
        read_station(tmp_path / "none.xml")


def test_the_example_of_this_test_is_itself_good(tmp_path):
    assert ET.fromstring(GOOD).tag == "mujoco"
    assert len(read(GOOD, tmp_path).stages) == 2
