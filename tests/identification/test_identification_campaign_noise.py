"""What a campaign's files say of its noise: coherence, averages, or differences along frequency."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from identification_examples import (
    ARRAY_TEST,
    EVEN,
    FIRST,
    SECOND,
    TEST,
    npz,
    numbers,
    read_small,
    uff,
    units,
)

from identification import coherence_variance, difference_variance


@pytest.fixture
def read(tmp_path):
    """Writes a campaign around the small layout and reads it."""
    return partial(read_small, tmp_path)


def coherence_of(function, seed):
    values = np.random.default_rng(seed).uniform(0.2, 0.95, len(function.x))
    return replace(function, data=values, func=6)


def test_coherence_and_averages_give_the_variance(read):
    functions = [FIRST, SECOND]
    file = uff(*functions, *(coherence_of(f, k) for k, f in enumerate(functions)))
    (test,) = read(a_uff=file).tests
    estimate = test.estimate
    assert estimate.variance_source == "coherence"
    for k, function in enumerate(functions):
        coherence = coherence_of(function, k).data
        expected = np.abs(function.data) ** 2 * (1 - coherence) / (coherence * 9)
        np.testing.assert_allclose(estimate.variance[:, k, 0], expected, rtol=1e-9)
        np.testing.assert_allclose(estimate.coherence[:, k, 0], coherence, rtol=1e-11)


def test_a_cell_without_coherence_takes_the_variance_of_differences_and_its_coherence(read):
    functions = [FIRST, SECOND]
    (test,) = read(a_uff=uff(*functions, coherence_of(FIRST, 0))).tests
    estimate = test.estimate
    assert estimate.variance_source == "coherence"
    known = coherence_of(FIRST, 0).data
    np.testing.assert_allclose(estimate.coherence[:, 0, 0], known, rtol=1e-11)
    implied = difference_variance(SECOND.data[:, None, None])[:, 0, 0]
    ratio = 9 * implied / np.abs(SECOND.data) ** 2
    mild = ratio < 9e3  # coherences below 1e-4 count as that
    assert mild.any()
    np.testing.assert_allclose(estimate.variance[mild, 1, 0], implied[mild], rtol=1e-6)
    np.testing.assert_allclose(estimate.coherence[:, 1, 0], 1 / (1 + ratio), rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "coherent"),
    [
        (TEST, 0),
        (TEST.replace("averages = 10", ""), 2),
        (TEST.replace("averages = 10", "averages = 1"), 2),
    ],
    ids=["no coherence", "no averages", "one average"],
)
def test_without_coherence_or_averages_the_variance_is_of_differences(read, text, coherent):
    functions = [FIRST, SECOND]
    file = uff(*functions, *(coherence_of(f, k) for k, f in enumerate(functions[:coherent])))
    (test,) = read(text, a_uff=file).tests
    assert test.estimate.variance_source == "differences"
    for k, function in enumerate(functions):
        expected = difference_variance(function.data[:, None, None])[:, 0, 0]
        np.testing.assert_allclose(test.estimate.variance[:, k, 0], expected, rtol=1e-9)


def test_the_unit_of_the_file_reaches_the_variance(read):
    file = uff(units(1e3, 1.0), FIRST, coherence_of(FIRST, 1))
    (test,) = read(a_uff=file).tests
    expected = coherence_variance(FIRST.data / 1e3, coherence_of(FIRST, 1).data, 10)
    np.testing.assert_allclose(test.estimate.variance[:, 0, 0], expected, rtol=1e-9)


def test_too_few_lines_for_differences_are_refused(refusal):
    short = replace(FIRST, x=EVEN[:3], data=FIRST.data[:3])
    message = refusal(a_uff=uff(short))
    assert "a.uff" in message
    assert "3 lines are too few" in message


def test_a_coherence_of_one_everywhere_tells_nothing(read):
    values = numbers(5, (9, 4, 2))
    text = ARRAY_TEST + "averages = 6\n"
    ones = np.ones(values.shape)
    campaign = read(text, b_npz=npz(frf=values, coherence=ones, freq_hz=EVEN))
    assert any("coherence is 1 on every line" in one for one in campaign.remarks)
    for test in campaign.tests:
        assert test.estimate.coherence is None
        assert test.estimate.variance_source == "differences"
    ones[4, 1, 1] = 0.9
    campaign = read(text, b_npz=npz(frf=values, coherence=ones, freq_hz=EVEN))
    assert not any("coherence" in one for one in campaign.remarks)
    assert all(test.estimate.variance_source == "coherence" for test in campaign.tests)
