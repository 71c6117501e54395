"""Error budgets against closed forms and against time simulations of random inputs."""

from dataclasses import replace

import numpy as np
import pytest
from budget_case import BUDGET, FLOOR, FLOOR_HZ, TWO, VALUES, sample_rms, write_machine
from scipy.linalg import eigh, expm

from identification.words import InputError
from mbmodel import as_drawn, load_machine
from tuning import ParameterPosterior
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.budget import budget_on_lines, error_budget
from tuning.plant.error_budget.loop_algebra import close_loops
from tuning.plant.error_budget.plant_budget import (
    log_rms_gradient,
    rms_interval,
    stable_poles_of_samples,
)
from tuning.plant.error_budget.read_definition import read_definition


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_machine(tmp_path_factory.mktemp("budget"))


@pytest.fixture(scope="module")
def model(folder):
    return as_drawn(load_machine(folder / "two.xml"))


def budget_of(folder, model, text, theta=None):
    (folder / "budget.toml").write_text(text, encoding="utf-8")
    definition = read_definition(folder / "budget.toml", model.machine)
    return error_budget(model, model.drawn if theta is None else theta, definition)


def closed_text(gain=3e5, delay=0.0, lines=""):
    return BUDGET.format(gain=gain, delay=delay, lines=lines)


def test_white_force_on_one_mass_has_the_rms_of_the_closed_form(tmp_path):
    # One-sided S0 [N^2/Hz]: rms^2 = S0 / (4 c k) = S0 / (8 zeta w0^3 m^2).
    mass, stiffness, damping, density = 3.0, 12e3, 7.0, 2.0
    (tmp_path / "one.xml").write_text(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="m">
        <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
        <joint name="m_tx" type="slide" axis="1 0 0" stiffness="{stiffness}" damping="{damping}"/>
        <site name="acc1"/></body></worldbody></mujoco>"""
    )
    model = as_drawn(load_machine(tmp_path / "one.xml"))
    budget = budget_of(
        tmp_path,
        model,
        f"""band = [1e-3, 5e3]
        [error.x]
        output = "acc1:+tx"
        [disturbance.f]
        input = "acc1:+tx"
        density = {np.sqrt(density)}
        unit = "N/sqrt(Hz)" """,
    )
    omega = np.sqrt(stiffness / mass)
    ratio = damping / (2 * mass * omega)
    expected = density / (8 * ratio * omega**3 * mass**2)
    assert budget.rms[0] ** 2 == pytest.approx(expected, rel=5e-4)
    # rms^2 = S0 / (4 c k): each per cent of c or k takes half a per cent of the rms.
    slopes = log_rms_gradient(budget)[0] * model.drawn
    assert slopes == pytest.approx([-0.5, -0.5], abs=2e-3)
    freq, above = budget.cumulative()
    half = above[np.searchsorted(freq, omega / 2 / np.pi), 0]
    assert half == pytest.approx(budget.rms[0] / np.sqrt(2), rel=0.03)  # a narrow peak at w0


def matrices():
    """M, C, K of both masses on the floor, relative to it, by hand."""
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    mass = np.diag([m1, m2])
    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    return mass, damping, stiffness


def closed_loop(gain):
    """A, B of floor, drive and noise, C of both errors but for the floor's own motion."""
    mass, damping, stiffness = matrices()
    inverse = np.linalg.inv(mass)
    plant = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    floor = np.concatenate([np.zeros(2), -np.ones(2)])
    drive = np.concatenate([np.zeros(2), inverse @ (2.0 * np.array([-1.0, 1.0]))])
    read = np.array([-1.0, 1.0, 0.0, 0.0])
    # gain (s + 60) (s + 8) / ((s + 0.5) (s + 700)), in controllable form
    numerator, denominator = np.polymul([1, 60.0], [1, 8.0]), np.polymul([1, 0.5], [1, 700.0])
    states = np.array([[0.0, 1.0], [-denominator[2], -denominator[1]]])
    entry = np.array([0.0, 1.0])
    output = gain * (numerator[:0:-1] - denominator[:0:-1])
    total = np.block(
        [
            [plant - gain * np.outer(drive, read), -np.outer(drive, output)],
            [np.outer(entry, read), states],
        ]
    )
    gains = np.zeros((6, 3))
    gains[:4] = np.stack([floor, drive, -gain * drive], axis=1)
    gains[4:, 2] = entry
    return total, gains


def random_signals(rng, count, samples, step):
    """Floor, drive and noise with the densities of the budget, (n_source, samples, count), and
    the displacement of the floor; (samples, count)."""
    freq = np.fft.rfftfreq(samples, step)
    inside = (freq >= 2.0) & (freq <= 45.0)
    line = np.where(freq > 0, freq, 1.0)
    floor = np.exp(np.interp(np.log(line), np.log(FLOOR_HZ), np.log(FLOOR)))
    cross = np.sqrt(0.6) * np.exp(1j * np.radians(40.0))
    root = np.linalg.cholesky(np.array([[1, cross, 0], [np.conj(cross), 1, 0], [0, 0, 1]]))
    sizes = np.sqrt(np.stack([floor, 0.3 + 0 * freq, (2e-7) ** 2 + 0 * freq]) * inside)
    drawn = rng.standard_normal((2, 3, len(freq), count))
    white = np.einsum("st,tfk->sfk", root, drawn[0] + 1j * drawn[1])
    spectrum = white * sizes[:, :, None] * np.sqrt(samples / (4 * step))
    displacement = spectrum[0] / -((2 * np.pi * line[:, None]) ** 2)
    return np.fft.irfft(spectrum, samples, axis=1), np.fft.irfft(displacement, samples, axis=0)


def test_a_closed_loop_under_correlated_sources_agrees_with_a_simulation_in_time(folder, model):
    gain, step, samples, count = 3e5, 1 / 500, 6000, 400
    budget = budget_of(folder, model, closed_text(gain))
    total, gains = closed_loop(gain)
    assert growing_pole(np.linalg.eigvals(total)) is None
    signals, floor = random_signals(np.random.default_rng(3), count, samples, step)
    # Inputs that are straight between samples: exact exponential of the joined matrix.
    joined = np.zeros((12, 12))
    joined[:6, :6], joined[:6, 6:9], joined[6:9, 9:] = total * step, gains * step, np.eye(3)
    transition = expm(joined)
    state = np.zeros((6, count))
    squares, kept = np.zeros((2, count)), 0
    inputs = signals.transpose(1, 0, 2)
    for k in range(samples - 1):
        now, change = inputs[k], inputs[k + 1] - inputs[k]
        state = transition[:6, :6] @ state + transition[:6, 6:9] @ now + transition[:6, 9:] @ change
        if k > 1000:  # the slowest pole has decayed
            errors = state[1] - state[0], state[0] + floor[k + 1]
            squares += [error**2 for error in errors]
            kept += 1
    power = squares / kept
    simulated, deviation = power.mean(axis=1), power.std(axis=1) / np.sqrt(count)
    assert (deviation / (2 * simulated) < 0.01).all()  # standard error of the rms
    assert budget.rms == pytest.approx(np.sqrt(simulated), rel=0.02)


def test_shares_of_sources_modes_and_joints_add_up(folder, model):
    budget = budget_of(folder, model, closed_text(delay=3e-4))
    cross = budget.cross_shares()
    assert [row[:2] for row in cross] == [("floor", "ripple")]
    assert budget.source_shares.sum(axis=1) + cross[0][2] == pytest.approx([1.0, 1.0], rel=1e-9)
    names, joints = budget.joint_shares
    assert names == ("base_tx", "head_tx", "floor")
    assert joints[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)  # the difference is one joint
    poles, modes = budget.mode_shares
    assert np.sum(poles.imag > 0) >= 2
    # The machine's and controller's modes hold the difference; no motion of the floor is in it.
    assert modes[0, -1] == pytest.approx(0.0, abs=1e-6)
    assert abs(joints[1, -1]) > 1e-3  # the base moves with the floor, too
    assert modes[1, -1] == pytest.approx(joints[1, -1], rel=0.2)


def test_sines_of_a_rotor_add_half_the_square_of_their_peak(folder, model):
    quiet = budget_of(folder, model, closed_text())
    lines = "\n".join(
        ("[disturbance.rotor]", 'input = "acc1:+tx"', "speed_rpm = 600",
         "lines = [{order = 1, unbalance = 2e-4}, {order = 2, amplitude = 0.5}]")
    )  # fmt: skip
    budget = budget_of(folder, model, closed_text(lines=lines))
    mass, damping, stiffness = matrices()
    s = 2j * np.pi * np.array([10.0, 20.0])
    peaks = [2e-4 * (2 * np.pi * 10.0) ** 2, 0.5]
    moves = []
    for k, peak in enumerate(peaks):
        control = 3e5 * (s[k] + 60) * (s[k] + 8) / ((s[k] + 0.5) * (s[k] + 700))
        loop = stiffness + s[k] * damping + s[k] ** 2 * mass
        loop = loop + 2 * control * np.array([[1.0, -1.0], [-1.0, 1.0]])
        moves.append(np.linalg.solve(loop, [peak, 0.0]))
    expected = sum(abs(x[1] - x[0]) ** 2 / 2 for x in moves)
    added = budget.rms[0] ** 2 - quiet.rms[0] ** 2
    assert added == pytest.approx(expected, rel=1e-6)


def test_the_gradient_is_that_of_differences(folder, model):
    budget = budget_of(folder, model, closed_text(delay=5e-4))
    gradient, definition = log_rms_gradient(budget) * model.drawn, budget.definition
    lines = budget.freq_hz, budget.weights, budget.random_lines  # of the same integral
    for k in range(len(model.drawn)):
        logs = []
        for step in (1e-4, -1e-4):
            theta = model.drawn.copy()
            theta[k] *= np.exp(step)
            logs.append(np.log(budget_on_lines(model, theta, definition, lines, budget.states).rms))
        assert gradient[:, k] == pytest.approx((logs[0] - logs[1]) / 2e-4, rel=1e-5, abs=1e-7)


def test_an_unstable_loop_is_refused_with_its_pole(folder, model):
    with pytest.raises(InputError, match=r"closed loop is unstable: the pole .* at \d.* Hz grows"):
        budget_of(folder, model, closed_text(gain=4e6, delay=4e-3))


def test_a_delay_moves_the_poles_as_the_exact_characteristic_equation_says(folder, model):
    gain, delay = 3e5, 2e-3
    budget = budget_of(folder, model, closed_text(gain, delay))
    mass, damping, stiffness = matrices()
    poles = budget.states.poles()
    for pole in poles[(poles.imag > 20) & (np.abs(poles) < 300)]:
        control = gain * (pole + 60) * (pole + 8) / ((pole + 0.5) * (pole + 700))
        control *= 2 * np.exp(-pole * delay)
        z = stiffness + pole * damping + pole**2 * mass
        z = z + control * np.array([[1.0, -1.0], [-1.0, 1.0]])
        scale = np.prod(np.abs(np.diag(z))) + np.abs(z[0, 1]) ** 2
        assert abs(np.linalg.det(z)) < 1e-6 * scale


def posterior_of(model, deviation):
    """A posterior of all four parameters, correlated, about the model's nominal values."""
    size = len(model.drawn)
    root = np.eye(size) + 0.5 * np.eye(size, k=1)
    posterior = ParameterPosterior(
        tuple(parameter.name for parameter in model.parameters),
        tuple(parameter.name for parameter in model.parameters),
        model.drawn,
        np.arange(size),
        np.ones(size),
        np.ones(size, bool),
        deviation**2 * root @ root.T,
    )
    return posterior.on(model)


def test_the_interval_is_that_of_samples_of_the_posterior(folder, model):
    budget = budget_of(folder, model, closed_text(delay=3e-4))
    posterior = posterior_of(model, 0.04)
    interval = rms_interval(budget, posterior)
    logs = np.log(sample_rms(budget, posterior.sample(300, seed=5)))
    assert logs.std(axis=0) == pytest.approx(interval.deviation, rel=0.12)  # 3 sd of 300 draws
    low, high = interval.ends()
    inside = (logs > np.log(low)) & (logs < np.log(high))
    assert inside.mean(axis=0) == pytest.approx([0.95, 0.95], abs=0.04)


def test_the_floor_bounds_what_random_changes_of_all_forces_do(folder, model):
    # Changes of one sign at all lines: what the floor assumes, but for their phase.
    error, count, rng = 1e-3, 200, np.random.default_rng(6)
    budget = budget_of(folder, model, closed_text(delay=3e-4))
    lines, definition = budget.linearised, budget.definition
    mass, damping, stiffness = matrices()
    squares, shapes = eigh(stiffness, mass)
    laplace = lines.request.laplace[:, None, None]
    root = np.sqrt(squares + np.abs(laplace[:, 0]) ** 2)
    dynamic = laplace**2 * mass + laplace * damping + stiffness
    to_relative = np.array([[1.0, 0.0], [1.0, 1.0]])  # positions of the masses of joint coordinates
    readout = lines.readout @ np.linalg.inv(to_relative)
    drive = np.linalg.inv(to_relative).T @ lines.drive
    logs = []
    for _ in range(count):
        pair = (rng.standard_normal(2) + 1j * rng.standard_normal(2)) / np.sqrt(2)
        coupling = np.array([[0, pair[0]], [pair[1], 0]]) * root[:, :, None] * root[:, None, :]
        changed = dynamic + error * (mass @ shapes @ coupling @ shapes.T @ mass)
        step = np.linalg.inv(changed) - np.linalg.inv(dynamic)
        frfs = lines.values + readout @ step @ drive
        errors = close_loops(definition, budget.ports, frfs, laplace[:, 0, 0]).errors
        scaled = errors * budget.weights[:, None, :]
        power = np.einsum("fes,st,fet->e", scaled, definition.coherence, scaled.conj()).real
        logs.append(np.log(power) / 2)
    posterior = posterior_of(model, 0.0)
    with_error = replace(posterior, posterior=replace(posterior.posterior, discrepancy=error))
    bound = rms_interval(budget, with_error).deviation
    spread = np.std(logs, axis=0)
    assert (spread < bound).all()
    assert (spread > bound / 30).all()


def test_loops_that_some_machine_of_the_posterior_does_not_bear_are_refused(folder, model):
    budget = budget_of(folder, model, closed_text(gain=9e5, delay=2.2e-3))
    thetas = posterior_of(model, 0.3).sample(60, seed=1)
    with pytest.raises(InputError, match=r"unstable in \d+ of 60 machines of the posterior"):
        stable_poles_of_samples(budget, thetas)


SENSORS = """<sensor><jointpos name="encoder" joint="head_tx"/>
  <velocimeter name="speed" site="acc2"/><force name="cell" site="acc2"/></sensor></mujoco>"""
LOOP = """output = "acc2:+tx"
minus = "acc1:+tx"
delay"""


@pytest.fixture(scope="module")
def sensed(folder):
    text = TWO.format(**VALUES).replace("</mujoco>", SENSORS)
    (folder / "sensed.xml").write_text(text, encoding="utf-8")
    return as_drawn(load_machine(folder / "sensed.xml"))


def test_joints_encoders_and_pairs_are_the_difference_of_two_points(folder, sensed):
    expected = budget_of(folder, sensed, closed_text(delay=3e-4))
    for port in ("joint:head_tx", "encoder", "acc2-acc1:+tx"):
        text = closed_text(delay=3e-4).replace(LOOP, f'output = "{port}"\ndelay')
        budget = budget_of(folder, sensed, text)
        assert budget.rms == pytest.approx(expected.rms, rel=1e-9)
        poles = np.sort_complex(budget.states.poles())
        assert poles == pytest.approx(np.sort_complex(expected.states.poles()), rel=1e-6)


@pytest.mark.parametrize(
    ("quantity", "unit", "gain"),
    [("mobility", "m/s/sqrt(Hz)", 150.0), ("accelerance", "m/s^2/sqrt(Hz)", 2.0)],
)
def test_loops_of_velocity_and_acceleration_have_the_modes_of_their_frfs(
    folder, sensed, quantity, unit, gain
):
    controller = "controller = {zeros = [-60.0, -8.0], poles = [-0.5, -700.0], gain = 300000.0}"
    text = closed_text(delay=3e-4).replace("m/sqrt(Hz)", unit)
    text = text.replace(
        controller,
        f'quantity = "{quantity}"\ncontroller = {{poles = [-900.0], gain = {900 * gain}}}',
    )
    budget = budget_of(folder, sensed, text)
    _, shares = budget.mode_shares
    assert shares[0, -1] == pytest.approx(0.0, abs=1e-5)
    assert shares[0, :-1].sum() == pytest.approx(1.0, abs=1e-5)
    quiet = budget_of(folder, sensed, text.replace(f"gain = {900 * gain}", "gain = 0.0"))
    assert budget.rms[0] != pytest.approx(quiet.rms[0], rel=0.02)


def test_a_velocimeter_in_a_loop_is_the_velocity_of_its_site(folder, sensed):
    text = closed_text(gain=2e3).replace("m/sqrt(Hz)", "m/s/sqrt(Hz)")
    by_site = budget_of(
        folder, sensed, text.replace(LOOP, 'output = "acc2:+tx"\nquantity = "mobility"\ndelay')
    )
    by_sensor = budget_of(folder, sensed, text.replace(LOOP, 'output = "speed"\ndelay'))
    assert by_sensor.rms == pytest.approx(by_site.rms, rel=1e-9)
    assert by_sensor.joint_shares[1] == pytest.approx(by_site.joint_shares[1], abs=1e-9)
    assert by_sensor.mode_shares[1][0] == pytest.approx(by_site.mode_shares[1][0], abs=1e-6)
