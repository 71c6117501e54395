"""Bands of FRFs between any ports, from a posterior of the machine's parameters."""

from dataclasses import replace

import numpy as np
import pytest
from small_machine import MJCF

from identification.words import Dof, InputError, UsageError
from mbmodel import Evaluator, FrfRequest, machine_model
from tuning import ParameterPosterior
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.plant import FrfBands, frf_bands, sample_frfs

FREQ = np.linspace(5.0, 170.0, 34)
REQUEST = FrfRequest(
    FREQ,
    (Dof.parse("acc3:+tx"), Dof.parse("acc1:-tz"), Dof.parse("head:+ry")),
    (Dof.parse("base:+tx"), Dof.parse("acc4:+tz")),
    "receptance",
)


@pytest.fixture(scope="module")
def posterior(from_text):
    """All of the machine varies; the first two stiffnesses are one coordinate."""
    model = machine_model(from_text(MJCF))
    names = [p.name for p in model.parameters]
    count = len(names)
    coordinate_of = np.maximum(np.arange(count) - 2, 0)  # damping too: any tie must work
    coordinate_of[:3] = [0, 1, 0]
    coordinate_of[3:] = np.arange(2, count - 1)
    size = count - 1
    first = [int(np.flatnonzero(coordinate_of == k)[0]) for k in range(size)]
    is_size = np.array([model.parameters[k].positive for k in first])
    rng = np.random.default_rng(3)
    mixing = rng.normal(size=(size, size)) * 0.05 + np.eye(size)
    spread = 1e-3 * np.where(is_size, 1.0, 1e-2)
    covariance = np.outer(spread, spread) * (mixing @ mixing.T)
    scale = rng.uniform(0.5, 2.0, size)
    return ParameterPosterior(
        tuple(names[k] for k in first),
        tuple(names),
        model.drawn.copy(),
        coordinate_of,
        scale,
        is_size,
        covariance,
        0.02,
        0.003,
    ).on(model)


def test_bands_are_those_of_central_differences(posterior):
    bands = frf_bands(posterior, REQUEST)
    evaluator = Evaluator(posterior.model, REQUEST)
    covariance, columns = posterior.posterior.covariance, []
    for k in range(posterior.posterior.size):
        x = np.zeros(posterior.posterior.size)
        x[k] = 1e-5
        ends = [evaluator.at(posterior.theta(sign * x)).values for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / 2e-5)
    slopes = np.stack(columns, axis=-1)
    unit = bands.values / np.abs(bands.values)
    for direction, deviation in ((unit, bands.magnitude), (1j * unit, bands.phase)):
        along = (direction[..., None].conj() * slopes).real
        variance = np.einsum("...k,kl,...l->...", along, covariance, along)
        np.testing.assert_allclose(deviation, np.sqrt(variance), rtol=1e-5)


def test_samples_spread_as_the_bands_say(posterior):
    bands = frf_bands(posterior, REQUEST)
    values = sample_frfs(posterior, posterior.sample(400, seed=8), REQUEST)
    ratio = np.abs(values).std(axis=0) / bands.magnitude
    assert 0.9 < np.median(ratio) < 1.1
    low, high = replace(bands, model_error=0 * bands.model_error).magnitude_interval()
    inside = (np.abs(values) >= low) & (np.abs(values) <= high)
    assert 0.92 < inside.mean() < 0.97


def test_samples_are_those_of_their_seed(posterior):
    first, again = (posterior.sample(3, seed=5) for _ in range(2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, posterior.sample(3, seed=6))


def test_the_model_error_is_the_discrepancy_of_the_fit(posterior):
    bands = frf_bands(posterior, REQUEST)
    lines = Evaluator(posterior.model, REQUEST).at(posterior.model.drawn)
    expected = 0.003 / np.sqrt(2) * discrepancy_motion(lines)
    np.testing.assert_allclose(bands.model_error, expected, rtol=1e-12)
    assert (bands.magnitude_deviation > bands.magnitude).all()


@pytest.mark.parametrize("size", [0.0, 0.5, 1.0, 2.0, 5.0, 30.0])
@pytest.mark.parametrize("across", [0.3, 1.0])
def test_intervals_of_magnitudes_hold_95_per_cent_at_antiresonances_too(size, across):
    value, one = np.full((1, 1, 1), size, complex), np.ones((1, 1, 1))
    bands = FrfBands(REQUEST, value, one, across * one, 0 * one)
    drawn = np.random.default_rng(2).standard_normal((2, 200_000))
    low, high = (end.item() for end in bands.magnitude_interval())
    held = np.abs(size + drawn[0] + 1j * across * drawn[1])
    assert 0.945 < np.mean((low <= held) & (held <= high)) < 0.985


def test_a_phase_is_unknown_where_nothing_moves(posterior):
    still = replace(REQUEST, freq_hz=np.array([0.0, 20.0]), quantity="accelerance")
    deviation = frf_bands(posterior, still).phase_deviation
    assert np.isinf(deviation[0]).all()
    assert np.isfinite(deviation[1]).all()


def test_a_model_that_changed_after_the_fit_is_refused(posterior, from_text):
    other = machine_model(from_text(MJCF.replace('stiffness="8e6"', 'stiffness="8.1e6"')))
    with pytest.raises(InputError, match=r"head_tx\.stiffness"):
        posterior.posterior.on(other)
    without = machine_model(from_text(MJCF.replace(' damping="40"', "")))
    with pytest.raises(InputError, match=r"head_rz\.damping"):
        posterior.posterior.on(without)


def test_a_port_that_the_machine_lacks_is_refused(posterior):
    with pytest.raises(UsageError, match="acc9"):
        frf_bands(posterior, replace(REQUEST, outputs=(Dof.parse("acc9:+tx"),)))
