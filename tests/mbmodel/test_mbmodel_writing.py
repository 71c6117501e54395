"""What is written is the machine in memory, whatever settings and classes the file has."""

from dataclasses import replace
from pathlib import Path
from xml.dom import minidom

import mujoco
import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf
from written_machines import compare_with_mujoco, moved_model, random_machine

from identification.words import InputError, WorkbenchError
from mbmodel import (
    GapSpring,
    MjcfLack,
    Model,
    NotInMjcf,
    as_drawn,
    held_parameters,
    load_machine,
    model_modes,
    read_nonlinear_joints,
    refuse_difference,
    sensor_parts,
    spring_parts,
    transport,
    write_copy,
    write_mjcf,
    write_model,
    write_nonlinear_joints,
)
from mbmodel.additions import joint_coupling_elements, link_elements
from mbmodel.mjcf import written_file
from mbmodel.writing.written_model import compare_machines

ASSETS = Path(__file__).resolve().parents[2] / "assets"
TREES = (5, 18, 51)  # gravity with a turned motor, bounds of mass and inertia, includes
EXACT = 1e-9  # of the largest entry


@pytest.mark.parametrize("seed", TREES)
def test_random_trees_with_settings_and_includes_are_written_exactly(tmp_path, seed):
    path = random_machine(seed, tmp_path)
    model, theta = moved_model(path, seed)
    target = tmp_path / "tuned.xml"
    assert write_model(model, theta, target).difference == ""
    following = load_machine(path, follow=True).statics
    model = replace(model, machine=replace(model.machine, statics=following))
    assert compare_with_mujoco(model, theta, target) < EXACT


@pytest.mark.parametrize(
    "asset",
    [
        "microstation/station.xml",
        "microstation/station_legs.xml",
        "two_bodies.xml",
        "demo/model.xml",
    ],
)
def test_assets_stay_as_their_authors_wrote_them_but_for_the_numbers(tmp_path, asset):
    model, theta = moved_model(ASSETS / asset, 3)
    target = tmp_path / "tuned.xml"
    assert write_model(model, theta, target).difference == ""
    assert compare_with_mujoco(model, theta, target) < EXACT
    sources = [minidom.parse(str(path)) for path in (ASSETS / asset, target)]
    tags = [[node.tagName for node in source.getElementsByTagName("body")] for source in sources]
    assert tags[0] == tags[1]
    defaults = [len(source.getElementsByTagName("default")) for source in sources]
    assert defaults[0] == defaults[1]


SPRING = '<joint name="b_j" type="slide" stiffness="2e5" damping="30"/>'
CHILD = (
    f'<body name="b" pos="0 0 0.1">{SPRING}<geom size="0.05" mass="4"/><site name="acc2"/></body>'
)
KINDS = {
    "springdamper of a joint": ('<joint name="a_j"', '<joint springdamper="0.02 0.1" name="a_j"'),
    "springdamper of a class": (
        "<worldbody>", '<default><joint springdamper="0.02 0.1"/></default><worldbody>',
    ),
    "damping ratio of a servo": (
        "</worldbody>",
        '</worldbody><actuator><position joint="a_j" kp="1e4" dampratio="0.3"/></actuator>',
    ),
    "total mass": ("<worldbody>", '<compiler settotalmass="11"/><worldbody>'),
    "inertia from geoms": (
        "<worldbody>", '<compiler inertiafromgeom="true"/><worldbody>',
    ),
    "fused bodies": ("<worldbody>", '<compiler fusestatic="true"/><worldbody>'),
    "joint without a name": ('name="b_j"', ""),
    "replicated bodies": (
        "</worldbody>", '<replicate count="2" offset="0.3 0 0"><body name="r"><joint name="r_j" '
        'type="slide" stiffness="3e4"/><geom size="0.1" contype="0" conaffinity="0"/></body>'
        "</replicate></worldbody>",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_compiler_would_change_is_written_in_another_way(tmp_path, kind):
    old, new = KINDS[kind]
    body = mass_on_spring(10.0, 3e5, 50.0)
    text = mjcf(body.replace("</body>", f'<geom size="0.1" mass="10"/>{CHILD}</body>'))
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    model, theta = moved_model(path, 1)
    assert write_model(model, theta, target).difference == ""
    assert compare_with_mujoco(model, theta, target) < EXACT
    read = as_drawn(load_machine(target))
    found, meant = model_modes(read, read.drawn), model_modes(model, theta)
    np.testing.assert_allclose(found.freq_hz, meant.freq_hz, rtol=1e-8)
    np.testing.assert_allclose(found.damping, meant.damping, rtol=1e-6, atol=1e-12)


def test_a_urdf_is_written_as_an_mjcf(tmp_path):
    path, target = tmp_path / "arm.urdf", tmp_path / "tuned.xml"
    path.write_text(
        '<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.4"/>'
        '<mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" '
        'velocity="1"/><dynamics damping="0.02"/></joint></robot>',
        encoding="utf-8",
    )
    model, theta = moved_model(path, 1)
    assert write_model(model, theta, target).difference == ""
    assert minidom.parse(str(target)).documentElement.tagName == "mujoco"
    following = replace(model.machine, statics=load_machine(path, follow=True).statics)
    assert compare_with_mujoco(replace(model, machine=following), theta, target) < EXACT


def test_a_tendon_keeps_its_end_where_its_site_moves_as_a_sensor(tmp_path):
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    text = mjcf(mass_on_spring(10.0, 3e5, 50.0))
    tendon = '<tendon><spatial name="t" stiffness="1e5"><site site="floor"/><site site="acc1"/>'
    text = text.replace("<worldbody>", '<worldbody><site name="floor" pos="0.3 0.4 1"/>')
    path.write_text(text.replace("</mujoco>", f"{tendon}</spatial></tendon></mujoco>"), "utf-8")
    machine = load_machine(path)
    model = Model(machine, spring_parts(machine) + sensor_parts(machine))
    theta = model.drawn.copy()
    theta[[p.name for p in model.parameters].index("acc1.position_x")] = 0.05
    assert write_model(model, theta, target).difference == ""
    stiffness = as_drawn(load_machine(target)).matrices(theta[:4]).stiffness
    np.testing.assert_allclose(stiffness, model.matrices(theta).stiffness, rtol=1e-9)


def test_a_sensor_turned_by_as_little_as_a_fit_finds_is_written(tmp_path):
    # MuJoCo takes frames that are turned by less than some 2e-7 rad for one frame.
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    path.write_text(mjcf(mass_on_spring(10.0, 3e5, 50.0)), "utf-8")
    machine = load_machine(path)
    model = Model(machine, spring_parts(machine) + sensor_parts(machine))
    theta = model.drawn.copy()
    theta[[p.name for p in model.parameters].index("acc1.rotation_x")] = 1e-7
    assert write_model(model, theta, target).difference == ""


def test_meshes_weigh_in_mujoco_what_they_weigh_here(tmp_path):
    # A U profile: MuJoCo's default mass of a mesh is that of a fan of tetrahedra, 2.5 times more.
    square = [(0, 0), (1, 0), (1, 1), (0.9, 1), (0.9, 0.1), (0.1, 0.1), (0.1, 1), (0, 1)]
    corners = [(0.1 * x, 0.1 * y, z) for z in (0.0, 0.2) for x, y in square]
    caps = [(0, 5, 7), (5, 6, 7), (0, 1, 5), (1, 4, 5), (1, 2, 4), (2, 3, 4)]
    faces = [(a, c, b) for a, b, c in caps] + [(a + 8, b + 8, c + 8) for a, b, c in caps]
    for k in range(8):
        n = (k + 1) % 8
        faces += [(k, n, n + 8), (k, n + 8, k + 8)]
    words = [" ".join(str(n) for row in rows for n in row) for rows in (corners, faces)]
    mesh = f'<asset><mesh name="u" vertex="{words[0]}" face="{words[1]}"/></asset>'
    body = (
        '<body name="a"><joint name="a_j" type="slide" axis="1 0 0" stiffness="1e5"/>'
        '<geom type="mesh" mesh="u" density="2700"/><site name="acc1"/></body>'
    )
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    path.write_text(mjcf(body, extra=mesh), encoding="utf-8")
    machine = load_machine(path)
    model = as_drawn(machine)
    assert machine.body_mass[0, 0] == pytest.approx(2700 * 0.2 * (0.01 - 0.08 * 0.09), rel=1e-6)
    assert write_model(model, 1.1 * model.drawn, target).difference == ""
    written = mujoco.MjModel.from_xml_path(str(target))
    assert written.body_mass[1] == pytest.approx(machine.body_mass[0, 0], rel=1e-6)


def test_a_gap_replaces_a_spring_that_the_file_states_by_its_frequency(tmp_path):
    path, target = tmp_path / "m.xml", tmp_path / "gap.xml"
    text = mjcf(mass_on_spring(10.0, 3e5, 50.0))
    path.write_text(text.replace('name="a_j"', 'name="a_j" springdamper="0.01 0.1"'), "utf-8")
    write_nonlinear_joints(path, target, [GapSpring("a_j", 5e5, 1e-4)])
    assert mujoco.MjModel.from_xml_path(str(target)).jnt_stiffness.tolist() == [0.0]
    assert [law.gap for law in read_nonlinear_joints(target)] == [pytest.approx(1e-4)]


def test_a_file_that_differs_is_kept_and_named(tmp_path, monkeypatch):
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    path.write_text(mjcf(mass_on_spring(10.0, 3e5, 50.0)), encoding="utf-8")
    model = as_drawn(load_machine(path))
    write = written_file.write_mjcf

    def forget(source, place, changes, folder=None, *, expanded=False):
        return write(source, place, changes[1:], folder, expanded=expanded)

    monkeypatch.setattr(written_file, "write_mjcf", forget)
    written = write_model(model, 1.2 * model.drawn, target)
    assert "at a_j differs by" in written.difference
    assert target.is_file()
    with pytest.raises(WorkbenchError, match="is not the machine that was meant") as caught:
        refuse_difference(written.file, written.difference)
    assert caught.value.exit_code == 1


def test_a_written_file_that_cannot_be_read_says_why(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(mjcf(mass_on_spring(10.0, 3e5, 50.0)), encoding="utf-8")

    def refuse(written):
        raise InputError("its mesh is missing")

    difference = written_file.write_and_compare(path, tmp_path / "t.xml", (), None, refuse)
    assert str(difference) == "t.xml: the file cannot be read (its mesh is missing)"


def test_a_source_is_copied_with_all_that_it_means(tmp_path):
    path = random_machine(33, tmp_path)
    (tmp_path / "copy").mkdir()
    assert write_copy(path, tmp_path / "copy" / "m.xml").difference == ""
    first, second = (as_drawn(load_machine(p)) for p in (path, tmp_path / "copy" / "m.xml"))
    assert compare_machines(first, first.drawn, second.machine) is None


def test_what_the_file_holds_is_what_is_not_listed(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(mjcf(mass_on_spring(10.0, 3e5, 50.0)), encoding="utf-8")
    machine = load_machine(path)
    model = Model(machine, spring_parts(machine) + sensor_parts(machine))
    names, theta = [p.name for p in model.parameters], model.drawn.copy()
    theta[names.index("acc1.gain_x")], theta[names.index("acc1.delay_y")] = 1.1, 1e-4
    theta[names.index("acc1.position_x")] = 0.01
    held = held_parameters(model, theta)
    assert [n for n, a, b in zip(names, theta, held, strict=True) if a != b] == [
        "acc1.gain_x", "acc1.delay_y",
    ]  # fmt: skip
    written = write_model(model, theta, tmp_path / "tuned.xml")
    assert written.difference == ""
    assert all(isinstance(missing, NotInMjcf) for missing in written.not_held)
    assert [missing.name for missing in written.not_held] == ["acc1.gain_x", "acc1.delay_y"]


def test_the_page_lists_every_kind_that_no_mjcf_holds_and_no_other():
    page = (Path(__file__).parents[2] / "docs" / "reference" / "mjcf.md").read_text("utf-8")
    rows = page.partition("the reason that is listed |")[2].partition("\n\n")[0].splitlines()[2:]
    assert [row.split(" | ")[1].removesuffix(" |") for row in rows] == list(MjcfLack)


def test_an_added_tendon_stands_beside_the_defaults_of_tendons(tmp_path):
    path, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    default = '<default><tendon width="0.002"/></default><worldbody>'
    text = mjcf(mass_on_spring(10.0, 3e5, 50.0)).replace("<worldbody>", default, 1)
    path.write_text(text, encoding="utf-8")
    machine = load_machine(path)
    along = machine.layout.centres[0], np.array([0.0, 0.0, 1.0])
    added = link_elements("k", machine, ("world", machine.layout.bodies[0]), along, np.ones(2))
    assert write_mjcf(path, target, list(added)) == ()
    assert mujoco.MjModel.from_xml_path(str(target)).ntendon == 1


def sag(tmp_path):
    """A mass that sinks and leans under its weight, off its springs."""
    path = tmp_path / "sag.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 -9.81"/><worldbody><body name="a" pos="0 0 1">'
        '<joint name="z" type="slide" axis="0 0 1" stiffness="3e4" damping="20"/>'
        '<joint name="x" type="slide" axis="1 0 0" stiffness="3e4" damping="20"/>'
        '<joint name="ry" axis="0 1 0" stiffness="900" damping="1"/>'
        '<inertial pos="0.2 0 0.1" mass="8" diaginertia="0.1 0.2 0.3"/><site name="acc1"/>'
        "</body></worldbody></mujoco>",
        encoding="utf-8",
    )
    return load_machine(path)


@pytest.mark.parametrize("kind", ["link", "coupling"])
def test_what_is_added_to_a_machine_that_sags_carries_none_of_its_weight(tmp_path, kind):
    machine, target = sag(tmp_path), tmp_path / "tuned.xml"
    assert np.abs(machine.layout.centres[0] - [0.2, 0.0, 1.1]).max() > 1e-3
    if kind == "link":
        axis = np.array([0.6, 0.0, 0.8])
        point = machine.layout.centres[0] + [0.1, 0.0, 0.2]
        added = link_elements("k", machine, ("world", "a"), (point, axis), np.array([5e4, 7.0]))
        row = axis @ transport(np.array([0.1, 0.0, 0.2]))[:3] @ machine.jacobian[:6]
        change = 5e4 * np.outer(row, row)
    else:
        row = np.array([1.0, 0.5, -0.3])
        change = 5e4 * np.outer(row, row)
        added = joint_coupling_elements("k", machine, change, np.zeros((3, 3)))
    assert write_mjcf(machine.source, target, list(added)) == ()
    read = load_machine(target)
    np.testing.assert_allclose(read.layout.centres, machine.layout.centres, atol=1e-12)
    before, after = (as_drawn(each).matrices(as_drawn(each).drawn) for each in (machine, read))
    np.testing.assert_allclose(after.stiffness, before.stiffness + change, rtol=1e-9, atol=1e-4)
