"""Lines that agree better than their coherence says: hits that met different machines."""

from dataclasses import replace

import numpy as np
import pytest

from identification import find_overstated_noise, remove_overstated_noise
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

FREQ = np.arange(40, 440) * 0.5
OUTPUTS = tuple(Dof.parse(f"acc{k}:+t{axis}") for k in range(1, 9) for axis in "xyz")
HIT = Dof.parse("acc1:+tx")


def h1(random, shift, averages, noise=0.05, common=0.0):
    """H1 and coherence of hits, each on a machine whose mode is a little elsewhere."""
    gains = random.normal(size=len(OUTPUTS))
    seen = []
    for _ in range(averages):
        mode = 90.0 * (1 + shift * random.uniform(-1, 1))
        ratio = FREQ / mode
        clean = (1 / (1 - ratio**2 + 0.06j * ratio))[:, None] * gains
        scatter = random.normal(size=(2, *clean.shape)) / np.sqrt(2)
        size = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=1))[:, None]
        force = random.normal(size=(2, len(FREQ), 1)) * common / np.sqrt(2)
        seen.append(clean * (1 + force[0] + 1j * force[1]) + size * (scatter[0] + 1j * scatter[1]))
    responses = np.array(seen)  # of unit forces
    mean = responses.mean(axis=0)
    coherence = np.abs(mean) ** 2 / (np.abs(responses) ** 2).mean(axis=0)
    return mean, np.clip(coherence, 0, 1)


def campaign(seed, shift, averages=10, common=0.0):
    random = np.random.default_rng(seed)
    values, coherence = h1(random, shift, averages, common=common)
    variance = np.abs(values) ** 2 * (1 - coherence) / (coherence * (averages - 1))
    frf = Frf(FREQ, values[:, :, None], OUTPUTS, (HIT,), "accelerance")
    estimate = FrfEstimate(
        frf,
        variance[:, :, None],
        "coherence",
        np.ones((len(OUTPUTS), 1), bool),
        coherence[:, :, None],
        averages,
    )
    points = tuple(f"acc{k}" for k in range(1, 9))
    layout = Layout(
        ("body",),
        np.zeros((1, 3)),
        points,
        np.zeros(8, int),
        random.normal(size=(8, 3)),
        np.tile(np.eye(3), (8, 1, 1)),
    )
    return Campaign("moving", layout, (Test(Condition("drawn.uff", HIT), estimate),))


@pytest.mark.parametrize("seed", range(12))
def test_noise_alone_is_steady(seed):
    seen = campaign(seed, 0.0, averages=(3, 5, 10)[seed % 3])
    assert find_overstated_noise(seen) == ()
    assert remove_overstated_noise(seen, ()) is seen


@pytest.mark.parametrize("seed", range(8))
def test_noise_that_all_channels_share_is_steady_too(seed):
    assert find_overstated_noise(campaign(seed, 0.0, common=0.2)) == ()


@pytest.mark.parametrize("seed", range(6))
def test_a_mode_that_moves_between_hits_is_seen_where_it_is(seed):
    seen = campaign(seed, 0.025)
    (found,) = find_overstated_noise(seen)
    low, high = found.band
    assert low < 90 < high
    assert found.freq_hz[found.noise_share.argmin()] == pytest.approx(90, abs=8)
    assert (found.noise_share <= 1).all()
    after = remove_overstated_noise(seen, (found,))
    before, steady = (one.tests[0].estimate.variance for one in (seen, after))
    near = np.abs(FREQ - 90) < 3
    assert (steady <= before).all()
    assert np.median(steady[near] / before[near]) < 0.5
    assert after.remarks[-1].startswith(f"between {low:.0f} and {high:.0f} Hz")
    # What is left is no less than what scatters.
    power = np.abs(np.diff(seen.tests[0].estimate.frf.values, 3, axis=0)) ** 2 / 20
    assert np.median(power[: len(steady) - 3] / steady[1:-2]) / np.log(2) < 1.2


@pytest.mark.parametrize("lines", range(8, 60))
def test_of_however_few_lines_it_can_be_asked(lines):
    # Of two windows, a convolution with the three beside and between made three.
    assert find_overstated_noise(campaign(1, 0.0).select_lines(np.arange(len(FREQ)) < lines)) == ()


def test_without_coherence_nothing_is_said():
    seen = campaign(3, 0.05)
    (test,) = seen.tests
    bare = replace(test.estimate, variance_source="differences", coherence=None)
    assert find_overstated_noise(replace(seen, tests=(replace(test, estimate=bare),))) == ()
