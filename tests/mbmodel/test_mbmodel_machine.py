"""MJCF to machine: the mass matrix, sites, springs and names."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mbmodel_examples import STATION, mass_on_spring, mjcf, random_tree

from identification.words import Dof
from mbmodel import Edit, Part, SpringPart, spring_parts

SEEDS = range(12)

# A stage on two joints, with a turned body welded to it that carries a body on one joint.
WELDED = mjcf("""
<body name="a" pos="0.1 0.2 0.3" quat="0.9 0.1 -0.3 0.2">
  <inertial pos="0.3 0.1 0" mass="20" diaginertia="1 1.2 1.4"/>
  <joint name="a1" type="slide" axis="1 1 0" pos="0 0 0.1" stiffness="3e6" damping="200"/>
  <joint name="a2" type="hinge" axis="0 1 2" pos="0.4 0.5 0.1" stiffness="8e5" armature="0.7"/>
  <site name="acc1" pos="0.1 0.3 0.5"/>
  <body name="w" pos="0.5 0 0.2" quat="0.5 0.5 -0.5 0.4">
    <inertial pos="0.1 0 0.2" mass="7" fullinertia="0.5 0.6 0.4 0.05 -0.02 0.03"/>
    <site name="acc2" pos="0.2 -0.1 0.4" quat="0.1 0.2 0.3 0.4"/>
    <body name="c" pos="0 0 0.3">
      <joint name="c1" type="hinge" axis="1 0 0" pos="0 0.2 0" damping="9"/>
      <inertial pos="0.02 0.03 0.1" mass="3" diaginertia="0.1 0.1 0.15"/>
      <site name="acc3" pos="0 0.1 0.2"/>
    </body>
  </body>
</body>
<body name="fixed"><geom size="0.1"/><site name="acc9"/></body>
""")


def muj(machine):
    """MuJoCo's own model and data of a machine, at its start."""
    model = mujoco.MjModel.from_xml_path(str(machine.source))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def mass_error(machine):
    """Difference to MuJoCo's mass matrix, relative to sqrt(M_ii M_jj): kg and kg m^2 mix."""
    model, data = muj(machine)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    scale = np.sqrt(np.outer(np.diag(full), np.diag(full)))
    return (np.abs(machine.mass - full) / scale).max()


def test_the_stations_mass_matrix_is_mujocos(station):
    # Sums of six bodies' parts with turned inertias, in two orders: some units in the last place
    # (2.9e-15 seen).
    assert mass_error(station) < 1e-14


@pytest.mark.parametrize("seed", SEEDS)
def test_the_mass_matrix_of_a_skew_tree_is_mujocos(from_text, seed):
    # Turned inertias and levers of a metre cancel: some ten roundings instead of a few.
    assert mass_error(from_text(random_tree(seed))) < 1e-14


def test_a_welded_body_adds_its_mass_to_its_stage(from_text):
    machine = from_text(WELDED)
    assert machine.layout.bodies == ("a", "c")
    assert machine.body_mass[0, 0] == pytest.approx(27, rel=1e-15)
    assert mass_error(machine) < 3e-15


def test_the_centre_of_a_welded_pair_is_their_common_centre(from_text):
    machine = from_text(WELDED)
    _, data = muj(machine)
    expected = (20 * data.body("a").xipos + 7 * data.body("w").xipos) / 27
    np.testing.assert_allclose(machine.layout.centres[0], expected, rtol=1e-14)


def test_inertia_is_about_the_common_centre_and_symmetric_positive(from_text):
    inertia = from_text(WELDED).body_mass[3:6, 3:6]
    np.testing.assert_allclose(inertia, inertia.T, rtol=1e-15)
    assert np.linalg.eigvalsh(inertia).min() > 1


def test_mass_and_rotation_do_not_mix_at_a_centre_of_mass(from_text):
    assert not from_text(WELDED).body_mass[:3, 3:6].any()


def test_sites_that_cannot_move_are_left_out(from_text):
    assert from_text(WELDED).layout.points == ("acc1", "acc2", "acc3")


def test_a_site_on_a_welded_body_belongs_to_the_stage(from_text):
    assert from_text(WELDED).layout.body_name("acc2") == "a"


@pytest.mark.parametrize("seed", [*SEEDS, None])
def test_rows_times_jacobian_are_mujocos_site_jacobians_in_the_sites_axes(from_text, seed):
    machine = from_text(WELDED if seed is None else random_tree(seed))
    model, data = muj(machine)
    for point in machine.layout.points:
        site = model.site(point).id
        block = np.zeros((6, model.nv))
        mujoco.mj_jacSite(model, data, block[:3], block[3:], site)
        axes = data.site_xmat[site].reshape(3, 3)
        expected = np.vstack([axes.T @ block[:3], axes.T @ block[3:]])
        rows = machine.layout.rows([Dof.of(point, axis) for axis in range(6)]) @ machine.jacobian
        # Levers of some metres: absolute, since many entries are zero.
        np.testing.assert_allclose(rows, expected, atol=1e-14)


def test_the_station_has_six_bodies_of_six_coordinates_and_23_sensors(station):
    assert station.layout.bodies == (
        *("granite_bottom", "granite_top", "ty", "tilt", "spindle", "hexapod"),
    )
    assert len(station.coordinates) == 36
    assert sorted(station.layout.points) == sorted(f"acc{node}" for node in range(1, 24))


def test_the_stations_centres_are_those_of_its_file(station):
    centre = dict(zip(station.layout.bodies, station.layout.centres, strict=True))
    # As the report has them; the file's are those of meshes that are drawn to a micrometre.
    np.testing.assert_allclose(centre["ty"], [0, 0.014, -0.6], rtol=0, atol=1e-6)
    np.testing.assert_allclose(centre["hexapod"], [-0.004, 0.006, -0.319], rtol=0, atol=1e-6)


def test_coordinates_bear_the_names_of_their_joints(station):
    assert station.coordinates[:7] == (
        *("granite_bottom_tx", "granite_bottom_ty", "granite_bottom_tz"),
        *("granite_bottom_rx", "granite_bottom_ry", "granite_bottom_rz", "granite_top_tx"),
    )


def test_a_joint_is_called_by_its_direction_and_else_by_the_axis_that_its_own_is_nearest(station):
    directions = ("tx", "ty", "tz", "rx", "ry", "rz")
    assert [axle.dof for axle in station.axles] == 6 * [*directions]
    turned = replace(station.axles[4], joint="a swivel", axis=np.array([0.6, 0.0, -0.8]))
    assert turned.dof == "rz"
    assert replace(turned, turns=False).dof == "tz"


def test_the_station_has_no_forces_beside_its_springs(station):
    assert not station.remaining_stiffness.any()
    assert not station.remaining_damping.any()


def test_stiffness_and_damping_of_the_station_are_its_72_parameters(station_model):
    drawn = {p.name: p for p in station_model.parameters}
    assert len(drawn) == 72
    assert drawn["tilt_tz.stiffness"].drawn == 3.8e8
    assert drawn["tilt_tz.stiffness"].unit == "N/m"
    assert drawn["tilt_ry.damping"].drawn == 1000
    assert drawn["tilt_ry.damping"].unit == "N m s/rad"


def test_each_joint_of_the_station_is_one_part(station, station_model):
    assert [part.location for part in station_model.parts] == [
        f"joint:{body}" for body in station.layout.bodies
    ]
    assert set(station_model.locations[:12]) == {"joint:granite_bottom"}
    assert len(station_model.locations) == 72


def test_a_part_writes_its_parameters_under_their_names(station_model):
    part = station_model.parts[3]
    written = part.write(np.arange(1.0, 13.0))
    assert written[0] == Edit("spring", "tilt_tx", {"stiffness": 1.0, "damping": 2.0})
    assert [v for edit in written for v in edit.values.values()] == list(range(1, 13))


def test_a_spring_without_damping_has_some_and_a_damper_has_no_stiffness(from_text):
    machine = from_text(WELDED)
    parameters = [parameter for part in spring_parts(machine) for parameter in part.parameters]
    names = [parameter.name for parameter in parameters]
    assert names == ["a1.stiffness", "a1.damping", "a2.stiffness", "a2.damping", "c1.damping"]
    assert parameters[3].drawn == 0.0
    assert parameters[3].known == "undrawn_damping"


def test_armature_adds_to_its_own_coordinate(from_text):
    machine = from_text(WELDED)
    np.testing.assert_array_equal(machine.armature, np.diag([0, 0.7, 0]))


def test_unnamed_joints_and_bodies_get_names_of_their_own(from_text):
    slide = '<joint type="slide" axis="0 0 1" stiffness="3"/><geom size="0.1"/>'
    machine = from_text(mjcf(f"<body>{slide}</body><body name='b' pos='1 0 0'>{slide}</body>"))
    assert machine.layout.bodies == ("body1", "b")
    assert len(set(machine.coordinates)) == 2


def test_a_ball_joint_has_three_coordinates_with_a_damper_each(from_text):
    text = '<body name="a"><joint name="b" type="ball" damping="2"/><geom pos="1 0 0" size="1"/>'
    machine = from_text(mjcf(text + "</body>"))
    assert machine.coordinates == ("b.0", "b.1", "b.2")
    assert [spring.damping for spring in machine.springs] == [2, 2, 2]
    assert all(spring.angular for spring in machine.springs)


def test_a_free_joint_turns_in_its_last_three_coordinates(from_text):
    machine = from_text(mjcf('<body name="a"><joint name="f" type="free"/><geom size="1"/></body>'))
    assert [spring.angular for spring in machine.springs] == [False] * 3 + [True] * 3


def test_the_name_of_a_machine_is_that_of_its_model(station):
    assert station.name == "microstation"
    assert station.source == STATION


def test_arrays_of_a_machine_are_read_only(station):
    for name in ("jacobian", "body_mass", "armature", "remaining_stiffness", "remaining_damping"):
        assert not getattr(station, name).flags.writeable


def test_springs_of_a_part_are_those_of_one_body(from_text):
    text = mass_on_spring(2, 30, 4, name="a") + mass_on_spring(3, 50, 6, name="b", node=2)
    parts: tuple[Part, ...] = spring_parts(from_text(mjcf(text)))
    assert all(isinstance(part, SpringPart) for part in parts)
    assert [part.location for part in parts] == ["joint:a", "joint:b"]


def test_a_tendons_armature_is_in_the_mass_matrix(from_text):
    # MuJoCo: M += armature J' J with the tendon's moment arms J, here 0.3 * 2^2.
    tendon = '<tendon><fixed name="t" armature="0.3"><joint joint="a_j" coef="2"/></fixed></tendon>'
    text = mjcf(mass_on_spring(2, 30, 4)).replace("</mujoco>", tendon + "</mujoco>")
    assert mass_error(from_text(text)) < 1e-14
