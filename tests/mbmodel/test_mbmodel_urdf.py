"""URDF as it is published: meshes of packages, fixed links, limits that are none."""

import pytest

from identification.words import InputError
from mbmodel import as_drawn, load_machine, model_modes

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ROBOT = """
<robot name="arm">
  <link name="ground">
    <inertial>
      <mass value="1e-6"/><inertia ixx="1" ixy="1" ixz="1" iyy="1" iyz="1" izz="1"/>
    </inertial>
  </link>
  <link name="arm">
    {inertial}
    <visual><geometry><mesh filename="package://nowhere/arm.dae"/></geometry></visual>
    <collision><geometry><mesh filename="package://arm_description/meshes/{mesh}"/></geometry></collision>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="ground"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1e16" upper="1e16" effort="1" velocity="1"/>
    <dynamics damping="4" spring_stiffness="0"/>
  </joint>
  <mujoco><option gravity="0 0 0"/><compiler discardvisual="false"/></mujoco>
</robot>
"""
STATED = """<inertial><mass value="3"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"""


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "arm_description"
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    (folder / "meshes" / "arm.obj").write_text(TETRAHEDRON)
    return folder / "urdf" / "arm.urdf"


@pytest.mark.parametrize(("mesh", "count"), [("arm.obj", 1), ("gone.obj", 2)])
def test_shapes_of_stated_masses_may_be_missing(package, mesh, count):
    package.write_text(ROBOT.format(inertial=STATED, mesh=mesh))
    machine = load_machine(package)
    (remark,) = [text for text in machine.remarks if "left out of the pictures" in text]
    assert f"pictures: {count}, the first of them" in remark
    model = as_drawn(machine)
    assert machine.coordinates == ("lift",)
    assert model.assemble(model.drawn).matrices.mass.tolist() == [[3.0]]
    assert model_modes(model, model.drawn).poles.real.min() == pytest.approx(-4 / 3)


def test_a_mesh_that_gives_the_mass_comes_from_its_package(package):
    text = ROBOT.format(inertial="", mesh="arm.obj")
    package.write_text(text.replace("nowhere/arm.dae", "arm_description/meshes/arm.obj"))
    model = as_drawn(load_machine(package))
    assert model.assemble(model.drawn).matrices.mass[0, 0] == pytest.approx(1000 / 6)


@pytest.mark.parametrize(
    ("mesh", "why"),
    [("gone.stl", "is missing"), ("arm.dae", "of a kind that MuJoCo")],
)
def test_a_missing_mesh_that_would_give_the_mass_is_one_sentence(package, mesh, why):
    (package.parent.parent / "meshes" / "arm.dae").write_text("<COLLADA/>")
    package.write_text(ROBOT.format(inertial="", mesh=mesh))
    with pytest.raises(InputError, match=rf"link 'arm' has no <inertial>.*{why}.* \(.*{mesh}\)"):
        load_machine(package)


def test_a_mesh_that_gives_the_mass_may_lie_in_a_folder_of_its_own(package):
    inside = '<compiler meshdir="../meshes" discardvisual="false"/>'
    text = ROBOT.format(inertial="", mesh="arm.obj").replace(
        '<compiler discardvisual="false"/>', inside
    )
    text = text.replace("package://arm_description/meshes/", "").replace(
        "package://nowhere/arm.dae", "arm.obj"
    )
    package.write_text(text)
    model = as_drawn(load_machine(package))
    assert model.assemble(model.drawn).matrices.mass[0, 0] == pytest.approx(1000 / 6)
