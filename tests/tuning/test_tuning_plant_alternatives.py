"""Intervals over alternative plants against samples of the mixture."""

import numpy as np
import pytest

from identification.words import Dof, UsageError
from mbmodel import FrfRequest
from tuning.plant import AlternativePlants, FrfBands

REQUEST = FrfRequest(
    np.array([1.0, 2.0]), (Dof.parse("a:+tx"),), (Dof.parse("a:+tx"),), "receptance"
)


def bands(sizes, deviations, across=0.0):
    values = np.array(sizes, complex)[:, None, None]
    deviation = np.array(deviations)[:, None, None]
    return FrfBands(REQUEST, values, deviation, across * deviation, 0 * deviation)


def test_the_interval_is_that_of_samples_of_the_mixture():
    plants = AlternativePlants(
        ("tuned", "appendage"),
        np.array([0.3, 0.7]),
        (bands([10.0, 5.0], [0.5, 0.1]), bands([12.0, 5.1], [0.2, 0.4])),
    )
    low, high = plants.magnitude_interval()
    random = np.random.default_rng(2)
    is_first = random.random(400_000) < 0.3
    for line, (first, second) in enumerate((((10, 0.5), (12, 0.2)), ((5, 0.1), (5.1, 0.4)))):
        drawn = np.where(is_first, random.normal(*first, 400_000), random.normal(*second, 400_000))
        expected = np.quantile(drawn, [0.025, 0.975])
        np.testing.assert_allclose([low[line, 0, 0], high[line, 0, 0]], expected, atol=0.01)


def test_a_certain_plant_has_its_own_interval():
    single = bands([10.0, 5.0], [0.5, 0.1], across=3.0)
    plants = AlternativePlants(("a", "b"), np.array([1.0, 0.0]), (single, bands([90, 80], [1, 1])))
    for mixed, alone in zip(plants.magnitude_interval(), single.magnitude_interval(), strict=True):
        np.testing.assert_allclose(mixed, alone, rtol=1e-6)


def test_weights_are_probabilities():
    single = bands([10.0, 5.0], [0.5, 0.1], across=3.0)
    with pytest.raises(UsageError, match="sum one"):
        AlternativePlants(("a", "b"), np.array([0.9, 0.9]), (single, single))
