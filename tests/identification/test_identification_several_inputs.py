"""Noise of FRFs whose inputs acted at once: multiple coherence, spectra, stated variances."""

from functools import partial

import numpy as np
import pytest
from identification_examples import HEAD, npz, read_small

from identification import coherence_variance
from identification.noise.variance import several_input_variance
from identification.words import InputError

TEST = """
[[test]]
file = "a.npz"
averages = {averages}
channels = ["1:+x", "1:+y", "2:+x", "2:+y"]
references = ["11:x", "11:y", "7:-z"]
{more}
"""
FREQ_HZ = np.arange(1.0, 41.0)
MIXING = np.array([[1.0, 0.0, 0.0], [0.7, 0.9, 0.0], [-0.4j, 0.5, 1.3]])


def complex_normal(rng, *shape):
    return rng.normal(size=(*shape, 2)) @ [1, 1j] / np.sqrt(2)


def simulated_test(rng, *, lines, averages, noise=0.3):
    """H1 of three correlated random inputs and two outputs, with g2, S_xx and the true H."""
    true = np.array([[1.0 - 0.5j, 0.3j, -2.0], [0.1, 1.4 + 1j, 0.6]])
    inputs = MIXING @ complex_normal(rng, lines, 3, averages)
    outputs = true @ inputs + noise * complex_normal(rng, lines, 2, averages)
    s_xx = inputs @ inputs.conj().swapaxes(1, 2) / averages
    s_yx = outputs @ inputs.conj().swapaxes(1, 2) / averages
    s_yy = (np.abs(outputs) ** 2).mean(axis=2)
    frf = s_yx @ np.linalg.inv(s_xx)
    explained = np.einsum("foi,foi->fo", frf, s_yx.conj()).real
    return frf, explained / s_yy, s_xx, true


@pytest.mark.parametrize("averages", [6, 20])
def test_the_multiple_coherence_predicts_the_scatter_of_correlated_inputs(averages):
    # 6000 lines are trials: the mean of |error|^2 scatters by 1.3 % and more for few averages,
    # whose inverse spectra have heavy tails; 10 % are four standard deviations at 6 averages.
    frf, coherence, s_xx, true = simulated_test(
        np.random.default_rng(averages), lines=6000, averages=averages
    )
    predicted = several_input_variance(frf, coherence, s_xx, averages).mean(axis=0)
    np.testing.assert_allclose(predicted, (abs(frf - true) ** 2).mean(axis=0), rtol=0.1)


def test_one_input_gives_the_formula_of_the_ordinary_coherence():
    rng = np.random.default_rng(1)
    values, coherence = complex_normal(rng, 5, 3, 1), rng.uniform(0.1, 0.9, (5, 3, 1))
    spectra = rng.uniform(0.1, 9.0, (5, 1, 1)) + 0j
    np.testing.assert_allclose(
        several_input_variance(values, coherence[:, :, 0], spectra, 7),
        coherence_variance(values, coherence, 7),
        rtol=1e-12,
    )


def test_units_of_inputs_and_spectra_cancel_in_the_relative_variance():
    frf, coherence, s_xx, _ = simulated_test(np.random.default_rng(2), lines=4, averages=9)
    factors = np.array([1.0, 4.4, 1e-3])
    scaled = several_input_variance(frf / factors, coherence, s_xx * np.outer(factors, factors), 9)
    expected = several_input_variance(frf, coherence, s_xx, 9) / factors**2
    np.testing.assert_allclose(scaled, expected, rtol=1e-10)


@pytest.fixture
def read(tmp_path):
    """Writes a campaign of one array file around the small layout and reads it."""

    def read_arrays(more="", *, averages=20, top="", **arrays):
        text = HEAD + top + TEST.format(averages=averages, more=more)
        return partial(read_small, tmp_path)(text, a_npz=npz(**arrays))

    return read_arrays


def four_channels(averages=20):
    """Arrays of a test with four outputs whose noise is white along frequency."""
    rng = np.random.default_rng(3)
    parts = [simulated_test(rng, lines=40, averages=averages) for _ in range(2)]
    # Both pairs of outputs share the inputs of the first, whose spectra the file holds.
    frf = np.concatenate([part[0] for part in parts], axis=1)
    multiple = np.concatenate([part[1] for part in parts], axis=1)
    coherence = np.repeat(multiple[:, :, None], 3, axis=2)
    return {"frf": frf, "coherence": coherence, "freq_hz": FREQ_HZ}, parts[0][2]


def variances(campaign):
    return np.concatenate([test.estimate.variance for test in campaign.tests], axis=2)


def sources(campaign):
    return {test.estimate.variance_source for test in campaign.tests}


@pytest.mark.parametrize(
    ("name", "more", "top"),
    [
        ("input_spectra", 'coherence = "multiple"', ""),
        ("input_spectra", "", 'coherence = "multiple"\n'),
        ("input_spectra", "", ""),
        ("Sff", 'coherence = "multiple"\ninput_spectra = "Sff"', ""),
    ],
    ids=["stated", "stated for all tests", "seen", "another name"],
)
def test_spectra_of_the_inputs_give_the_variance_of_each_cell(read, name, more, top):
    arrays, s_xx = four_channels()
    campaign = read(more, top=top, **arrays, **{name: np.moveaxis(s_xx, 0, 2)})
    expected = several_input_variance(arrays["frf"], arrays["coherence"][:, :, 0], s_xx, 20)
    np.testing.assert_allclose(variances(campaign), expected, rtol=1e-6)
    assert sources(campaign) == {"coherence"}
    assert any("counts as multiple" in remark for remark in campaign.remarks) == (not more + top)


def test_equal_coherences_of_all_references_count_as_multiple_with_a_remark(read):
    arrays, _ = four_channels()
    campaign = read(**arrays)
    assert sources(campaign) == {"differences"}
    assert [remark for remark in campaign.remarks if 'set coherence = "multiple"' in remark]
    ordinary = read('coherence = "ordinary"', **arrays)
    assert sources(ordinary) == {"coherence"}
    assert not [remark for remark in ordinary.remarks if "multiple" in remark]


def test_coherences_that_differ_between_references_are_ordinary(read):
    arrays, s_xx = four_channels()
    rng = np.random.default_rng(4)
    arrays["coherence"] = rng.uniform(0.3, 0.9, arrays["coherence"].shape)
    assert sources(read(**arrays)) == {"coherence"}
    for more, spectra in (('coherence = "multiple"', {}), ("", {"input_spectra": s_xx})):
        with pytest.raises(InputError, match="differs between references"):
            read(more, **arrays, **spectra)


def test_a_stated_variance_is_used_as_it_is(read):
    arrays, _ = four_channels()
    rng = np.random.default_rng(5)
    stated = rng.uniform(0.1, 2.0, arrays["frf"].shape)
    of_pairs = rng.normal(size=(40, 4, 4, 3))
    of_pairs[:, range(4), range(4)] = stated
    for name, array in (("variance", stated), ("covariance", of_pairs)):
        campaign = read('unit = "g/N"', **arrays, **{name: array})
        np.testing.assert_allclose(variances(campaign), 9.80665**2 * stated, rtol=1e-12)
        assert sources(campaign) == {"stated"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"input_spectra": np.ones((40, 3, 3))}, "fully correlated at 1 Hz"),
        ({"input_spectra": np.triu(np.ones((40, 3, 3)))}, "not Hermitian"),
        ({"input_spectra": np.zeros((40, 3, 3))}, "no power"),
        ({"input_spectra": np.ones((40, 2, 2))}, "has shape"),
        ({"variance": -np.ones((40, 4, 3))}, "variance is -1 where"),
        ({"variance": np.zeros((40, 4, 3))}, "variance is 0 where"),
        ({"variance": np.full((40, 4, 3), np.nan)}, "holds NaN"),
        ({"covariance": np.ones((40, 4, 3))}, "has shape"),
        ({"variance": np.ones((40, 4, 3)), "covariance": np.ones((40, 4, 4, 3)) * 2}, "differs"),
    ],
)
def test_arrays_that_are_no_noise_are_refused(read, change, message):
    arrays, _ = four_channels()
    with pytest.raises(InputError, match=message):
        read(**arrays, **change)


def test_three_averages_of_three_inputs_are_refused(read):
    arrays, s_xx = four_channels()
    with pytest.raises(InputError, match="determine no FRFs"):
        read(averages=3, **arrays, input_spectra=s_xx)
