"""Closed chains: reduced equations, equilibria, reactions and derivatives against closed forms."""

from itertools import combinations_with_replacement

import mujoco
import numpy as np
import pytest
from closed_machines import (
    GRAVITY,
    geared_pendulum,
    hexapod,
    linkage,
    platform_points,
    slider_crank,
)
from exudyn_chains import exudyn_hexapod_hz
from mbmodel_examples import STATION
from mpmath import acos, atan2, cos, diff, findroot, matrix, mp, mpf, sin, sqrt

from identification.words import Dof, InputError, Signal
from mbmodel import (
    Evaluator,
    FrfRequest,
    as_drawn,
    load_machine,
    model_modes,
    respond_linearly,
    simulate,
)
from mbmodel.mjcf.read import Reading, read_as

mp.dps = 30


def matrices(machine):
    """Mass, damping and stiffness matrix of the nominal model."""
    model = as_drawn(machine)
    return model.matrices(model.drawn)


def linkage_motion(q):
    """Centres of mass (x, z) and angles of crank, coupler and rocker at a crank angle."""
    a, b, c, ground = mpf("0.3"), mpf("0.5"), mpf("0.4"), (mpf("0.5"), mpf("-0.1"))
    pin = (a * sin(q), a * cos(q))
    dx, dz = pin[0] - ground[0], pin[1] - ground[1]
    reach = sqrt(dx**2 + dz**2)
    rocker = atan2(dx, dz) + acos((c**2 + reach**2 - b**2) / (2 * c * reach))
    end = (ground[0] + c * sin(rocker), ground[1] + c * cos(rocker))
    turn = atan2(pin[1] - end[1], end[0] - pin[0])  # x turns towards -z about y
    centres = [
        (mpf("0.02") * cos(q) + mpf("0.15") * sin(q), -mpf("0.02") * sin(q) + mpf("0.15") * cos(q)),
        (
            pin[0] + mpf("0.25") * cos(turn) + mpf("0.03") * sin(turn),
            pin[1] - mpf("0.25") * sin(turn) + mpf("0.03") * cos(turn),
        ),
        (ground[0] + mpf("0.2") * sin(rocker), ground[1] + mpf("0.2") * cos(rocker)),
    ]
    return centres, [q, turn, rocker]


def slider_motion(q):
    """Return centres of mass and angles of crank, rod and piston."""
    pin = (mpf("0.2") * sin(q), mpf("0.2") * cos(q))
    reach = sqrt(mpf("0.25") - pin[1] ** 2)
    piston = pin[0] + reach
    centres = [(pin[0] / 2, pin[1] / 2), (pin[0] + reach / 2, pin[1] / 2), (piston, mpf(0))]
    return centres, [q, atan2(pin[1], reach), mpf(0)]


def gear_motion(q):
    """Return centres of mass and angles of pendulum and wheel."""
    return [(-mpf("0.4") * sin(q), -mpf("0.4") * cos(q)), (mpf(1), mpf(0))], [
        q,
        2 * q + mpf("0.7") * q**2,
    ]


def spring(stiffness, rest):
    return lambda x: stiffness * (x - rest) ** 2 / 2


# Motion, masses, moments of inertia, and the energy of springs by centres and angles.
PLANAR = {
    "linkage": (
        linkage(),
        linkage_motion,
        (1.3, 0.9, 0.7),
        (0.2, 0.3, 0.1),
        lambda c, a: spring(9, mpf("0.5"))(a[0]) + spring(4, 0)(a[2]),
    ),
    "slider": (
        slider_crank(),
        slider_motion,
        (2, 0.6, 1.5),
        (0.01, 0.02, 1),
        lambda c, a: spring(30, 0)(a[0]) + spring(200, mpf("0.1"))(c[2][0] - sqrt(mpf("0.21"))),
    ),
    "gear": (
        geared_pendulum(),
        gear_motion,
        (2, 1),
        (0.01, 0.3),
        lambda c, a: spring(3, mpf("0.4"))(a[0]) + spring(5, mpf("0.9"))(a[1]),
    ),
}


@pytest.mark.parametrize("name", PLANAR)
def test_a_planar_chain_has_mass_and_stiffness_of_its_closed_form(from_text, name):
    # K = V'' and M = sum m c'^2 + I a'^2 by the crank's angle, where V' = 0: gravity, preload and
    # the reactions that hold them are in V.
    text, motion, masses, inertias, energy = PLANAR[name]
    masses, inertias = ([mpf(str(v)) for v in values] for values in (masses, inertias))

    def potential(q):
        centres, angles = motion(q)
        weight = sum(m * mpf(str(GRAVITY)) * c[1] for m, c in zip(masses, centres, strict=True))
        return weight + energy(centres, angles)

    machine = from_text(text)
    assert machine.coordinates == (text.split('joint name="')[1].split('"')[0],)
    rest = findroot(lambda q: diff(potential, q), 0.1)
    assert diff(potential, rest, 2) > 0
    moments = [
        m * sum(diff(lambda q, k=k, x=x: motion(q)[0][k][x], rest) ** 2 for x in (0, 1))
        + i * diff(lambda q, k=k: motion(q)[1][k], rest) ** 2
        for k, (m, i) in enumerate(zip(masses, inertias, strict=True))
    ]
    reduced = matrices(machine)
    assert reduced.mass[0, 0] == pytest.approx(float(sum(moments)), rel=1e-9)
    assert reduced.stiffness[0, 0] == pytest.approx(float(diff(potential, rest, 2)), rel=1e-9)


def platform_energy(stiffness, gravity):
    """Return the energy of a platform on massless legs by its six coordinates."""
    low, high = platform_points()
    rest = [mpf(float(v)) for v in np.linalg.norm(high - low, axis=1)]

    def energy(*x):
        turns = [_turn(axis, x[3 + axis]) for axis in range(3)]
        turn = turns[0] * turns[1] * turns[2]
        place = matrix([x[0], x[1], x[2] + mpf("0.18")])
        total = 15 * mpf(gravity) * (place + turn * matrix([0, 0, mpf("0.02")]))[2]
        for foot, head, length in zip(low, high, rest, strict=True):
            arm = matrix([mpf(float(v)) for v in (head - [0, 0, 0.18])])
            leg = place + turn * arm - matrix([mpf(float(v)) for v in foot])
            total += stiffness * (sqrt(leg[0] ** 2 + leg[1] ** 2 + leg[2] ** 2) - length) ** 2 / 2
        return total

    return energy


def _turn(axis, angle):
    turn = matrix(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn[axis, axis], turn[i, i], turn[j, j] = 1, cos(angle), cos(angle)
    turn[i, j], turn[j, i] = -sin(angle), sin(angle)
    return turn


def _hessian(energy, place):
    result = np.zeros((6, 6))
    for i, j in combinations_with_replacement(range(6), 2):
        order = [0] * 6
        order[i] += 1
        order[j] += 1
        result[i, j] = result[j, i] = float(diff(energy, tuple(place), tuple(order)))
    return result


def test_a_platform_on_massless_legs_has_the_stiffness_of_its_legs(from_text):
    # Soft legs sag by some mm, so that their tension and the weight stiffen and soften.
    stiffness = 2e4
    machine = from_text(hexapod(leg_mass=0, stiffness=stiffness, foot_stiffness=0))
    energy = platform_energy(mpf(stiffness), str(GRAVITY))
    place = np.zeros(6)
    for _ in range(6):
        gradient = [
            float(diff(energy, tuple(place), tuple(int(k == i) for k in range(6))))
            for i in range(6)
        ]
        place -= np.linalg.solve(_hessian(energy, place), gradient)
    expected = _hessian(energy, place)
    assert abs(place[2]) > 1e-3
    reduced = matrices(machine)
    assert machine.coordinates[2] == "platform_tz"
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(reduced.stiffness / scale, expected / scale, atol=1e-9)
    unloaded = _hessian(platform_energy(mpf(stiffness), "0"), np.zeros(6))
    assert np.abs((expected - unloaded) / scale).max() > 1e-2, "the load matters"


def test_a_hexapod_has_the_modes_of_exudyn(from_text):
    machine = from_text(hexapod(gravity=0.0, foot_stiffness=900.0))
    model = as_drawn(machine)
    np.testing.assert_allclose(
        model_modes(model, model.drawn).freq_hz, exudyn_hexapod_hz(foot_stiffness=900.0), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("text", "stiffness"),
    [(linkage(), 1e3), (hexapod(stiffness=2e4, foot_stiffness=0.2), 1e7)],
    ids=["linkage", "platform"],
)
def test_soft_constraints_of_mujoco_tend_to_the_chain(tmp_path, text, stiffness):
    # A soft constraint is a spring k/R across the gap: the difference falls with 1/k.
    model = as_drawn(load_machine(_write(tmp_path, text)))
    expected = model_modes(model, model.drawn).freq_hz
    errors = []
    for factor in (1, 10):
        solver = f'solref="-{factor * stiffness} -10" solimp="0.5 0.5"'
        soft = text.replace("<connect ", f"<connect {solver} ")
        with read_as(Reading(soft_equalities=True)):
            machine = load_machine(_write(tmp_path, soft))
        assert any("gives way as in MuJoCo" in remark for remark in machine.remarks)
        model = as_drawn(machine)
        found = model_modes(model, model.drawn).freq_hz[: len(expected)]
        errors.append(np.abs(found / expected - 1).max())
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)


def _write(folder, text):
    path = folder / "machine.xml"
    path.write_text(text)
    return path


def test_soft_constraints_move_as_mujoco_computes(tmp_path):
    # Central differences of MuJoCo's own accelerations, by its own solver, at its own rest.
    path = _write(tmp_path, linkage().replace("<connect ", '<connect solref="0.05 0.7" '))
    with read_as(Reading(soft_equalities=True)):
        machine = load_machine(path)
    reduced = matrices(machine)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.tolerance, model.opt.iterations = 0.0, 200
    data = mujoco.MjData(model)
    rest = machine.statics.pose

    def acceleration(change, rate):
        data.qpos[:], data.qvel[:] = rest + change, rate
        data.qacc_warmstart[:] = 0
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    steps = 1e-6 * np.eye(3)
    for matrix_, slopes in (
        (reduced.stiffness, [acceleration(s, 0) - acceleration(-s, 0) for s in steps]),
        (reduced.damping, [acceleration(0, s) - acceleration(0, -s) for s in steps]),
    ):
        expected = -np.linalg.solve(reduced.mass, matrix_)
        np.testing.assert_allclose(
            np.array(slopes).T / 2e-6, expected, atol=4e-6 * np.abs(expected).max()
        )


@pytest.mark.parametrize(
    ("text", "reaction", "follower", "pushed", "equation"),
    [
        (geared_pendulum(), "reaction_gear", "wheel", "bob:+rx", (5.0, 0.2, 0.3)),
        (slider_crank(), "reaction_wrist", "piston", "rod:+tz", (200.0, 0.0, 1.5)),
    ],
)
def test_the_reaction_moves_the_joint_that_follows(
    from_text, text, reaction, follower, pushed, equation
):
    # Only its spring, damper, inertia and the reaction act on it: l = (k + s c + s^2 m) q.
    machine = from_text(text)
    freq = np.array([0.3, 1.7, 6.0])
    outputs = Signal(f"joint:{follower}"), machine.layout.parse(reaction)
    model = as_drawn(machine)
    for drive in (Dof.parse(pushed.replace("rx", "ry")), Signal(f"joint:{follower}")):
        request = FrfRequest(freq, outputs, (drive,), "receptance")
        motion, force = Evaluator(model, request).at(model.drawn).frf().values[:, :, 0].T
        s = 2j * np.pi * freq
        expected = (equation[0] + s * equation[1] + s**2 * equation[2]) * motion
        expected -= float(isinstance(drive, Signal))
        np.testing.assert_allclose(force, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            linkage().replace("<equality>", '<equality><weld name="stuck" body1="crank"/>'),
            ["'stuck'", "nothing move"],
        ),
        (
            linkage()
            .replace('name="acc3" pos="0.02 0 0.3"', 'name="acc3" pos="0 0 3"')
            .replace(
                'body1="coupler" body2="rocker" anchor="0.5 0 0"', 'site1="acc2" site2="acc3"'
            ),
            ["'loop'", "closes"],
        ),
    ],
)
def test_a_chain_that_cannot_move_or_close_is_refused(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load_machine(_write(tmp_path, text))
    assert all(word in str(caught.value) for word in words)


def test_a_linkage_in_time_follows_its_reduced_equation(from_text):
    # MuJoCo's rigid limit of the loop against the exact response of the reduced linear model.
    machine = from_text(linkage(gravity=0.0, stiffness=900.0))
    time_s = np.arange(400) / 1000
    push = np.where(time_s < 0.01, np.sin(np.pi * time_s / 0.01) ** 2, 0.0)[:, None] * 1e-2
    labels = Dof.parse("acc2:+tz"), Dof.parse("acc3:+tx")
    response = simulate(machine, labels[:1], labels, time_s, push, quantity="receptance")
    model = as_drawn(machine)
    request = FrfRequest(np.zeros(1), labels, labels[:1], "receptance")
    linear = respond_linearly(model, model.drawn, request, time_s, push)
    scale = np.abs(linear).max(axis=0)
    assert np.abs((response.outputs - linear) / scale).max() < 5e-3


def test_a_hexapod_has_motors_encoders_and_a_state_space(from_text):
    machine = from_text(hexapod())
    model = as_drawn(machine)
    freq = np.array([20.0, 150.0, 270.0])
    outputs = tuple(machine.layout.parse(f"encoder{k}") for k in (1, 2, 3))
    inputs = tuple(machine.layout.parse(f"motor{k}") for k in (1, 2, 3))
    request = FrfRequest(freq, outputs, inputs, "receptance")
    values = Evaluator(model, request).at(model.drawn).frf().values
    np.testing.assert_allclose(values, values.swapaxes(1, 2), rtol=1e-9)  # reciprocity
    joints = tuple(Signal(f"joint:strut{k}") for k in (1, 2, 3))
    by_joint = Evaluator(model, FrfRequest(freq, joints, joints, "receptance"))
    np.testing.assert_allclose(by_joint.at(model.drawn).frf().values, values, rtol=1e-9)
    # A force along the strut stretches it by less than its own spring would let it alone.
    static = Evaluator(model, FrfRequest(np.array([0.0]), outputs, inputs, "receptance"))
    assert 0 < static.at(model.drawn).frf().values[0, 0, 0].real < 1 / 2e7


def test_the_reactions_of_a_weld_are_its_force_and_moment_in_world_axes(from_text):
    # A turned body on a slide carries a free one by a weld at its own origin, 0.3 m away.
    machine = from_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="a" quat="0.8 0.6 0 0">'
        '<joint name="z" type="slide" axis="0 0.96 0.28" stiffness="900"/>'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>'
        '<body name="c" pos="0.3 0 0"><freejoint name="free"/>'
        '<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body></worldbody>'
        '<equality><weld name="w" body1="c" body2="a" torquescale="0.7"/></equality></mujoco>'
    )
    assert machine.coordinates == ("z",)
    axle = machine.axles[0].axis
    names = ("reaction_w", *(f"reaction_w.{k}" for k in range(1, 6)))
    outputs = tuple(machine.layout.parse(name) for name in names)
    inputs = tuple(Dof.of("c", axis) for axis in range(6))
    freq = np.array([2.0])
    model = as_drawn(machine)
    values = Evaluator(model, FrfRequest(freq, outputs, inputs, "receptance"))
    found = values.at(model.drawn).frf().values[0]
    s = 2j * np.pi * freq[0]
    for axis in range(3):
        push = np.eye(3)[axis]
        acceleration = s**2 * axle * (axle @ push) / (900 + 5 * s**2)
        force = 3 * acceleration - push
        moment = -np.cross([-0.3, 0, 0], force)
        np.testing.assert_allclose(found[:, axis], [*force, *moment], atol=1e-6)
        np.testing.assert_allclose(found[:, 3 + axis], [0, 0, 0, *-push], atol=1e-6)


def test_a_chain_at_a_dead_centre_is_refused(tmp_path):
    # A flat parallelogram can leave its pose as a parallelogram and as a kite.
    bar = '<inertial pos="0.15 0 0" mass="1" diaginertia="0.03 0.02 0.03"/>'
    text = (
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="crank">'
        f'<joint name="crank" axis="0 1 0" stiffness="3"/>{bar}<body name="coupler" pos="0.3 0 0">'
        f'<joint name="pin" axis="0 1 0"/>{bar}</body></body><body name="rocker" pos="0.4 0 0">'
        f'<joint name="rocker" axis="0 1 0"/>{bar}</body></worldbody><equality>'
        '<connect name="loop" body1="coupler" body2="rocker" anchor="0.4 0 0"/></equality></mujoco>'
    )
    with pytest.raises(InputError, match=r"'loop'.* dead centre"):
        load_machine(_write(tmp_path, text))


def test_the_example_of_the_assets_is_the_hexapod(from_text):
    example, built = load_machine(STATION.parents[1] / "hexapod.xml"), from_text(hexapod())
    for name in ("mass", "damping", "stiffness"):
        first, second = getattr(matrices(example), name), getattr(matrices(built), name)
        np.testing.assert_allclose(first, second, atol=1e-12 * np.abs(second).max())
