"""Discrete systems against sums over residues, sums over aliases, and a simulation of pieces."""

import control
import numpy as np
import pytest
import scipy.linalg
from mbmodel_examples import mass_on_spring, mjcf

from identification.words import Dof, InputError
from mbmodel import FrfRequest, SystemMatrices, as_drawn, discretise, state_space

PERIOD = 1.7e-3
DELAYS = [0.0, 0.4e-3, PERIOD, 2.6e-3, 5 * PERIOD + 1.1e-3]


def matrices(model, outputs, inputs, quantity):
    dofs = [tuple(map(Dof.parse, labels)) for labels in (outputs, inputs)]
    system = state_space(model, model.drawn, FrfRequest(np.ones(1), *dofs, quantity))
    return SystemMatrices(system.A, system.B, system.C, system.D)


def by_residues(system, freq, period, delay):
    """Modified z transform, pole by pole; (n_freq, n_out, n_in)."""
    poles, vectors = np.linalg.eig(system.a)
    left = np.linalg.solve(vectors, system.b)
    right = system.c @ vectors
    periods = int(delay / period + 1e-9)
    fraction = delay - periods * period
    z = np.exp(2j * np.pi * freq * period)
    total = np.zeros((len(freq), *system.d.shape), complex)
    for k, p in enumerate(poles):
        new = np.expm1(p * (period - fraction)) / p
        old = np.exp(p * (period - fraction)) * np.expm1(p * fraction) / p
        factor = (new + old / z) * z**-periods / (z - np.exp(p * period))
        total += factor[:, None, None] * np.outer(right[:, k], left[k])
    return total + system.d * (z ** -(periods + (fraction > 1e-12)))[:, None, None]


@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
@pytest.mark.parametrize("delay", DELAYS)
def test_the_station_is_held_exactly(station_model, quantity, delay):
    ports = ("hexapod:+tx", "acc1:+tz"), ("acc11:+tx", "ty:+tz")
    system = matrices(station_model, *ports, quantity)
    sampled = discretise(system, PERIOD, np.full(2, delay))
    freq = np.linspace(1.0, 0.49 / PERIOD, 60)
    values = sampled.system.at(np.exp(2j * np.pi * freq * PERIOD))
    expected = by_residues(system, freq, PERIOD, delay)
    assert (np.abs(values - expected) < 1e-9 * np.abs(expected).max(axis=0)).all()


def test_a_held_input_has_the_sum_of_all_aliases(from_text):
    # Poisson: sum over k of G(s_k) exp(-s_k tau) (1 - exp(-s T)) / (s_k T), s_k = s + 2 pi i k / T
    model = as_drawn(from_text(mjcf(mass_on_spring(2.0, 8e4, 40.0))))
    system = matrices(model, ("a:+tz",), ("a:+tz",), "receptance")
    freq, delay = np.array([7.0, 31.0, 90.0, 211.0]), 2.6e-3
    s = 2j * np.pi * freq
    total = np.zeros(len(freq), complex)
    for alias in np.arange(-30_000, 30_001):
        shifted = s + 2j * np.pi * alias / PERIOD
        hold = -np.expm1(-s * PERIOD) / (shifted * PERIOD)
        total += hold * np.exp(-shifted * delay) / (2.0 * shifted**2 + 40.0 * shifted + 8e4)
    sampled = discretise(system, PERIOD, np.array([delay]))
    values = sampled.system.at(np.exp(s * PERIOD))[:, 0, 0]
    np.testing.assert_allclose(values, total, atol=1e-9 * np.abs(total).max())


def test_inputs_may_be_late_by_different_times(from_text):
    text = mjcf(mass_on_spring(2.0, 8e4, 4.0) + mass_on_spring(1.0, 9e3, 2.0, name="b", node=2))
    system = matrices(as_drawn(from_text(text)), ("a:+tz", "b:+tz"), ("a:+tz", "b:+tz"), "mobility")
    delays, period = np.array([1.3e-3, 4.1e-3]), 1e-3
    sampled = discretise(system, period, delays)
    assert sampled.delay_states == ((0, 1), (0, 2), (1, 1), (1, 2), (1, 3), (1, 4), (1, 5))
    signals = np.random.default_rng(1).normal(size=(40, 2))
    state, outputs = np.zeros(sampled.system.order), []
    for u in signals:
        outputs.append(sampled.system.c @ state + sampled.system.d @ u)
        state = sampled.system.a @ state + sampled.system.b @ u
    # the late inputs piece by piece: every step lies on a grid of 0.1 ms
    fine, x, expected = 1e-4, np.zeros(4), []
    extended = np.block([[system.a, system.b], [np.zeros((2, 6))]])
    power = scipy.linalg.expm(extended * fine)
    for k in range(400):
        arrived = [int((k - round(delay / fine)) // 10) for delay in delays]
        u = np.array([signals[n, j] if n >= 0 else 0.0 for j, n in enumerate(arrived)])
        if k % 10 == 0:
            expected.append(system.c @ x)
        x = power[:4, :4] @ x + power[:4, 4:] @ u
    size = np.abs(expected).max()
    np.testing.assert_allclose(outputs, expected, atol=1e-10 * size)


def test_without_a_delay_it_is_python_controls(from_text):
    model = as_drawn(from_text(mjcf(mass_on_spring(2.0, 8e4, 40.0))))
    system = matrices(model, ("a:+tz",), ("a:+tz",), "mobility")
    sampled = discretise(system, PERIOD, np.zeros(1)).system
    expected = control.ss(system.a, system.b, system.c, system.d).sample(PERIOD, "zoh")
    z = np.exp(2j * np.pi * np.array([5.0, 40.0, 200.0]) * PERIOD)
    values = np.array([expected(point) for point in z])
    np.testing.assert_allclose(sampled.at(z)[:, 0, 0], values, rtol=1e-10)


def test_a_rigid_mode_integrates_exactly(from_text):
    body = mass_on_spring(2.0, 0.0, 0.0)
    system = matrices(as_drawn(from_text(mjcf(body))), ("a:+tz",), ("a:+tz",), "receptance")
    sampled = discretise(system, 0.01, np.array([0.004])).system
    z = np.exp(2j * np.pi * np.array([1.0, 7.0]) * 0.01)
    # Phi = [[1, T], [0, 1]], Gamma_0 = [(T-f)^2/2, T-f]/m, Gamma_1 = [f (T - f/2), f]/m
    new = np.array([0.006**2 / 2, 0.006]) / 2
    old = np.array([0.004 * (0.006 + 0.002), 0.004]) / 2
    expected = [
        np.linalg.solve(np.array([[p - 1, -0.01], [0, p - 1]]), new + old / p)[0] for p in z
    ]
    np.testing.assert_allclose(sampled.at(z)[:, 0, 0], expected, rtol=1e-10)


def test_a_delay_in_milliseconds_is_refused():
    system = SystemMatrices(-np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)))
    with pytest.raises(InputError, match="10000 sampling periods"):
        discretise(system, 1e-4, np.array([1.5]))
