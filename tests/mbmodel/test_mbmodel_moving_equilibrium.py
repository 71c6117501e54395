"""Hung and preloaded machines: their equilibrium follows stiffness, masses and joints."""

from dataclasses import replace

import numpy as np
import pytest
from closed_machines import hexapod, linkage
from hung_machines import GRAVITY, Bob, hung_chain
from mbmodel_examples import STATION, mass_on_spring, mjcf, taut, worst_of_channels
from test_mbmodel_parts import off, rebuilt
from test_mbmodel_slopes import worst_column

from identification.readers.controller import controller_from_roots
from identification.words import Dof, Loop, PortSum, Signal
from mbmodel import (
    FrfRequest,
    Model,
    as_drawn,
    body_parts,
    energy_shares,
    joint_parts,
    linearise,
    load_machine,
    model_modes,
    spring_parts,
    with_loops,
)

FREQ = np.array([0.4, 0.9, 2.0, 5.5, 13.0, 21.0])
BOB = Bob()


def everything(machine):
    return Model(machine, spring_parts(machine) + body_parts(machine) + joint_parts(machine))


def at(model, **factors):
    """Theta with some parameters multiplied."""
    theta = model.drawn.copy()
    for k, parameter in enumerate(model.parameters):
        theta[k] *= factors.get(parameter.name.replace(".", "_"), 1.0)
    return theta


def accelerances(machine):
    """Return a request of all motions of the accelerometers, per two forces and a torque."""
    points = [point for point in machine.layout.points if point.startswith("acc")]
    outputs = tuple(Dof.of(point, axis) for point in points for axis in range(6))
    inputs = tuple(Dof.of(points[-1], axis) for axis in (0, 2, 4))
    return FrfRequest(FREQ, outputs, inputs)


def inclined_strut():
    """A mass on a slide, pressed by a strut at an angle whose spring is preloaded by half."""
    text = (
        '<site name="foot" pos="-0.3 0 -0.4"/><body name="a"><inertial pos="0 0 0" mass="2" '
        'diaginertia="1 1 1"/><joint name="a_x" type="slide" axis="1 0 0" stiffness="900" '
        'damping="2"/><joint name="a_z" type="slide" axis="0 0 1" stiffness="4000" damping="3"/>'
        '<site name="head"/><site name="acc1" pos="0.1 0 0"/></body>'
    )
    strut = (
        '<tendon><spatial name="strut" stiffness="2000" springlength="0.6">'
        '<site site="foot"/><site site="head"/></spatial></tendon>'
    )
    return mjcf(text).replace("</mujoco>", f"{strut}</mujoco>")


MACHINES = {
    "bob": BOB.text,
    "chain": hung_chain,
    "taut": lambda: taut(0.02)[0],
    "strut": inclined_strut,
    "linkage": linkage,
    "platform": lambda: hexapod(stiffness=2e4, foot_stiffness=0.2),
}


@pytest.mark.parametrize("factor", [0.5, 1.5, 4.0])
def test_a_stiffer_wire_carries_the_same_weight(from_text, factor):
    # Closed form of the tuned bob, and the pendulum's frequencies of its length at rest.
    model = as_drawn(from_text(BOB.text()))
    tuned = replace(BOB, stiffness=factor * BOB.stiffness)
    freq = np.linspace(0.2, 40, 60)
    outputs = tuple(Dof(f"acc{k}", f"+t{axis}") for k in (1, 2) for axis in "xz")
    request = FrfRequest(freq, outputs, outputs[:2], "accelerance")
    values = linearise(model, at(model, wire_stiffness=factor), request).values
    expected = tuned.accelerances(freq)
    assert np.abs(values - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_heavier_bob_stretches_its_wire(from_text):
    model = everything(from_text(BOB.text()))
    theta = at(model, bob_mass=1.3)
    stretch = 1.3 * BOB.mass * GRAVITY / BOB.stiffness
    pose = model.at_rest(theta).machine.pose
    assert pose.centres[0, 2] == pytest.approx(-BOB.length - BOB.depth - stretch, rel=1e-10)


@pytest.mark.parametrize("name", MACHINES)
def test_the_tuned_file_loaded_anew_answers_as_the_tuned_parameters(from_text, name, tmp_path):
    model = everything(from_text(MACHINES[name]()))
    assert model.machine.statics is not None
    theta = off(model, amount=0.3)
    again, missing = rebuilt(model, theta, tmp_path)
    assert not missing
    values, drawn, expected = (
        linearise(of, at_theta, accelerances(model.machine)).values
        for of, at_theta in ((model, theta), (model, model.drawn), (again, again.drawn))
    )
    assert worst_of_channels(values, expected) < 1e-8
    assert worst_of_channels(values, drawn) > 1e-2


def test_the_pose_of_the_tuned_parameters_is_that_of_the_file_loaded_anew(from_text, tmp_path):
    model = everything(from_text(hung_chain()))
    theta = off(model, seed=3, amount=0.3)
    again, _ = rebuilt(model, theta, tmp_path)
    centres = again.machine.layout.positions - model.machine.layout.positions
    assert np.abs(centres).max() > 1e-3
    posed = model.at_rest(theta).machine
    layout = model.machine.layout
    arms = layout.positions - layout.centres[layout.body_of]
    turned = np.einsum("bij,bj->bi", posed.pose.turns[layout.body_of], arms)
    np.testing.assert_allclose(
        posed.pose.centres[layout.body_of] + turned, again.machine.layout.positions, atol=1e-9
    )


@pytest.mark.parametrize("name", MACHINES)
def test_slopes_go_through_the_equilibrium(from_text, name):
    machine = from_text(MACHINES[name]())
    model = everything(machine)
    theta = off(model, amount=0.2)
    request = accelerances(machine)
    lines = linearise(model, theta, request)
    sizes = np.array([_size(parameter) for parameter in model.parameters])
    # A turned triad of slides and hinges changes next to nothing, and no fit varies it. Of large
    # machines some parameters are enough: springs, bodies and joints are among them.
    varies = np.array([parameter.known != "exactly" for parameter in model.parameters])
    stride = {"chain": 3, "platform": 25}.get(name, 1)
    varies[np.setdiff1d(np.arange(len(varies)), np.flatnonzero(varies)[::stride])] = False
    columns = (lines.columns() * sizes)[..., varies]
    expected = _differences(model, theta, request, sizes, np.flatnonzero(varies))
    # The search for equilibrium leaves 1e-11 of the weight, 1e-8 of a column in the differences.
    assert worst_column(columns, expected, lines.values) < 5e-6
    weights = np.random.default_rng(7).normal(size=(2, *lines.values.shape))
    cotangent = weights[0] + 1j * weights[1]
    gradient = (lines.gradient(cotangent) * sizes)[varies]
    contraction = np.einsum("foi,foip->p", cotangent.conj(), columns).real
    np.testing.assert_allclose(gradient, contraction, atol=1e-9 * np.abs(contraction).max())


def test_slopes_go_through_the_equilibrium_and_a_control_loop(from_text):
    machine = from_text(hung_chain())
    controller = controller_from_roots([-50.0], [-600.0, -900.0], 4e7)
    measured = PortSum("damper", ((Dof.parse("acc1:+tx"), 1.0), (Dof.parse("low:+tx"), -1.0)), "m")
    loop = Loop("damper", Signal("acc2-acc1:+tx"), measured, controller, "N", 1e-3)
    machine = with_loops(machine, [loop])
    model = everything(machine)
    theta, request = off(model, amount=0.2), accelerances(machine)
    lines = linearise(model, theta, request)
    sizes = np.array([_size(parameter) for parameter in model.parameters])
    known = [parameter.known == "exactly" for parameter in model.parameters]
    numbers = np.flatnonzero(~np.array(known))[::5]
    columns = (lines.columns() * sizes)[..., numbers]
    expected = _differences(model, theta, request, sizes, numbers)
    # The loop amplifies what the search for equilibrium leaves in the differences.
    assert worst_column(columns, expected, lines.values) < 5e-5
    open_lines = linearise(everything(with_loops(machine, [])), theta, request)
    assert np.abs(lines.values / open_lines.values - 1).max() > 0.1, "the loop matters"


def _size(parameter):
    return 0.1 * parameter.drawn if parameter.positive else 1e-2


def _differences(model, theta, request, sizes, numbers):
    """Fourth-order central differences by some parameters, each in its size."""
    columns = []
    for k in numbers:
        step = 3e-3 * sizes[k] * np.eye(len(theta))[k]
        values = [linearise(model, theta + m * step, request).values for m in (1, -1, 2, -2)]
        columns.append((8 * (values[0] - values[1]) - (values[2] - values[3])) / 12 / 3e-3)
    return np.stack(columns, axis=-1)


def test_energy_and_modes_are_those_of_the_file_loaded_anew(from_text, tmp_path):
    model = everything(from_text(hung_chain()))
    theta = off(model, seed=2, amount=0.3)
    again, _ = rebuilt(model, theta, tmp_path)
    modes, expected = model_modes(model, theta), model_modes(again, again.drawn)
    np.testing.assert_allclose(modes.freq_hz, expected.freq_hz, rtol=1e-7)
    shares, of_file = (
        energy_shares(m, t, of)
        for m, t, of in ((model, theta, modes), (again, again.drawn, expected))
    )
    np.testing.assert_allclose(shares.strain, of_file.strain, atol=1e-5)


@pytest.mark.parametrize(
    "text",
    [
        STATION.read_text(encoding="utf-8"),
        mjcf(mass_on_spring(4, 3e4, 7)),
        mjcf(mass_on_spring(4, 3e7, 7), gravity="0 0 -9.81"),
        mjcf(mass_on_spring(4, 3e7, 7), gravity="0 0 -9.81").replace(
            'name="a_j"', f'name="a_j" springref="{4 * GRAVITY / 3e7:.17g}"'
        ),
    ],
    ids=["station", "at rest", "sags", "held by its reference"],
)
def test_an_equilibrium_that_does_not_matter_costs_nothing(tmp_path, text):
    path = tmp_path / "model.xml"
    path.write_text(text.replace('meshdir="meshes"', f'meshdir="{STATION.parent / "meshes"}"'))
    model = as_drawn(load_machine(path))
    assert model.machine.statics is None
    assert model.at_rest(2 * model.drawn) is model


def test_the_same_equilibrium_is_sought_once(from_text):
    model = as_drawn(from_text(BOB.text()))
    theta = at(model, wire_stiffness=1.5)
    first = model.at_rest(theta)
    damped = theta.copy()
    damped[[p.name for p in model.parameters].index("wire.damping")] *= 2
    assert model.at_rest(theta) is first
    assert model.at_rest(model.drawn) is model
    assert model.at_rest(damped).machine.pose.position == pytest.approx(
        first.machine.pose.position, abs=1e-15
    )
