"""Weights: stable, minimum phase, above every magnitude, within their stated ratio."""

from itertools import pairwise

import control
import numpy as np
import pytest

from identification.words import UsageError
from tuning.plant.uncertainty.minimum_phase_bound import bound_magnitudes

FREQ = np.linspace(5.0, 200.0, 300)


def ragged(seed):
    """An error that rises, with peaks at resonances and scatter from line to line."""
    random = np.random.default_rng(seed)
    size = 0.02 + (FREQ / 300) ** 2
    for centre in random.uniform(20, 180, 4):
        size += 0.2 * random.uniform() / (1 + ((FREQ - centre) / random.uniform(1, 8)) ** 2)
    return size * np.exp(0.2 * random.normal(size=len(FREQ)))


@pytest.mark.parametrize("order", [0, 1, 2, 4, 8])
@pytest.mark.parametrize("seed", [1, 2])
def test_it_is_stable_minimum_phase_and_above(seed, order):
    magnitudes = ragged(seed)
    weight = bound_magnitudes(FREQ, magnitudes, order)
    assert len(weight.zeros) == len(weight.poles) == order
    assert (weight.zeros.real < 0).all()
    assert (weight.poles.real < 0).all()
    # by python-control from the polynomials alone
    numerator, denominator = weight.polynomials()
    values = np.abs(control.tf(numerator, denominator)(2j * np.pi * FREQ))
    assert (values >= magnitudes).all()
    assert (values / magnitudes).max() == pytest.approx(weight.ratio, rel=1e-4)


def test_a_higher_order_is_nearer():
    ratios = [bound_magnitudes(FREQ, ragged(1), order).ratio for order in (0, 1, 2, 4, 8)]
    assert all(later <= 1.02 * earlier for earlier, later in pairwise(ratios))
    assert ratios[-1] < 0.2 * ratios[0]


def test_a_filter_of_that_order_is_recovered():
    s = 2j * np.pi * FREQ
    zeros, poles = np.array([-30 + 200j, -30 - 200j]), np.array([-20 + 500j, -20 - 500j])
    true = 0.3 * np.prod(s[:, None] - zeros, axis=1) / np.prod(s[:, None] - poles, axis=1)
    weight = bound_magnitudes(FREQ, np.abs(true), 2)
    assert weight.ratio < 1.03
    np.testing.assert_allclose(np.sort_complex(weight.poles), np.sort_complex(poles), rtol=0.02)
    np.testing.assert_allclose(weight.at(s), true, rtol=0.05)  # the phase too: it is minimum phase


def test_an_order_beyond_reason_is_refused():
    with pytest.raises(UsageError, match="0 to 20"):
        bound_magnitudes(FREQ, ragged(1), 60)
