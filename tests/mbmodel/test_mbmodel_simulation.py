"""The machine in time by MuJoCo: against the linear model, and by closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from small_machine import MJCF

from identification.words import ConvergenceError, Dof, UsageError
from mbmodel import (
    FrfRequest,
    GapSpring,
    PolynomialSpring,
    as_drawn,
    load_machine,
    respond_linearly,
    simulate,
    write_nonlinear_joints,
)
from mbmodel.simulation.drives import parse_drive, parse_reading
from mbmodel.simulation.time_step import Decimator, filter_taps

TIME_S = np.arange(0, 0.4, 1e-3)
PULSE = np.where(TIME_S < 0.012, 20 * np.sin(np.pi * TIME_S / 0.012) ** 2, 0.0)
SENSORS = (
    '<sensor><jointpos name="scale" joint="head_tx"/>'
    '<framelinvel name="speed" objtype="site" objname="acc3"/></sensor>'
)
MOTOR = SENSORS + '<actuator><motor name="drive" joint="head_tx" gear="3"/></actuator></mujoco>'


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("pair") / "pair.xml"
    text = MJCF.replace('gravity="0 0 0"', 'gravity="0 0 -9.81"').replace("</mujoco>", MOTOR)
    path.write_text(text, encoding="utf-8")
    return load_machine(path)


@pytest.mark.parametrize(
    ("drive", "quantity"),
    [
        ("acc3:-tx", "accelerance"),
        ("acc4:+rz", "mobility"),
        ("drive", "receptance"),
        ("floor:+tx", "accelerance"),
        ("floor:-tz", "receptance"),
    ],
)
def test_at_small_amplitude_the_motion_is_that_of_the_linear_model(machine, drive, quantity):
    inputs = (parse_drive(machine, drive),)
    outputs = tuple(Dof.parse(text) for text in ("acc1:+tx", "acc4:-rz", "head:+ty", "base:+ry"))
    small = 1e-2 * PULSE[:, None]
    model = as_drawn(machine)
    request = FrfRequest(np.ones(1), outputs, inputs, quantity)
    reference = respond_linearly(model, model.drawn, request, TIME_S, small)
    response = simulate(machine, inputs, outputs, TIME_S, small, quantity=quantity)
    size = np.sqrt((reference**2).mean(axis=0))
    error = np.sqrt(((response.outputs - reference) ** 2).mean(axis=0))
    counts = size > 1e-3 * size.max()
    assert counts.sum() > 1
    assert (error[counts] < 4e-3 * size[counts]).all()
    assert response.step.error < 3e-3


def test_a_joint_is_driven_and_read_by_its_name(machine):
    # A force at one slide moves it, long after, by force over stiffness.
    joint = parse_drive(machine, "joint:head_tx")
    reading = parse_reading(machine, "joint:head_tx")
    time_s = np.arange(0, 1.5, 2e-3)
    force = 8.0 * (1 - np.exp(-time_s / 0.05))
    response = simulate(machine, (joint,), (reading,), time_s, force[:, None])
    assert response.outputs[-1, 0] == pytest.approx(8.0 / 8e6, rel=2e-3)


def test_a_cubic_spring_moves_less_than_the_linear_model_says(tmp_path):
    # k x + k3 x^3 under a slow force: the static solution, 7 % less than the linear one.
    path = tmp_path / "cubic.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="mass">'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint name="mass_tx" type="slide" '
        'axis="1 0 0" stiffness="2e4 0 2e9" damping="120"/><site name="acc1"/>'
        "</body></worldbody></mujoco>",
        encoding="utf-8",
    )
    machine = load_machine(path)
    time_s = np.arange(0, 1.0, 2e-3)
    force = 20.0 * np.sin(np.pi * time_s / 2) ** 2
    response = simulate(
        machine,
        (Dof.parse("acc1:+tx"),),
        (Dof.parse("acc1:+tx"),),
        time_s,
        force[:, None],
        quantity="receptance",
    )
    static = max(np.roots([2e9, 0, 2e4, -20.0]).real)
    assert static < 0.94 * 20.0 / 2e4
    assert response.outputs[:, 0].max() == pytest.approx(static, rel=5e-3)


def test_what_cannot_be_driven_is_refused(machine):
    outputs = (Dof.parse("acc1:+tx"),)
    for drive in ("floor:+rz", "joint:nothing", "acc99:+tx"):
        with pytest.raises(UsageError):
            simulate(machine, (parse_drive(machine, drive),), outputs, TIME_S, PULSE[:, None])
    with pytest.raises(UsageError, match="shape"):
        simulate(machine, (), outputs, TIME_S, PULSE[:, None])


def test_an_unstable_machine_ends_with_a_sentence(tmp_path):
    path = tmp_path / "unstable.xml"
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="mass">'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint name="mass_tx" type="slide" '
        'axis="1 0 0" stiffness="2e4 0 -2e13"/><site name="acc1"/></body></worldbody></mujoco>',
        encoding="utf-8",
    )
    machine = load_machine(path)
    dof = (Dof.parse("acc1:+tx"),)
    with pytest.raises(ConvergenceError, match="grows without bound"):
        simulate(machine, dof, dof, TIME_S, np.full((len(TIME_S), 1), 50.0))


def test_the_filter_passes_the_band_and_delays_exactly():
    # A sine of 150 Hz, recorded at 512 Hz with a delay of 30 us, through steps of 1/10240 s.
    rate, factor, delay = 512.0, 20, 3e-5
    step = 1 / (rate * factor)
    middle = (np.arange(12000) + 0.5) * step
    chunks = np.array_split(np.sin(2 * np.pi * 150 * middle)[None, :, None], 7, axis=1)
    decimator = Decimator(filter_taps(rate, step, np.array([delay])), factor)
    samples = np.concatenate([decimator.push(chunk) for chunk in chunks], axis=2)[0, 0]
    time_s = np.arange(len(samples)) / rate
    wanted = np.sin(2 * np.pi * 150 * (time_s - delay))
    inside = slice(40, -1)
    assert np.abs(samples[inside] - wanted[inside]).max() < 1e-4


def test_the_filter_stops_what_would_fold_into_the_band():
    rate, factor = 512.0, 20
    step = 1 / (rate * factor)
    middle = (np.arange(12000) + 0.5) * step
    wave = np.sin(2 * np.pi * 0.62 * rate * middle)[None, :, None]
    decimator = Decimator(filter_taps(rate, step, np.zeros(1)), factor)
    assert np.abs(decimator.push(wave)[0, 0, 40:]).max() < 3e-5


def test_nonlinear_springs_follow_an_integrator_of_another_library(tmp_path):
    # m x'' + c x' + law(x) = f by scipy's DOP853, for a cubic spring and a gap.
    mass, damping, height, width = 2.0, 30.0, 40.0, 0.01
    drawing = tmp_path / "mass.xml"
    drawing.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="mass">'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint name="slide" type="slide" '
        'axis="1 0 0" stiffness="2e4" damping="30"/><site name="acc1"/></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    time_s = np.arange(0, 0.4, 1e-3)
    pulse = np.where(time_s < width, height * np.sin(np.pi * time_s / width) ** 2, 0.0)
    force = CubicSpline(time_s, pulse)
    reading = (Dof.parse("acc1:+tx"),)
    for law in (PolynomialSpring("slide", 2e4, 0.0, 3e11), GapSpring("slide", 2e4, 1e-4)):
        path = tmp_path / "nonlinear.xml"
        write_nonlinear_joints(drawing, path, [law])

        def rates(time, state, law=law):
            spring = law.follow(np.array([state[0]]))[0]
            return [state[1], (force(time) - damping * state[1] - spring) / mass]

        reference = solve_ivp(
            rates, (0, time_s[-1]), [0.0, 0.0], "DOP853", time_s, rtol=1e-10, atol=1e-13
        ).y[0]
        response = simulate(
            load_machine(path), reading, reading, time_s, pulse[:, None], quantity="receptance"
        )
        error = response.outputs[:, 0] - reference
        assert np.sqrt((error**2).mean()) < 3e-3 * np.sqrt((reference**2).mean())


@pytest.mark.parametrize("count", [1, 3, 7])
def test_chunks_do_not_change_what_is_recorded(count):
    # Two taps and twenty steps per sample: most values belong to no sample.
    values = np.random.default_rng(1).normal(size=(2, 501, 3))
    taps = np.full((3, 2), 0.5)
    whole = Decimator(taps, 20).push(values)
    decimator = Decimator(taps, 20)
    parts = [decimator.push(part) for part in np.array_split(values, count, axis=1)]
    assert np.array_equal(np.concatenate(parts, axis=2), whole)
    middle = values[:, 19:500:20]
    assert np.allclose(whole[0, 0, 1:], (middle[0, :, 0] + values[0, 20:501:20, 0]) / 2)


@pytest.mark.parametrize(
    ("stiffness", "damping", "integrator", "largest"),
    [(0.0, 1e5, "implicitfast", 4e-3), (1e10, 1.0, "discrete", 2e-2)],
)
def test_too_fast_a_motion_has_an_implicit_integrator_and_an_honest_error(
    tmp_path, stiffness, damping, integrator, largest
):
    # A chip of 0.1 g on a hard spring, or on a strong damper.
    path = tmp_path / "chip.xml"
    chip = (
        '<body name="chip" pos="0 0 .8"><inertial pos="0 0 0" mass="1e-4" diaginertia="1e-8 1e-8 '
        f'1e-8"/><joint name="chip_tx" type="slide" axis="1 0 0" stiffness="{stiffness}" '
        f'damping="{damping}"/></body><site name="acc3"'
    )
    path.write_text(MJCF.replace('<site name="acc3"', chip), encoding="utf-8")
    machine = load_machine(path)
    inputs, outputs = (Dof.parse("acc3:+tx"),), (Dof.parse("acc1:+tx"), Dof.parse("acc3:-tx"))
    time_s = TIME_S[:160]
    model = as_drawn(machine)
    request = FrfRequest(np.ones(1), outputs, inputs, "accelerance")
    linear = respond_linearly(model, model.drawn, request, time_s, PULSE[:160, None])
    response = simulate(machine, inputs, outputs, time_s, PULSE[:160, None])
    error = np.sqrt(((response.outputs - linear) ** 2).mean(axis=0) / (linear**2).mean(axis=0))
    assert response.step.integrator == integrator
    assert error.max() < largest
    assert error.max() == pytest.approx(response.step.error, rel=1.0)


def test_a_rotor_turns_the_motion_as_in_the_linear_model(tmp_path):
    # A rotor at 300 rad/s on a body that tilts about two axes: gyroscopic coupling.
    path = tmp_path / "rotor.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body name="a">'
        '<inertial pos="0 0 0" mass="20" diaginertia="1 1 1"/>'
        '<joint name="ax" type="hinge" axis="1 0 0" stiffness="1e4" damping="3"/>'
        '<joint name="ay" type="hinge" axis="0 1 0" stiffness="2e4" damping="3"/>'
        '<site name="acc1" pos=".2 0 .1"/><body name="b">'
        '<inertial pos="0 0 0" mass="5" diaginertia=".2 .2 .3"/>'
        '<joint name="spin" type="hinge" axis="0 0 1" damping=".01"/></body></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    machine = load_machine(path, {"spin": 300.0})
    inputs, outputs = (Dof.parse("a:+ry"),), (Dof.parse("a:+ry"), Dof.parse("a:+rx"))
    model, torque = as_drawn(machine), 0.1 * PULSE[:, None]
    request = FrfRequest(np.ones(1), outputs, inputs, "accelerance")
    linear = respond_linearly(model, model.drawn, request, TIME_S, torque)
    turned = simulate(machine, inputs, outputs, TIME_S, torque, spin={"spin": 300.0}).outputs
    assert np.sqrt((linear[:, 1] ** 2).mean()) > 0.1 * np.sqrt((linear[:, 0] ** 2).mean())
    error = np.sqrt(((turned - linear) ** 2).mean(axis=0) / (linear**2).mean(axis=0))
    assert (error < 5e-3).all()


def test_sensors_of_the_file_are_read_by_name(machine):
    texts = ("scale", "joint:head_tx", "speed.1", "acc3:+ty")
    outputs = tuple(parse_reading(machine, text) for text in texts)
    inputs = (Dof.parse("acc4:+ty"),)
    values = simulate(machine, inputs, outputs, TIME_S, PULSE[:, None], quantity="mobility").outputs
    assert np.abs(values[:, 1]).max() > 0
    assert np.allclose(values[:, 0], values[:, 1], rtol=1e-9)
    # The label reads along the site's axes at rest, the sensor along those of the world.
    assert np.allclose(values[:, 2], values[:, 3], rtol=1e-4, atol=1e-9)
    for wrong in ("nothing", "speed.3"):
        reading = (parse_reading(machine, wrong),)
        with pytest.raises(UsageError, match="sensor"):
            simulate(machine, inputs, reading, TIME_S, PULSE[:, None])
