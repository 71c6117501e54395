"""Poles at rest are 0 exactly, and slow poles that move are no rounding."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from mbmodel import system_poles

PERIOD = 1e-3
FAST = np.array([[-2e5, 0.0], [1.0, -9e4]])


def integrator_on_a_free_mass(gain):
    """x'' = u, u' = -gain x: s^3 = -gain, unstable for every gain."""
    return np.array([[0.0, 1, 0], [0, 0, 1], [-gain, 0, 0]])


def hidden(dynamics, seed):
    """The same system with its states mixed, beside poles that are up to 1e9 times as fast."""
    rng = np.random.default_rng(seed)
    whole = block_diag(dynamics, FAST)
    mixed = np.eye(len(whole)) + 0.2 * rng.standard_normal(whole.shape)
    return mixed @ whole @ np.linalg.inv(mixed)


@pytest.mark.parametrize("pole_rad_s", [1e-2, 1.0, 100.0])
def test_a_slow_pole_that_grows_is_no_rounding(pole_rad_s):
    poles = system_poles(block_diag(integrator_on_a_free_mass(pole_rad_s**3), FAST))
    growing = poles[poles.real > 0]
    assert np.abs(growing) == pytest.approx([pole_rad_s, pole_rad_s], rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_free_mass_rests_however_its_states_are_mixed(seed):
    free = hidden(np.array([[0.0, 1], [0, 0]]), seed)
    assert np.sort(np.abs(system_poles(free)))[:3] == pytest.approx([0, 0, 9e4], rel=1e-6)


def test_poles_in_discrete_time_are_those_of_the_continuous_system():
    slow = np.array([[0.0, 1, 0], [0, 0, 0], [0, 0, -3.0]])
    poles = system_poles(expm(slow * PERIOD), PERIOD)
    assert np.sort(poles.real) == pytest.approx([-3.0, 0.0, 0.0], rel=1e-9)
    assert (poles == 0).sum() == 2
    growing = system_poles(expm(integrator_on_a_free_mass(1.0) * PERIOD), PERIOD)
    assert growing.real.max() == pytest.approx(0.5, rel=1e-5)
