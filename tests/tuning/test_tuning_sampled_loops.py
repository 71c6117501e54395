"""Sampled loops: against python-control, sums over all images, and exact covariances in time."""

from dataclasses import replace

import control
import numpy as np
import pytest
from budget_case import (
    VALUES,
    margins_of,
    open_loop,
    sample_rms,
    spring_posterior,
    write_machine,
)
from scipy.linalg import expm, solve_discrete_lyapunov

from identification.words import InputError
from mbmodel import as_drawn, load_machine, machine_model
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.budget import error_budget
from tuning.plant.error_budget.machine_files import FittedMachine
from tuning.plant.error_budget.plant_budget import log_rms_gradient, plant_budget
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.error_budget.source_spectra import image_shares

PERIOD = 1 / 400  # the second mode lies at 29 Hz, half of the sampling rate at 200 Hz
ZEROS, POLES, GAIN = (0.88, 0.98), (0.999, 0.2), 2.2e5
MASS, STIFFNESS, DAMPING = 3.0, 12e3, 7.0
AXIS = """
band = [2.0, 45.0]
[error.top]
output = "acc2:+tx"
minus = "acc1:+tx"
[disturbance.ripple]
input = "drive"
density = 0.5
unit = "1/sqrt(Hz)"
[noise.encoder]
loop = "axis"
density = 2e-7
unit = "m/sqrt(Hz)"
[loop.axis]
input = "drive"
output = "acc2:+tx"
minus = "acc1:+tx"
delay = {delay}
controller = {{ zeros = [0.88, 0.98], poles = [0.999, 0.2], gain = {gain}, period = {period} }}
{more}
"""
ONE = """<mujoco><option gravity="0 0 0"/><worldbody><body name="m">
<inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/>
<joint name="m_tx" type="slide" axis="1 0 0" stiffness="{k}" damping="{c}"/>
<site name="acc1"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("sampled"))


@pytest.fixture(scope="module")
def model(folder):
    return machine_model(load_machine(folder / "two.xml"))


def definition_of(folder, model, delay=0.0, gain=GAIN, more="", period=PERIOD):
    file = folder / "budget.toml"
    file.write_text(AXIS.format(delay=delay, gain=gain, period=period, more=more), "utf-8")
    return read_definition(file, model.machine)


def plant_by_hand():
    """A, B, C of the axis: drive to the position of the head over the base."""
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    mass = np.diag([m1, m2])
    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    inverse = np.linalg.inv(mass)
    dynamics = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    drive = np.concatenate([np.zeros(2), inverse @ (2.0 * np.array([-1.0, 1.0]))])
    return dynamics, drive[:, None], np.array([[-1.0, 1.0, 0.0, 0.0]])


def controller_of_control(gain=GAIN, period=PERIOD):
    return control.zpk(list(ZEROS), list(POLES), gain, dt=period)


def test_the_sampled_loop_has_gain_poles_and_margins_of_python_control(folder, model):
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    sampled = control.sample_system(control.ss(*plant_by_hand(), 0), PERIOD, "zoh")
    loop = control.ss(controller_of_control()) * sampled
    expected = np.sort_complex(np.log(control.feedback(loop, 1).poles()) / PERIOD)
    assert np.sort_complex(budget.states.poles()) == pytest.approx(expected, rel=1e-6)
    nominal = margins_of(budget).nominal
    by_hand = loop(np.exp(2j * np.pi * nominal.freq_hz * PERIOD))
    np.testing.assert_allclose(nominal.gains[:, 0, 0], by_hand, rtol=1e-7)
    gains, phases, distances, at_gain, at_phase, _ = control.stability_margins(loop, returnall=True)
    margins = nominal.loops[0]
    assert margins.modulus.value == pytest.approx(distances.min(), rel=1e-5)
    assert margins.phase.value == pytest.approx(phases[np.argmin(np.abs(phases))], rel=1e-4)
    assert margins.gain.value == pytest.approx(gains[gains > 1].min(), rel=1e-5)
    assert 2 * np.pi * margins.gain.freq_hz == pytest.approx(
        at_gain[np.argmin(np.where(gains > 1, gains, np.inf))], rel=1e-5
    )
    # python-control lists a root where |L| is smallest, 1.14: only true crossings count
    true = [w for w in np.sort(at_phase) if abs(abs(loop(np.exp(1j * w * PERIOD))) - 1) < 1e-6]
    np.testing.assert_allclose(2 * np.pi * margins.gain_crossovers[:, 0], true, rtol=1e-4)
    assert len(true) == 3
    assert nominal.freq_hz[-1] == pytest.approx(0.5 / PERIOD)


@pytest.mark.parametrize("delay", [0.0, 0.4 * PERIOD, PERIOD, 2.3 * PERIOD])
def test_the_loop_gain_is_the_sum_over_all_images(folder, model, delay):
    budget = error_budget(model, model.drawn, definition_of(folder, model, delay, gain=GAIN / 9))
    nominal = margins_of(budget).nominal
    lines = np.arange(0, len(nominal.freq_hz) - 1, 7)
    freq = nominal.freq_hz[lines]
    gain_of, total = open_loop(), np.zeros(len(freq), complex)
    continuous = 3e5 * (1 + 0j)
    for image in range(-600, 601):
        for number, s in enumerate(2j * np.pi * (freq + image / PERIOD)):
            law = continuous * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700)) * np.exp(-s * 3e-4)
            plant = gain_of(s)[0, 0] / law  # by hand, without the controller of that case
            total[number] += plant * -np.expm1(-s * PERIOD) / (s * PERIOD) * np.exp(-s * delay)
    law = controller_of_control(GAIN / 9)(np.exp(2j * np.pi * freq * PERIOD))
    expected = total * law
    error = np.abs(nominal.gains[lines, 0, 0] - expected).max()
    # what 600 images leave out falls with the cube of their number; a late hold jumps, so slower
    assert error < 1e-6 * np.abs(expected).max()
    fundamental = np.abs(nominal.gains[lines, 0, 0] - law * plant_part(freq, delay))
    assert fundamental.max() > 1e3 * error, "the images matter"


def plant_part(freq, delay):
    """G h exp(-s tau) at the lines alone."""
    s = 2j * np.pi * freq
    dynamics, drive, read = plant_by_hand()
    plant = np.array([(read @ np.linalg.solve(x * np.eye(4) - dynamics, drive))[0, 0] for x in s])
    return plant * -np.expm1(-s * PERIOD) / (s * PERIOD) * np.exp(-s * delay)


@pytest.mark.parametrize("source", ["force", "noise"])
def test_rms_with_its_images_is_that_of_the_exact_covariance_in_time(tmp_path, source):
    # A coarse period, 12 samples a period of the mode, so that the images matter.
    period, force_density, noise_density = 1 / 120, 2.0, 1e-4
    (tmp_path / "one.xml").write_text(ONE.format(m=MASS, k=STIFFNESS, c=DAMPING))
    noise = f"""[noise.n]
        loop = "x"
        density = {noise_density}
        unit = "m/sqrt(Hz)"
        band = [1e-3, 60.0]"""
    force = f"""[disturbance.f]
        input = "acc1:+tx"
        density = {force_density}
        unit = "N/sqrt(Hz)" """
    (tmp_path / "budget.toml").write_text(f"""band = [1e-3, {60.0 if source == "noise" else 6e3}]
        [error.x]
        output = "acc1:+tx"
        {force if source == "force" else noise}
        [loop.x]
        input = "acc1:+tx"
        output = "acc1:+tx"
        controller = {{ zeros = [0.8], poles = [0.1], gain = 9e3, period = {period} }}
        """)
    model = as_drawn(load_machine(tmp_path / "one.xml"))
    definition = read_definition(tmp_path / "budget.toml", model.machine)
    budget = error_budget(model, model.drawn, definition)
    share = image_shares(budget)[0]
    shown = budget.rms[0] ** 2 * (1 + share)
    dynamics = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]])
    drive, white = np.array([0.0, 1 / MASS]), np.zeros((2, 2))
    if source == "force":
        white[1, 1] = force_density**2 / 2 / MASS**2  # two-sided

    def move(time):
        """Transition, integral of it over the held force, covariance of the white force."""
        joined = np.zeros((7, 7))
        joined[:2, :2], joined[:2, 2] = dynamics, drive
        joined[3:5, 3:5], joined[3:5, 5:7], joined[5:7, 5:7] = -dynamics, white, dynamics.T
        power = expm(joined * time)
        return power[:2, :2], power[:2, 2], power[5:7, 5:7].T @ power[3:5, 5:7]

    a, b, c, d = 0.1, 1.0, 9e3 * (0.1 - 0.8), 9e3
    sensor = noise_density**2 / 2 / period if source == "noise" else 0.0
    read = np.array([1.0, 0.0])
    held = -np.concatenate([d * read, [c]])  # u = -(d (y + n) + c xi)

    def all_of(time):
        phi, gamma, covariance = move(time)
        state = np.hstack([phi, np.zeros((2, 1))]) + np.outer(gamma, held)
        return state, -d * gamma, covariance

    state, by_noise, covariance = all_of(period)
    step = np.vstack([state, np.concatenate([b * read, [a]])])
    entry = np.append(by_noise, b)
    total = np.zeros((3, 3))
    total[:2, :2] = covariance
    steady = solve_discrete_lyapunov(step, total + sensor * np.outer(entry, entry))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    mean = 0.0
    for time, weight in zip((nodes + 1) / 2 * period, weights / 2, strict=True):
        state, by_noise, covariance = all_of(time)
        value = state @ steady @ state.T + sensor * np.outer(by_noise, by_noise) + covariance
        mean += weight * value[0, 0]
    assert shown == pytest.approx(mean, rel=2e-3)


def test_noise_about_the_sampling_rate_is_noise_about_zero_frequency(tmp_path):
    (tmp_path / "one.xml").write_text(ONE.format(m=MASS, k=STIFFNESS, c=DAMPING))
    model, powers, shares = as_drawn(load_machine(tmp_path / "one.xml")), [], []
    for low, high in ((5.0, 15.0), (105.0, 115.0)):
        (tmp_path / "budget.toml").write_text(f"""band = [{low}, {high}]
            [error.x]
            output = "acc1:+tx"
            [noise.n]
            loop = "x"
            density = 1e-6
            unit = "m/sqrt(Hz)"
            [loop.x]
            input = "acc1:+tx"
            output = "acc1:+tx"
            controller = {{ zeros = [0.8], poles = [0.1], gain = 9e3, period = {1 / 120} }}
            """)
        definition = read_definition(tmp_path / "budget.toml", model.machine)
        budget = error_budget(model, model.drawn, definition)
        shares.append(image_shares(budget)[0])
        powers.append(budget.rms[0] ** 2 * (1 + shares[-1]))
    assert powers[1] == pytest.approx(powers[0], rel=2e-3)
    assert shares[0] < 1e-3
    assert shares[1] > 100


def test_an_acceleration_is_sampled_before_the_control_changes(tmp_path):
    """A free mass: a[k] = u[k-1] / m, so that u = -K a grows beyond K = m, with z = -K / m."""
    (tmp_path / "one.xml").write_text(ONE.format(m=MASS, k=0.0, c=1e-9))
    model = as_drawn(load_machine(tmp_path / "one.xml"))
    (tmp_path / "budget.toml").write_text(f"""band = [1.0, 60.0]
        [error.x]
        output = "acc1:+tx"
        [disturbance.f]
        input = "acc1:+tx"
        density = 1.0
        unit = "N/sqrt(Hz)"
        [loop.x]
        input = "acc1:+tx"
        output = "acc1:+tx"
        quantity = "accelerance"
        controller = {{ gain = {0.25 * MASS}, period = {PERIOD} }}
        """)
    definition = read_definition(tmp_path / "budget.toml", model.machine)
    budget = error_budget(model, model.drawn, definition)
    nominal = margins_of(budget).nominal
    z = np.exp(2j * np.pi * nominal.freq_hz * PERIOD)
    np.testing.assert_allclose(nominal.gains[:, 0, 0], 0.25 / z, rtol=1e-4)
    gain = nominal.loops[0].gain
    assert (gain.value, gain.freq_hz) == pytest.approx((4.0, 0.5 / PERIOD), rel=1e-4)
    growing = np.exp(budget.states.poles() * PERIOD)
    assert np.abs(growing + 0.25).min() < 1e-5


def test_shares_of_modes_and_joints_add_up(folder, model):
    budget = error_budget(model, model.drawn, definition_of(folder, model))
    poles, modes = budget.mode_shares
    assert modes.sum(axis=1) == pytest.approx(1.0)
    assert np.abs(modes[:, -1]).max() < 1e-6, "no laws, no floor: all motion belongs to modes"
    assert np.abs(poles.imag).max() / 2 / np.pi == pytest.approx(29.4, abs=1.0)
    names, joints = budget.joint_shares
    assert joints.sum(axis=1) == pytest.approx(1.0)
    assert names[-1] == "floor"
    assert joints[0, -1] == pytest.approx(0.0, abs=1e-6)


def test_the_derivatives_are_those_of_differences(folder, model):
    definition = definition_of(folder, model)
    budget = error_budget(model, model.drawn, definition)
    slopes = log_rms_gradient(budget)[0] * model.drawn
    for number, parameter in enumerate(model.parameters):
        if not parameter.name.endswith((".stiffness", ".damping")):
            continue
        ends = []
        for size in (0.99, 1.01):
            theta = model.drawn.copy()
            theta[number] *= size
            ends.append(np.log(error_budget(model, theta, definition).rms[0]))
        by_difference = (ends[1] - ends[0]) / np.log(1.01 / 0.99)
        assert slopes[number] == pytest.approx(by_difference, abs=0.01), parameter.name


def test_a_step_of_the_reference_is_that_of_python_control(folder, model):
    delay = 2 * PERIOD  # two further states of python-control's delay z^-2
    budget = error_budget(model, model.drawn, definition_of(folder, model, delay, GAIN / 9))
    step = margins_of(budget).steps[0]
    sampled = control.sample_system(control.ss(*plant_by_hand(), 0), PERIOD, "zoh")
    late = control.tf([1], [1, 0, 0], PERIOD)
    loop = control.ss(late) * control.ss(controller_of_control(GAIN / 9)) * sampled
    instants = np.arange(0, step.time_s[-1] + PERIOD / 2, PERIOD)
    expected = control.step_response(control.feedback(loop, 1), instants)
    at = np.round(step.time_s / PERIOD).astype(int)
    np.testing.assert_allclose(step.response, expected.outputs[at], atol=1e-7)
    assert step.final == pytest.approx(control.feedback(loop, 1).dcgain().item().real, rel=1e-6)


def test_machines_of_the_posterior_have_sampled_margins(folder, model):
    fitted = FittedMachine(model, spring_posterior(model))
    plant = plant_budget(fitted, definition_of(folder, model))
    margins = plant.margins
    assert len(margins.samples) == 60
    values = [each.loops[0].modulus.value for each in margins.samples]
    assert min(values) < margins.nominal.loops[0].modulus.value < max(values)
    drawn = sample_rms(plant.budget, fitted.thetas[:12])[:, 0]
    spread = np.log(drawn).std()
    assert spread == pytest.approx(plant.interval.by_parameters[0], rel=0.5)
    assert plant.curves().magnitude.shape[1] == 3


def test_a_loop_is_unstable_where_its_discrete_poles_are(folder, model):
    stable = error_budget(model, model.drawn, definition_of(folder, model))
    limit = margins_of(stable).nominal.loops[0].gain.value
    assert growing_pole(stable.states.poles()) is None
    inside = definition_of(folder, model, gain=0.99 * limit * GAIN)
    assert growing_pole(error_budget(model, model.drawn, inside).states.poles()) is None
    with pytest.raises(InputError, match="the closed loop is unstable"):
        error_budget(model, model.drawn, definition_of(folder, model, gain=1.01 * limit * GAIN))


def test_fast_sampling_is_the_continuous_loop(folder, model):
    zeros, poles = np.array([-60.0, -8.0]), np.array([-0.5, -700.0])
    budgets = []
    for period in (0.0, 2e-5):
        law = control.zpk(zeros, poles, 1e5)
        if period:
            law = control.sample_system(control.tf(law), period, "tustin")
        file = folder / "budget.toml"
        text = AXIS.format(delay=3e-4 - period / 2, gain=1.0, period=1e-4, more="")
        file.write_text(text, "utf-8")
        definition = read_definition(file, model.machine, {"axis": law})
        budgets.append(error_budget(model, model.drawn, definition))
    assert budgets[1].rms == pytest.approx(budgets[0].rms, rel=1e-4)
    old, new = (margins_of(budget).nominal.loops[0] for budget in budgets)
    assert new.modulus.value == pytest.approx(old.modulus.value, rel=1e-3)
    assert new.delay.value == pytest.approx(old.delay.value, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("period = 1e-3", r"axis sampled every 0\.0025 s, base sampled every 0\.001 s"),
        ("", r"axis sampled every 0\.0025 s, base continuous: state all controllers with one"),
    ],
)
def test_loops_of_different_periods_are_refused(folder, model, more, reason):
    table = f"""[loop.base]
    input = "acc1:+tx"
    output = "acc1:+tx"
    controller = {{ gain = 10.0{", " + more if more else ""} }}"""
    with pytest.raises(InputError, match=reason):
        definition_of(folder, model, more=table)


def test_two_sampled_loops_of_one_period_close_together(folder, model):
    more = f"""[loop.base]
    input = "acc1:+tx"
    output = "acc1:+tx"
    quantity = "mobility"
    controller = {{ gain = 400.0, period = {PERIOD} }}
    delay = {PERIOD}"""
    definition = definition_of(folder, model, more=more)
    alone = definition_of(folder, model)
    both = error_budget(model, model.drawn, definition)
    one = error_budget(model, model.drawn, replace(alone, sources=definition.sources))
    assert both.rms[0] != pytest.approx(one.rms[0], rel=1e-3)
    margins = margins_of(both)
    assert margins.names == ("axis", "base")
    assert margins.nominal.modulus.value <= min(
        loop.modulus.value for loop in margins.nominal.loops
    ) * (1 + 1e-6)
