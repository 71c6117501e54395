"""A stage or point masses put on a machine, against closed forms and machines written as one."""

import mujoco
import numpy as np
import pytest
from mbmodel_examples import (
    STATION,
    mass_on_spring,
    mjcf,
    numbers,
    random_request,
    random_tree,
    worst_of_channels,
)
from scipy.spatial.transform import Rotation

from identification.words import Dof, InputError
from mbmodel import (
    FrfRequest,
    MountedStage,
    PointMass,
    as_drawn,
    combine,
    linearise,
    load_machine,
    model_modes,
)

FREQ_HZ = np.linspace(1.0, 250.0, 41)


@pytest.fixture
def write(tmp_path):
    """Write a text as a file, and return its path."""

    def write(text, name="stage.xml"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def out(tmp_path):
    folder = tmp_path / "result"
    folder.mkdir()
    return folder


def frfs(machine, request):
    model = as_drawn(machine)
    return linearise(model, model.drawn, request).values


def station_request(machine):
    return random_request(machine, FREQ_HZ, n_out=8, n_in=3)


@pytest.mark.parametrize("seed", range(3))
def test_a_point_mass_adds_its_kinetic_energy_and_nothing_else(from_text, out, seed):
    # Z = Z_0 - w^2 m J'J, J the translation of the point per joint coordinate: no parallel axis
    # theorem is needed for what is expected.
    machine = from_text(random_tree(seed))
    layout = machine.layout
    body, mass, offset = len(layout.bodies) - 1, 7.3, np.array([0.21, -0.13, 0.34])
    loaded = combine(
        machine, out, None, [PointMass(layout.bodies[body], mass, tuple(offset))]
    ).machine
    request = FrfRequest(FREQ_HZ, tuple(Dof.of(p, 1) for p in layout.points), (Dof("acc1", "+tx"),))
    twist = machine.jacobian[6 * body : 6 * body + 6]
    point = twist[:3] + np.cross(twist[3:].T, offset).T
    model = as_drawn(machine)
    matrices = model.matrices(model.drawn)
    rows, column = (
        layout.rows(dofs) @ machine.jacobian for dofs in (request.outputs, request.inputs)
    )
    omega = 2 * np.pi * FREQ_HZ[:, None, None]
    total = matrices.mass + mass * point.T @ point
    z = matrices.stiffness + 1j * omega * matrices.damping - omega**2 * total
    expected = -(omega**2) * (
        rows @ np.linalg.solve(z, np.broadcast_to(column.T, (len(z), *column.T.shape)))
    )
    assert worst_of_channels(frfs(loaded, request), expected) < 1e-10


def test_the_bodys_inertia_grows_by_the_parallel_axis_theorem(station, out):
    offset, added = np.array([0.1, 0.2, 0.3]), 2.5
    loaded = combine(station, out, None, [PointMass("hexapod", added, tuple(offset))]).machine
    before, after = station.body_mass[-6:, -6:], loaded.body_mass[-6:, -6:]
    mass = before[0, 0]
    reduced = mass * added / (mass + added)
    inertia = before[3:, 3:] + reduced * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    assert after[0, 0] == pytest.approx(mass + added, rel=1e-14)
    assert after[3:, 3:] == pytest.approx(inertia, abs=1e-13)
    shift = loaded.layout.centres[-1] - station.layout.centres[-1]
    assert shift == pytest.approx(added / (mass + added) * offset, abs=1e-14)


def test_a_mounted_mass_on_a_spring_is_a_tuned_mass_damper(from_text, write, out):
    # Den Hartog's absorber: X/F = (k - w^2 m + i w c) / det, of M on K, C and m on k, c.
    big, stiff, loss, small, soft, damp = 40.0, 4e6, 90.0, 2.0, 1.7e5, 55.0
    machine = from_text(mjcf(mass_on_spring(big, stiff, loss)))
    stage = write(mjcf(mass_on_spring(small, soft, damp, name="b", node=2)))
    loaded = combine(machine, out, MountedStage(stage, "a", (0.0, 0.0, 0.2))).machine
    dofs = (Dof("a", "+tz"), Dof("b", "+tz"))
    values = frfs(loaded, FrfRequest(FREQ_HZ, dofs, dofs[:1], "receptance"))[:, :, 0]
    s = 2j * np.pi * FREQ_HZ
    upper = soft + s * damp
    lower = s**2 * big + stiff + s * loss + upper
    determinant = lower * (upper + s**2 * small) - upper**2
    expected = np.stack([upper + s**2 * small, upper], axis=1) / determinant[:, None]
    assert worst_of_channels(values[:, :, None], expected[:, :, None]) < 1e-11


def test_a_stage_without_joints_is_an_added_mass(station, write, out):
    weight = '<inertial pos="0 0 0.1" mass="3" diaginertia="1e-12 1e-12 1e-12"/>'
    stage = write(mjcf(f'<body name="payload" pos="0.2 0 0">{weight}</body>'))
    mounted = combine(station, out, MountedStage(stage, "hexapod", (0.0, 0.1, 0.0))).machine
    added = combine(station, out, None, [PointMass("hexapod", 3.0, (0.2, 0.1, 0.1))]).machine
    request = station_request(station)
    assert worst_of_channels(frfs(mounted, request), frfs(added, request)) < 1e-8


def test_a_mass_can_stand_on_the_mounted_stage(from_text, write, out):
    machine = from_text(mjcf(mass_on_spring(40, 4e6, 90)))
    light, heavy = (
        write(mjcf(mass_on_spring(mass, 2e5, 30, name="b", node=2)), f"{mass}.xml")
        for mass in (2, 5)
    )
    place = (0.0, 0.0, 0.1)
    added = combine(
        machine, out, MountedStage(light, "a", place), [PointMass("b", 3.0, (0.0, 0.0, 0.0))]
    ).machine
    request = FrfRequest(FREQ_HZ, (Dof("a", "+tz"), Dof("b", "+tz")), (Dof("a", "+tz"),))
    whole = combine(machine, out, MountedStage(heavy, "a", place)).machine
    assert worst_of_channels(frfs(added, request), frfs(whole, request)) < 1e-11


@pytest.mark.parametrize("seed", range(3))
def test_a_mounted_tree_is_the_tree_written_into_the_body(from_text, write, out, seed):
    base, stage = random_tree(seed), random_tree(seed + 10)
    inner = stage.split("<worldbody>")[1].split("</worldbody>")[0]
    for old, new in (('"b', '"s'), ('"w', '"sw'), ('"acc', '"acc2')):
        inner = inner.replace(old, new)
    machine = from_text(base)
    last = machine.layout.bodies[-1]
    turn = Rotation.random(random_state=seed)
    place = f'pos="{numbers([0.1, -0.2, 0.3])}" quat="{numbers(turn.as_quat()[[3, 0, 1, 2]])}"'
    head = f'<body name="{last}"'
    start = base.index(">", base.index(head)) + 1
    site = f'<site name="top" {place}/>'
    pasted = f"{base[:start]}{site}<frame {place}>{inner}</frame>{base[start:]}"
    expected = from_text(pasted)
    mounted = combine(
        from_text(base[:start] + site + base[start:]),
        out,
        MountedStage(write(mjcf(inner)), last, "top"),
    ).machine
    request = random_request(expected, FREQ_HZ, n_out=12, n_in=4, seed=seed)
    assert worst_of_channels(frfs(mounted, request), frfs(expected, request)) < 1e-9


STAGE_WITH_ALL = """
<mujoco model="active">
  <compiler angle="degree" eulerseq="zyx" meshdir="shapes"/><option gravity="0 0 0"/>
  <default><joint damping="11"/><geom density="1234" contype="0"/>
    <default class="stiff"><joint stiffness="3e5"/></default></default>
  <asset><mesh name="wedge" file="wedge.obj"/></asset>
  <worldbody>
    <light pos="0 0 3"/><geom type="plane" size="1 1 1"/>
    <frame pos="0 0 0.02"><geom type="box" size="1 1 1"/><site name="foot" pos="0.2 0.1 0"/></frame>
    <body name="table" pos="0 0 0.1" euler="20 -10 35">
      <joint name="table_tx" class="stiff" type="slide" axis="1 0 0"/>
      <joint name="table_rz" type="hinge" axis="0 0 1" stiffness="900" range="-40 40"/>
      <geom type="mesh" mesh="wedge"/><site name="acc41" pos="0.05 0.02 0.01" euler="0 0 90"/>
    </body>
  </worldbody>
  <tendon><spatial name="wire" stiffness="2e4" damping="3"><site site="foot"/><site site="acc41"/>
    </spatial></tendon>
  <actuator><motor name="push" joint="table_tx"/></actuator>
  <sensor><accelerometer name="probe" site="acc41"/></sensor>
</mujoco>
"""
WEDGE = "v 0 0 0\nv 0.2 0 0\nv 0 0.3 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def test_units_classes_meshes_tendons_and_motors_come_with_the_stage(from_text, write, out):
    # The carrier is so heavy and stiff that it is ground: the stage's modes stay as they are.
    stage = write(STAGE_WITH_ALL)
    write(WEDGE, "shapes/wedge.obj")
    alone = as_drawn(load_machine(stage))
    ground = mass_on_spring(1e9, 1e15, 1).replace(
        'diaginertia="1 1 1"', 'diaginertia="1e9 1e9 1e9"'
    )
    machine = from_text(
        mjcf(ground, extra='<default><geom mass="0"/><joint damping="5"/></default>')
    )
    combined = combine(machine, out, MountedStage(stage, "a", (0.0, 0.0, 0.5)))
    model = as_drawn(combined.machine)
    poles = model_modes(model, model.drawn).poles
    for pole in model_modes(alone, alone.drawn).poles:
        assert np.abs(poles - pole).min() < 1e-6 * abs(pole)
    assert "push" in combined.machine.motors
    assert combined.file.prefix == ""
    assert any("geoms that stand in the world" in remark for remark in combined.remarks)


def test_the_written_file_opens_in_mujoco_and_gives_the_same_frfs_from_anywhere(write, out):
    machine = load_machine(STATION)
    write(WEDGE, "shapes/wedge.obj")
    combined = combine(
        machine, out, MountedStage(write(STAGE_WITH_ALL), "hexapod", (0.0, 0.0, 0.1)),
        [PointMass("table", 1.5, (0.0, 0.05, 0.0)), PointMass("ty", 4.0, (0.0, 0.0, 0.2))],
    )  # fmt: skip
    place = out / "deeper" / "still"
    place.mkdir(parents=True)
    path = combined.file.write(place)
    assert mujoco.MjModel.from_xml_path(str(path)).nu == 1
    again = load_machine(path)
    request = station_request(combined.machine)
    assert worst_of_channels(frfs(again, request), frfs(combined.machine, request)) < 1e-9


def test_names_that_clash_get_a_prefix_and_the_sensor_of_a_node_stays_the_machines(write, out):
    machine = load_machine(STATION)
    stage = write(
        mjcf(mass_on_spring(2, 2e5, 30, name="hexapod", node=1)).replace('"test"', '"active one"')
    )
    combined = combine(machine, out, MountedStage(stage, "hexapod", (0.0, 0.0, 0.1)))
    assert combined.file.prefix == "active_one_"
    layout = combined.machine.layout
    assert layout.bodies[-1] == "active_one_hexapod"
    assert "active_one_acc1" in layout.points
    assert "active_one_acc1" not in layout.sensors
    assert any("begin with active_one_" in remark for remark in combined.remarks)
    # A second one of the kind goes onto the first.
    deeper = out / "second"
    deeper.mkdir()
    second = combine(combined.machine, deeper, MountedStage(stage, "hexapod", (0.1, 0.0, 0.1)))
    assert second.file.prefix == "active_one2_"
    assert len(second.machine.layout.bodies) == 8


def test_a_site_turns_the_stage_and_an_offset_does_not(from_text, write, out):
    text = mjcf(mass_on_spring(40, 4e6, 90)).replace(
        '<site name="acc1"/>',
        '<site name="acc1"/><site name="side" euler="0 1.5707963267948966 0"/>',
    )
    machine = from_text(text)
    stage = write(mjcf(mass_on_spring(2, 2e5, 30, name="b", node=2)))
    turned = combine(machine, out, MountedStage(stage, "a", "side"))
    assert turned.machine.axles[-1].axis == pytest.approx([1, 0, 0], abs=1e-12)
    assert any("90 degrees" in remark for remark in turned.remarks)
    straight = combine(machine, out, MountedStage(stage, "a", (0.0, 0.0, 0.0)))
    assert straight.machine.axles[-1].axis == pytest.approx([0, 0, 1], abs=1e-12)


def test_the_machines_gravity_holds_for_the_stage(from_text, write, out):
    # A pendulum of length l on a heavy carrier: w^2 = g / l, whatever its own file says of gravity.
    carrier = mass_on_spring(1e7, 1e14, 1, axis="1 0 0")
    machine = from_text(mjcf(carrier, gravity="0 0 -9.81"))
    bob = (
        '<body name="bob"><inertial pos="0 0 -0.5" mass="2" diaginertia="1e-9 1e-9 1e-9"/>'
        '<joint name="swing" type="hinge" axis="0 1 0"/></body>'
    )
    stage = write(mjcf(bob, gravity="0 0 0"))
    combined = combine(machine, out, MountedStage(stage, "a", (0.0, 0.0, -0.1)))
    model = as_drawn(combined.machine)
    lowest = model_modes(model, model.drawn).freq_hz[0]
    assert 2 * np.pi * lowest == pytest.approx(np.sqrt(9.81 / 0.5), rel=1e-6)
    assert any("gravity is 0 0 0" in remark for remark in combined.remarks)


def test_a_mass_on_a_body_without_weight_has_none(from_text, out):
    text = mjcf(mass_on_spring(40, 4e6, 90), gravity="0 0 -9.81")
    machine = from_text(text.replace('name="a"', 'name="a" gravcomp="1"'))
    loaded = combine(machine, out, None, [PointMass("a", 400.0, (0.0, 0.0, 0.0))]).machine
    assert loaded.layout.centres == pytest.approx(machine.layout.centres, abs=1e-12)


def keyed(text, *keys):
    """Return an MJCF with keyframes."""
    texts = "".join(f'<key name="{name}" qpos="{pose}"/>' for name, pose in keys)
    return text.replace("</mujoco>", f"<keyframe>{texts}</keyframe></mujoco>")


STANDING = mjcf(
    mass_on_spring(40, 0, 90).removesuffix("</body>")
    + mass_on_spring(9, 0, 5, name="c", node=8).replace("pos=", 'gravcomp="0" pos=', 1)
    + "</body>"
    + mass_on_spring(30, 0, 90, name="z", node=9, pos="1 0 0")
)
FREE_STAGE = mjcf(mass_on_spring(2, 0, 30, name="b", node=2))


@pytest.mark.parametrize(
    ("machine", "stage", "expected"),
    [
        ([("home", "0.03 0.01 -0.04")], [("home", "0.05")], (0.03, 0.04, 0.18, -0.04)),
        ([("home", "0.03 0.01 -0.04")], [], (0.03, 0.04, 0.13, -0.04)),
        ([], [("home", "0.05")], (0, 0, 0.15, 0)),
        ([("far", "1 1 1")], [("home", "0.05")], (0, 0, 0.15, 0)),
        ([("far", "1 1 1")], [("near", "1")], (0, 0, 0.1, 0)),
    ],
)
def test_home_is_the_pose_of_both(from_text, write, out, machine, stage, expected):
    loaded = from_text(keyed(STANDING, *machine))
    path = write(keyed(FREE_STAGE, *stage))
    layout = combine(loaded, out, MountedStage(path, "a", (0.0, 0.0, 0.1))).machine.layout
    height = dict(zip(layout.bodies, layout.centres[:, 2], strict=True))
    assert [height[name] for name in "acbz"] == pytest.approx(expected, abs=1e-12)


def test_a_machine_of_included_files_takes_a_stage(write, out):
    write(f"<mujoco>{mass_on_spring(40, 4e6, 90)}</mujoco>", "body.xml")
    main = write(mjcf('<include file="body.xml"/>'), "main.xml")
    stage = write(mjcf(mass_on_spring(2, 2e5, 30, name="b", node=2)))
    machine = combine(load_machine(main), out, MountedStage(stage, "a", "acc1")).machine
    assert machine.layout.bodies == ("a", "b")


@pytest.mark.parametrize("fused", ["machine", "stage"])
def test_welded_bodies_that_a_file_fuses_weigh_as_much(from_text, write, out, fused):
    base = random_tree(3)  # one of its bodies is welded
    inner = random_tree(11).split("<worldbody>")[1].split("</worldbody>")[0]
    stage = mjcf(inner.replace('"b', '"s').replace('"w', '"v').replace('"acc', '"acc2'))
    fusing = 'angle="radian" fusestatic="true"'
    texts = {"machine": base, "stage": stage}
    texts[fused] = texts[fused].replace('angle="radian"', fusing)
    place = MountedStage(write(texts["stage"]), "b0", (0.0, 0.1, 0.2))
    loaded = combine(from_text(texts["machine"]), out, place).machine
    plain = MountedStage(write(stage, "plain.xml"), "b0", (0.0, 0.1, 0.2))
    expected = combine(from_text(base), out, plain).machine
    request = random_request(expected, FREQ_HZ, n_out=6, n_in=2)
    assert worst_of_channels(frfs(loaded, request), frfs(expected, request)) < 1e-9


BOX = '<body name="b"><joint name="b_j" type="{}"/><geom size="0.1" density="100"/>{}</body>'
REFUSED = {
    "no such body": (BOX.format("slide", ""), "", "nobody", "acc1", "has no moving body 'nobody'"),
    "no such site": (BOX.format("slide", ""), "", "a", "acc2", r"no site 'acc2'.*acc1"),
    "no body": ("<site/>", "", "a", "acc1", "has no body to mount"),
    "free joint": (BOX.format("free", ""), "", "a", "acc1", "free joint can only be used on top"),
    "contact": (
        BOX.format("slide", '<body name="c" pos="0 0 0.1"><joint name="c_j" type="slide"/>'
                   '<geom size="0.05"/><body name="d" pos="0 0 0.02"><joint name="d_j" '
                   'type="slide"/><geom size="0.05"/></body></body>'),
        "", "a", "acc1", "contact between",
    ),
    "equality": (
        BOX.format("slide", "") , "<equality><weld body1='b'/></equality>", "a", "acc1",
        "to its world",
    ),
    "wrapped geom": (
        '<geom name="pin" type="cylinder" size="0.01 0.1"/><site name="p"/>'
        + BOX.format("slide", '<site name="q" pos="0.2 0 0"/>'),
        '<tendon><spatial><site site="p"/><geom geom="pin"/><site site="q"/></spatial></tendon>',
        "a", "acc1", "1 of its tendons cannot be mounted",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_mounted_is_refused_with_a_sentence(from_text, write, out, case):
    bodies, extra, body, place, message = REFUSED[case]
    machine = from_text(mjcf(mass_on_spring(40, 4e6, 90)))
    stage = write(mjcf(bodies, extra=extra))
    with pytest.raises(InputError, match=message) as caught:
        combine(machine, out, MountedStage(stage, body, place))
    assert str(out) not in str(caught.value)


def test_a_body_of_an_attached_model_cannot_be_edited(write, out):
    write(mjcf(mass_on_spring(40, 4e6, 90)), "part.xml")
    main = write(
        '<mujoco><asset><model name="part" file="part.xml"/></asset><worldbody>'
        '<frame><attach model="part" prefix="p_"/></frame></worldbody></mujoco>', "main.xml",
    )  # fmt: skip
    with pytest.raises(InputError, match="no <body> element named 'p_a'"):
        combine(load_machine(main), out, None, [PointMass("p_a", 3.0, (0.0, 0.0, 0.0))])
