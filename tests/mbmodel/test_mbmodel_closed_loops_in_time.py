"""Closed loops in time: against exact stepping by matrix exponentials, and SciPy's own solvers."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.signal
from budget_case import TWO, VALUES
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from identification.readers.controller import controller_from_roots
from identification.words import ConvergenceError, Loop, PortSum, UsageError
from mbmodel import (
    PolynomialSpring,
    load_machine,
    parse_input,
    parse_output,
    simulate,
    write_nonlinear_joints,
)
from mbmodel.simulation.drives import LoopSignal, parse_drive, parse_reading
from mbmodel.simulation.loop_signals import LoopRecord
from mbmodel.simulation.signals import move_signal

PERIOD_S, COUNT = 1e-3, 300
AXIS = (LoopSignal("axis"),)


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("two") / "two.xml"
    path.write_text(TWO.format(**VALUES), encoding="utf-8")
    return load_machine(path)


def loop_of(machine, controller, derivative=0, **settings):
    terms = ((parse_output(machine, "acc2:+tx"), 1.0), (parse_output(machine, "acc1:+tx"), -1.0))
    unit = ("m", "m/s", "m/s²")[derivative]
    measured = PortSum("axis", terms, unit, derivative)
    return Loop("axis", parse_input(machine, "drive"), measured, controller, "control", **settings)


def plant_matrices():
    """x' = A x + b u of both positions and velocities by hand; the drive has a gear of 2."""
    m1, k1, c1, m2, k2, c2 = VALUES.values()
    mass = np.diag([m1, m2])
    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])
    damping = np.array([[c1 + c2, -c2], [-c2, c2]])
    a = np.zeros((4, 4))
    a[:2, 2:] = np.eye(2)
    a[2:] = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    return a, np.concatenate([np.zeros(2), np.linalg.solve(mass, [-2.0, 2.0])])


def step_exactly(loop, reference, derivative):
    """Measurement, position of the base and control at the samples, by matrix exponentials."""
    a, b = plant_matrices()
    read = np.array([-1.0, 1.0, 0, 0]) @ np.linalg.matrix_power(a, derivative)
    through = read @ np.linalg.pinv(a) @ b if derivative == 2 else 0.0  # of an acceleration
    whole, late = divmod(loop.delay + 1e-12, PERIOD_S)

    def held(duration):
        block = expm(np.block([[a, b[:, None]], [np.zeros((1, 5))]]) * duration)
        return block[:4, :4], block[:4, 4]

    parts = held(late), held(PERIOD_S - late)
    state, memory = np.zeros(4), np.zeros(len(loop.controller.dynamics))
    past, rows = [0.0] * (int(whole) + 3), []
    limit = np.inf if loop.limit is None else loop.limit
    known = loop.controller
    for value in reference:
        before = past[int(whole)]  # what acts until this sample's own control arrives
        measured = read @ state + through * np.clip(before, -limit, limit)
        steps = loop.resolution or 1e-30
        error = steps * np.round(measured / steps) - value if loop.resolution else measured - value
        control = -float((known.output_matrix @ memory + known.feedthrough[:, 0] * error)[0])
        if loop.quantisation:
            control = loop.quantisation * np.round(control / loop.quantisation)
        memory = known.dynamics @ memory + known.input_matrix[:, 0] * error
        past.insert(0, control)
        acting = np.clip([past[int(whole) + 1], past[int(whole)]], -limit, limit)
        rows.append((measured, state[0], acting[1] if late < 1e-9 else acting[0]))
        for (free, driven), force in zip(parts, acting, strict=True):
            state = free @ state + driven * force
    return np.array(rows).T


@pytest.mark.parametrize(
    ("derivative", "gain", "settings"),
    [
        (0, 3e4, {}),
        (0, 3e4, {"delay": 3e-4}),
        (0, 2e4, {"delay": 2.5e-3}),
        (1, 60.0, {"delay": 1e-4}),
        (2, 0.4, {"delay": 5e-4}),
        (2, 0.4, {}),
        (0, 3e4, {"delay": 3e-4, "limit": 2.0}),
        (0, 3e4, {"resolution": 2e-6, "quantisation": 0.05, "limit": 9.0}),
    ],
)
def test_a_sampled_loop_is_stepped_exactly(machine, derivative, gain, settings):
    controller = controller_from_roots([0.95], [0.4], gain, PERIOD_S)
    loop = loop_of(machine, controller, derivative, **settings)
    time_s = np.arange(COUNT) * PERIOD_S
    reference = np.where(time_s >= 0.01, (1e-3, 0.05, 3.0)[derivative], 0.0)
    base = (parse_reading(machine, "acc1:+tx"),)
    response = simulate(
        machine, AXIS, base, time_s, reference[:, None], quantity="receptance", loops=[loop]
    )
    measured, position, control = step_exactly(loop, reference, derivative)
    record = response.loops[0]
    for values, exact in ((record.measured, measured), (record.control, control)):
        assert np.abs(values - exact).max() < 1e-5 * np.abs(exact).max()
    # The output is the mean of the two steps beside the sample: of second order in the step.
    assert np.abs(response.outputs[:, 0] - position).max() < 2e-3 * np.abs(position).max()
    if "limit" in settings:
        assert record.limited_share > 0
        assert np.abs(record.control).max() == pytest.approx(settings["limit"])


def test_a_position_reference_begins_where_the_machine_rests(machine):
    loop = loop_of(machine, controller_from_roots([0.95], [0.4], 3e4, PERIOD_S))
    time_s = np.arange(COUNT) * PERIOD_S
    reference = np.where(time_s >= 0.01, 1e-3, 0.0)[:, None]
    begun, moved = (
        simulate(machine, AXIS, (), time_s, reference + begin, loops=[loop]) for begin in (0, 0.2)
    )
    assert not begun.remarks
    assert moved.remarks == (
        "reference:axis begins at 0.2, where the machine rests: begin at 0 for a step",
    )
    near, far = begun.loops[0], moved.loops[0]
    np.testing.assert_allclose(far.reference, 0.2 + near.reference, atol=1e-15)
    np.testing.assert_allclose(far.measured, 0.2 + near.measured, atol=1e-12)
    np.testing.assert_allclose(far.error, near.error, atol=1e-12)


def test_a_reference_of_a_speed_begins_with_a_step(machine):
    loop = loop_of(machine, controller_from_roots([0.95], [0.4], 60.0, PERIOD_S), 1, delay=1e-4)
    time_s, reference = np.arange(COUNT) * PERIOD_S, np.full(COUNT, 0.05)
    response = simulate(machine, AXIS, (), time_s, reference[:, None], loops=[loop])
    measured, _, _ = step_exactly(loop, reference, 1)
    assert np.abs(response.loops[0].measured - measured).max() < 1e-5 * np.abs(measured).max()
    assert response.remarks == (
        "reference:axis begins at 0.05, but the machine rests: the loop begins with a step",
    )


def test_a_delay_that_ends_within_a_step_is_right_to_second_order(machine):
    loop = loop_of(machine, controller_from_roots([0.95], [0.4], 3e4, PERIOD_S), delay=np.pi * 1e-4)
    coarse = np.arange(COUNT) * PERIOD_S
    fine = np.arange(8 * (COUNT - 1) + 1) * PERIOD_S / 8
    measured, _, _ = step_exactly(loop, np.where(coarse >= 0.01, 1e-3, 0.0), 0)
    reference = np.where(fine >= 0.01 - 1e-9, 1e-3, 0.0)[:, None]
    response = simulate(machine, AXIS, (), fine, reference, loops=[loop])
    error = np.abs(response.loops[0].measured[::8] - measured).max()
    assert error < 1e-4 * np.abs(measured).max()


def test_a_continuous_loop_is_that_of_scipy(machine):
    # The closed loop x' = A x + b u, z' = -p z + e, with e = y - r, solved exactly for straight
    # lines of r.
    zero, pole, gain = 60.0, 700.0, 2e4
    loop = loop_of(machine, controller_from_roots([-zero], [-pole], gain))
    a, b = plant_matrices()
    read = np.array([-1.0, 1.0, 0, 0])
    closed = np.zeros((5, 5))
    closed[:4, :4], closed[:4, 4] = a - gain * np.outer(b, read), -gain * (zero - pole) * b
    closed[4, :4], closed[4, 4] = read, -pole
    entry = np.concatenate([gain * b, [-1.0]])
    time_s = np.arange(3000) * 1e-4
    reference = move_signal(time_s, 1e-3, [0.05, 3.0, 300.0], start_s=0.01)
    _, exact, _ = scipy.signal.lsim(
        (closed, entry[:, None], np.append(read, 0.0)[None], [[0.0]]), reference, time_s
    )
    response = simulate(machine, AXIS, (), time_s, reference[:, None], loops=[loop])
    assert np.abs(response.loops[0].measured - exact).max() < 1e-4 * np.abs(exact).max()


def test_a_loop_around_a_hardening_joint_is_that_of_another_solver(machine, tmp_path):
    cubic = 4e11
    write_nonlinear_joints(
        machine.source,
        tmp_path / "cubic.xml",
        [PolynomialSpring("head_tx", VALUES["k2"], 0, cubic)],
    )
    hard = load_machine(tmp_path / "cubic.xml")
    loop = loop_of(hard, controller_from_roots([0.95], [0.4], 3e4, PERIOD_S), limit=20.0)
    time_s = np.arange(COUNT) * PERIOD_S
    reference = move_signal(time_s, 1e-3, [0.1, 20.0, 3e3, 1e6], start_s=0.01)
    response = simulate(hard, AXIS, (), time_s, reference[:, None], loops=[loop])
    a, b = plant_matrices()
    state, memory, exact = np.zeros(4), np.zeros(1), []
    for value in reference:
        error = state[1] - state[0] - value
        known = loop.controller
        control = -float((known.output_matrix @ memory + known.feedthrough[:, 0] * error)[0])
        memory = known.dynamics @ memory + known.input_matrix[:, 0] * error
        exact.append(state[1] - state[0])

        force = np.clip(control, -20.0, 20.0)

        def rate(_, x, force=force):
            # A motor of gear 2: b is per unit of control, b / 2 per newton between the masses.
            return a @ x + b * (force - cubic * (x[1] - x[0]) ** 3 / 2)

        state = solve_ivp(rate, (0, PERIOD_S), state, rtol=1e-10, atol=1e-14).y[:, -1]
    assert np.abs(response.loops[0].measured - exact).max() < 1e-4 * np.abs(exact).max()
    soft = simulate(
        machine, AXIS, (), time_s, reference[:, None], loops=[loop_of(machine, loop.controller)]
    )
    assert np.abs(soft.loops[0].measured - exact).max() > 0.05 * np.abs(exact).max()


def test_a_command_beside_the_control_shares_its_limit(machine):
    loop = loop_of(machine, controller_from_roots([], [], 0.0, PERIOD_S), limit=1.5)
    time_s = np.arange(COUNT) * PERIOD_S
    force = 4.0 * np.sin(60 * time_s)
    drive = (parse_drive(machine, "drive"),)
    command = (LoopSignal("axis", "command"),)
    limited = simulate(machine, command, (), time_s, force[:, None], loops=[loop])
    plain = simulate(
        machine, drive, (), time_s, np.clip(force, -1.5, 1.5)[:, None], watched=[loop.measured]
    )
    size = np.abs(plain.watched).max()
    assert np.abs(limited.loops[0].measured - plain.watched[:, 0]).max() < 5e-3 * size


def test_an_encoder_is_read_at_the_instant(machine):
    loop = loop_of(machine, controller_from_roots([], [], 0.0, PERIOD_S))
    time_s = np.arange(COUNT) * PERIOD_S
    force = np.sin(2 * np.pi * 0.15 / PERIOD_S * time_s)[:, None]
    drive = (parse_drive(machine, "drive"),)
    readings = (parse_reading(machine, "joint:head_tx"),)
    response = simulate(machine, drive, readings, time_s, force, watched=[loop.measured])
    error = np.abs(response.outputs - response.watched)
    assert error.max() < 1e-4 * np.abs(response.watched).max()


@pytest.mark.parametrize(
    "limits", [[0.1, 1.0, 50.0], [0.1, 1.0, 50.0, 1e4], [10.0, 90.0, 1e3, 1e6]]
)
@pytest.mark.parametrize("distance", [1e-6, -2e-3, 0.7])
def test_a_move_keeps_its_limits_and_reaches_some(limits, distance):
    time_s = np.linspace(0, 12, 240_001)
    moves = [move_signal(time_s, distance, limits, order, 1.0) for order in range(len(limits))]
    assert moves[0][0] == 0
    assert moves[0][-1] == pytest.approx(distance, rel=1e-9)
    shares = [np.abs(m).max() / limit for m, limit in zip(moves[1:], limits, strict=False)]
    last = np.abs(np.diff(moves[-1])).max() / (time_s[1] * limits[-1])
    assert max(shares) < 1 + 1e-6
    assert last < 1 + 1e-6
    assert max(*shares, last) > 0.99
    for lower, higher in pairwise(moves):
        slope = np.diff(lower) / time_s[1]
        middle = (higher[1:] + higher[:-1]) / 2
        assert np.abs(slope - middle).max() < 0.05 * np.abs(higher).max()


def test_a_long_move_takes_the_least_time():
    # With all limits reached: D / V + V / A + A / J (+ J / S), the closed form of least time.
    time_s = np.linspace(0, 20, 2_000_001)
    for limits in ([0.1, 1.0, 50.0], [0.1, 1.0, 50.0, 1e4]):
        bounds = [1.0, *limits]
        least = sum(bounds[k] / bounds[k + 1] for k in range(len(limits)))
        move = move_signal(time_s, 1.0, limits, start_s=1.0)
        end = time_s[np.flatnonzero(move < 1.0 - 1e-12)[-1]]
        assert end - 1.0 == pytest.approx(least, abs=2e-3)


def test_the_settling_time_counts_from_the_end_of_the_last_move(machine):
    loop = loop_of(machine, controller_from_roots([], [], 1.0, PERIOD_S))
    time_s = np.arange(0, 2, 1e-3)
    reference = np.interp(time_s, [0.1, 0.2, 0.9, 1.0], [0, 1, 1, 3])
    error = np.where(time_s >= 1.0, np.exp(-(time_s - 1.0) / 0.1), 0.5)
    record = LoopRecord(loop, time_s, reference, reference - error, 0 * time_s)
    assert record.settling_time_s() == pytest.approx(0.1 * np.log(1 / 0.04), abs=1.1e-3)
    assert record.settling_time_s(0.5) == pytest.approx(0.1 * np.log(2), abs=1.1e-3)
    assert record.settling_time_s(1e-9) is None
    assert LoopRecord(loop, time_s, 0 * time_s, error, error).settling_time_s() is None
    rounded = reference * (1 + 2e-16 * (np.arange(len(time_s)) % 2))  # as a spline does
    again = LoopRecord(loop, time_s, rounded, reference - error, 0 * time_s)
    assert again.settling_time_s() == pytest.approx(record.settling_time_s(), abs=1e-12)


@pytest.mark.parametrize("arguments", [(3,), (-1,), (0, -1.0)])
def test_a_move_that_is_none_is_refused(arguments):
    with pytest.raises(UsageError, match=r"derivative|before the signal"):
        move_signal(np.arange(0, 1, 1e-3), 0.01, [0.1, 1, 50], *arguments)


def test_controls_without_bound_are_refused(machine):
    time_s = np.arange(0, 0.5, 1e-4)
    loop = loop_of(machine, controller_from_roots([], [5.0], 1e6, PERIOD_S))
    with pytest.raises(ConvergenceError, match="without bound"):
        simulate(machine, AXIS, (), time_s, 1e-3 * time_s[:, None], loops=[loop])


def test_what_cannot_be_closed_in_time_is_refused(machine):
    loop = loop_of(machine, controller_from_roots([], [], 1.0, 7e-4))
    time_s = np.arange(COUNT) * PERIOD_S
    with pytest.raises(UsageError, match="whole multiple of 1428"):
        simulate(machine, AXIS, (), time_s, np.zeros((COUNT, 1)), loops=[loop])
    with pytest.raises(UsageError, match="no loop 'ty' is closed"):
        parse_drive(machine, "reference:ty", [loop])
    with pytest.raises(UsageError, match="ends behind the signal"):
        move_signal(time_s, 1.0, [0.1, 1.0, 50.0])
    with pytest.raises(UsageError, match="above 0"):
        move_signal(time_s, 1.0, [0.1, -1.0, 50.0])
