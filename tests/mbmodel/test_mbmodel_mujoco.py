"""The linear model against differences of MuJoCo's accelerations, for machines of every kind."""

import mujoco
import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, numbers
from scipy.spatial.transform import Rotation

from identification.words import InputError
from mbmodel import (
    Model,
    as_drawn,
    body_parts,
    joint_parts,
    load_machine,
    model_edits,
    model_modes,
    spring_parts,
    write_mjcf,
)
from mbmodel.linearisation.equilibrium import find_equilibrium

JOINTS = ("slide", "hinge", "ball", "slides and hinges", "free")


def machine_text(seed, *, first="slide", gravity="1.1 -0.7 -9.6", tendons=True):
    """Two or three stages of mixed joints under gravity, on springs and spatial tendons."""
    rng = np.random.default_rng(seed)

    def place(size):
        return numbers(rng.uniform(-size, size, 3))

    def joint(name, kind):
        stiffness = 10 ** rng.uniform(3.2, 4.2)
        return (
            f'<joint name="{name}" type="{kind}" axis="{place(1)}" pos="{place(0.1)}" '
            f'stiffness="{stiffness:.6g}" damping="{stiffness / 300:.6g}" '
            f'armature="{rng.choice([0, 0.02])}"/>'
        )

    def joints(name, kind):
        if kind == "free":
            return f'<joint name="{name}" type="free" damping="2"/>'
        if kind == "ball":
            return f'<joint name="{name}" type="ball" pos="{place(0.1)}" damping="1.5"/>'
        if kind == "slides and hinges":
            return "".join(
                joint(f"{name}{k}", way) for k, way in enumerate(("hinge", "slide", "hinge"))
            )
        return joint(name, kind)

    def body(name, kind, inner):
        turn = Rotation.random(random_state=int(rng.integers(1 << 31))).as_quat()
        return (
            f'<body name="{name}" pos="{place(0.3)}" quat="{numbers(turn)}">'
            f'<inertial pos="{place(0.1)}" mass="{rng.uniform(1, 4):.4g}" '
            'fullinertia="0.11 0.12 0.13 0.01 0.02 0.03"/>'
            f"{joints(name, kind)}{inner}"
            + "".join(f'<site name="{name}_s{j}_" pos="{place(0.4)}"/>' for j in range(6))
            + "</body>"
        )

    chain = body("b", str(rng.choice(JOINTS[:4])), "")
    text = body("a", first, chain)
    anchors = "".join(
        f'<site name="w{k}_{j}_" pos="{place(1.0)}"/>' for k in "ab" for j in range(6)
    )
    ropes = "".join(
        f'<spatial name="rope{k}{j}" stiffness="{10 ** rng.uniform(3.5, 4.2):.5g}" damping="6" '
        f'springlength="{rng.uniform(0.1, 0.4):.3g}"><site site="w{k}_{j}_"/>'
        f'<site site="{k}_s{j}_"/></spatial>'
        for k in "ab"
        for j in range(6)
    )
    whole = mjcf(anchors + text, gravity=gravity)
    return whole.replace("</mujoco>", f"<tendon>{ropes}</tendon></mujoco>") if tendons else whole


def accelerations(path, qpos, velocity=None, start=None):
    """Slopes of MuJoCo's qacc by position and velocity at a pose, fourth-order differences."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    if start is not None:
        data.ctrl[:] = start.ctrl
        data.mocap_pos[:], data.mocap_quat[:] = start.mocap_pos, start.mocap_quat
    steady = np.zeros(model.nv) if velocity is None else velocity

    def at(move, rate):
        data.qpos[:], data.qvel[:] = qpos, steady + rate
        mujoco.mj_integratePos(model, data.qpos, move, 1.0)
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    slopes = []
    h = 1e-4
    for which in (0, 1):
        columns = []
        for unit in np.eye(model.nv):
            moves = [(k * h * unit, 0 * unit)[:: 1 if which == 0 else -1] for k in (1, -1, 2, -2)]
            a, b, c, d = (at(*move) for move in moves)
            columns.append((8 * (a - b) - (c - d)) / (12 * h))
        slopes.append(np.array(columns).T)
    return slopes


def assert_linear_model_is_mujocos(path, *, within=1e-6):
    machine = load_machine(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    rest = find_equilibrium(model, path, mujoco.MjData(model))
    matrices = as_drawn(machine).matrices(as_drawn(machine).drawn)
    by_position, by_velocity = accelerations(path, rest.data.qpos)
    for matrix, reference in (
        (-np.linalg.solve(matrices.mass, matrices.stiffness), by_position),
        (-np.linalg.solve(matrices.mass, matrices.damping), by_velocity),
    ):
        assert np.abs(matrix - reference).max() < within * np.abs(reference).max()
    return machine, rest


@pytest.mark.parametrize("first", JOINTS)
@pytest.mark.parametrize("seed", range(4))
def test_stiffness_and_damping_are_the_slopes_of_mujocos_accelerations(tmp_path, first, seed):
    path = tmp_path / "m.xml"
    path.write_text(machine_text(seed, first=first))
    machine, rest = assert_linear_model_is_mujocos(path)
    assert np.abs(rest.displacement).max() > 1e-3  # it sags
    model = as_drawn(machine)
    stiffness = model.matrices(model.drawn).stiffness
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-6 * np.abs(stiffness).max())


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_gravcomp_takes_its_share_of_the_weight(tmp_path, share):
    text = machine_text(3, first="hinge").replace(
        '<body name="b"', f'<body name="b" gravcomp="{share}"'
    )
    path = tmp_path / "m.xml"
    path.write_text(text)
    assert_linear_model_is_mujocos(path)


@pytest.mark.parametrize("seed", range(6))
def test_hanging_chains_come_to_rest_below(tmp_path, seed):
    rng = np.random.default_rng(seed)
    chain = ""
    for k in reversed(range(int(rng.integers(2, 7)))):
        chain = (
            f'<body name="c{k}" pos="0 0 {-0.3 if k else 0}" '
            f'quat="{numbers(np.append(1.0, rng.uniform(-0.3, 0.3, 3)))}">'
            '<inertial pos="0 0 -0.15" mass="2" diaginertia="0.02 0.02 0.01"/>'
            f'<joint name="x{k}" type="hinge" axis="1 0 0"/>'
            f'<joint name="y{k}" type="hinge" axis="0 1 0"/>{chain}</body>'
        )
    path = tmp_path / "chain.xml"
    path.write_text(mjcf(chain, gravity="0 0 -9.81"))
    machine = load_machine(path)
    model = as_drawn(machine)
    assert np.linalg.eigvalsh(model.matrices(model.drawn).stiffness).min() > 0
    assert (np.diff(machine.layout.centres[:, 2]) < 0).all()
    assert np.abs(machine.layout.centres[:, :2]).max() < 1e-6
    assert any("from the drawing" in remark for remark in machine.remarks)


def pendulum(angle):
    return mjcf(
        f'<body name="bob" euler="0 {angle} 0"><inertial pos="0 0 -0.5" mass="3" '
        'diaginertia="0.1 0.1 0.1"/><joint name="pivot" type="hinge" axis="0 1 0"/></body>',
        gravity="0 0 -9.81",
    )


@pytest.mark.parametrize("angle", [0.5, 2.0, -3.0])
def test_a_pendulum_drawn_high_is_linearised_where_it_hangs(from_text, angle):
    machine = from_text(pendulum(angle))
    assert machine.layout.centres[0, 2] == pytest.approx(-0.5, abs=1e-9)
    (remark,) = machine.remarks
    assert f"'pivot' is displaced by {-angle:.3g}" in remark


def test_a_pendulum_drawn_upright_stays_and_is_said_to_be_unstable(from_text):
    machine = from_text(pendulum(np.pi))
    assert machine.layout.centres[0, 2] == pytest.approx(0.5, abs=1e-9)
    (remark,) = machine.remarks
    assert "equilibrium is unstable" in remark


def test_a_machine_at_rest_as_drawn_has_nothing_remarked(station):
    assert station.remarks == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="free"', 'type="free" stiffness="1000"', "'a' is free and has stiffness"),
        ("<option", '<option><flag spring="disable"/></option><option', 'flag spring="disable"'),
        ("<option", '<option><flag damper="disable"/></option><option', 'flag damper="disable"'),
    ],
)
def test_springs_that_would_be_lost_are_refused(from_text, old, new, message):
    with pytest.raises(InputError, match=message):
        from_text(machine_text(0, first="free").replace(old, new, 1))


def sagging():
    """A body that sags by some degrees on hinges and a slide, with a motor at a site."""
    body = (
        '<body name="a"><inertial pos="0.3 0.1 0.05" mass="3" fullinertia="0.3 0.4 0.5 0 0 0.02"/>'
        '<joint name="rx" type="hinge" axis="1 0 0" pos="0 0.02 0" stiffness="100" damping="1"/>'
        '<joint name="z" type="slide" axis="0 0.1 1" stiffness="4e3" damping="2"/>'
        '<joint name="ry" type="hinge" axis="0 1 0" pos="0.01 0 0" stiffness="100" damping="1"/>'
        '<site name="acc1" pos="0.4 0.2 0.1" euler="0.2 0.1 0"/></body>'
    )
    motor = '<actuator><general name="push" site="acc1" gear="1 0.3 0.2 0.1 0 0"/></actuator>'
    return mjcf(body, gravity="0 0 -9.81").replace("</mujoco>", f"{motor}</mujoco>")


def test_nothing_is_written_where_nothing_changed(from_text):
    machine = from_text(sagging())
    parts = spring_parts(machine) + body_parts(machine) + joint_parts(machine)
    model = Model(machine, parts)
    assert model_edits(model, model.drawn) == ()


def test_turned_joints_of_a_machine_that_sags_are_written_in_their_own_frames(from_text, tmp_path):
    machine = from_text(sagging())
    model = Model(machine, joint_parts(machine))
    theta = np.array([0.0, 0, 0, 0, 0, 1e-5])
    target = tmp_path / "turned.xml"
    assert write_mjcf(machine.source, target, model_edits(model, theta)) == ()
    again = load_machine(target)
    change = again.jacobian - machine.jacobian
    expected = model.assemble(theta).jacobian - machine.jacobian
    # The new sag differs by some 1e-6 rad more.
    assert np.abs(expected - change).max() < 0.2 * np.abs(expected).max()


def test_a_motor_at_a_site_follows_when_joints_move(from_text, tmp_path):
    text = sagging().replace("-9.81", "0")
    machine = from_text(text)
    model = Model(machine, spring_parts(machine) + joint_parts(machine))
    theta = model.drawn.copy()
    theta[-6:] = 0.02, -0.03, 0.01, 0.1, -0.05, 0.08
    target = tmp_path / "moved.xml"
    write_mjcf(machine.source, target, model_edits(model, theta))
    again = load_machine(target).motors["push"]
    drive = machine.motors["push"]
    column = drive.joint + model.assemble(theta).jacobian.T @ drive.body
    expected = again.joint + load_machine(target).jacobian.T @ again.body
    np.testing.assert_allclose(column, expected, atol=1e-9)
    assert np.abs(column - drive.joint - machine.jacobian.T @ drive.body).max() > 1e-2


def test_a_stage_whose_own_body_weighs_nothing_says_so(from_text):
    text = mass_on_spring(4.0, 3e4, 11.0).replace(
        '<inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/>',
        '<body name="w"><inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body>',
    )
    machine = from_text(mjcf(text))
    model = Model(machine, body_parts(machine))
    assert model_edits(model, model.drawn) == ()
    theta = model.drawn.copy()
    theta[0] *= 0.9
    (missing,) = model_edits(model, theta)
    assert "would not be positive" in str(missing)


def test_unnamed_sites_are_no_sensors(from_text):
    text = mass_on_spring(4.0, 3e4, 11.0).replace("<site", "<site/><site/><site")
    assert from_text(mjcf(text)).layout.points == ("acc1",)


def test_a_floating_pair_beside_a_machine_on_the_floor_is_named_as_one(from_text):
    free = '<body name="f"><freejoint/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>'
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0) + free)))
    names = [name for name in model_modes(model, model.drawn).names if name]
    assert names == [f"rigid {way} of f" for way in ("tx", "ty", "tz", "rx", "ry", "rz")]


def test_a_damped_free_drive_is_named(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 0, 11.0))))
    modes = model_modes(model, model.drawn)
    assert modes.names[0] == "rigid tz"
    assert modes.poles[0] == 0


def test_a_soft_spring_beside_a_hard_one_is_no_rigid_motion(from_text):
    inner = mass_on_spring(1e-3, 1e10, 1.0, name="b", node=2)
    text = mass_on_spring(4.0, 0.01, 0.0).replace("</body>", inner + "</body>")
    model = as_drawn(from_text(mjcf(text)))
    modes = model_modes(model, model.drawn)
    assert modes.names == ("", "")
    assert modes.freq_hz[0] == pytest.approx(np.sqrt(0.01 / 4.001) / 2 / np.pi, rel=1e-3)
