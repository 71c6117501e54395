"""The band: by median coherence, by hand, and where there is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identification_examples import a_layout, an_estimate, numbers

from identification import band, band_lines, select_band
from identification.words import Campaign, Condition, Dof, InputError, Test

FREQ = np.array([0.0, 0.5, 1.0, 2.0, 3.5, 4.0, 5.5, 6.0, 9.0])
OUTPUTS = [Dof.parse(text) for text in ("acc1:+tx", "acc2:-ty", "acc7:+tz")]
GOOD_FROM_2_TO_6 = np.array([0.9, 0.1, 0.2, 0.6, 0.3, 0.2, 0.8, 0.51, 0.5])


def a_campaign(*coherences, freq=FREQ):
    """A test for each coherence (n_freq,), (n_freq, 3) or None."""
    tests = []
    for k, coherence in enumerate(coherences):
        reference = Dof.of("hit11", k)
        values = numbers(k, (len(freq), 3, 1))
        estimate = an_estimate(values, OUTPUTS, [reference], freq_hz=freq)
        if coherence is not None:
            channels = np.broadcast_to(np.asarray(coherence).reshape(len(freq), -1), (len(freq), 3))
            estimate = replace(estimate, coherence=channels[:, :, None])
        tests.append(Test(Condition("a.uff", reference), estimate))
    return Campaign("camp", a_layout(), tuple(tests))


def chosen(*arguments, **options):
    return FREQ[band_lines(*arguments, **options)].tolist()


def test_the_band_runs_from_the_first_to_the_last_coherent_line():
    coherence = GOOD_FROM_2_TO_6.copy()
    coherence[0] = 0.4
    # 3.5 and 4 Hz are not coherent and stay; 0.5 does not exceed 0.5.
    assert chosen(a_campaign(coherence)) == [2.0, 3.5, 4.0, 5.5, 6.0]


def test_a_coherent_line_at_rest_is_in_the_band():
    assert chosen(a_campaign(GOOD_FROM_2_TO_6))[0] == 0.0


def test_the_median_runs_over_the_channels_of_all_tests():
    # Nine channels: four are bad everywhere, so the median is the least of the five good ones.
    good, bad = np.tile(GOOD_FROM_2_TO_6[:, None], 3), np.full((9, 3), 0.01)
    mixed = np.column_stack([bad[:, 0], good[:, :2]])
    good[0] = mixed[0] = 0.02
    assert chosen(a_campaign(good, bad, mixed)) == [2.0, 3.5, 4.0, 5.5, 6.0]
    most_bad = a_campaign(good, bad, np.column_stack([bad[:, :2], good[:, 0]]))
    assert chosen(most_bad) == [2.0, 3.5, 4.0, 5.5, 6.0]
    assert "only 4 of 9 channels are coherent" in select_band(most_bad).remarks[-1]


@pytest.mark.parametrize("coherences", [[None], [None, None]], ids=["one", "both"])
def test_without_coherence_the_band_is_all_but_rest(coherences):
    assert chosen(a_campaign(*coherences)) == FREQ[1:].tolist()


def test_without_coherence_a_first_line_above_rest_stays():
    freq = FREQ + 0.125
    assert band_lines(a_campaign(None, freq=freq)).all()


@pytest.mark.parametrize("coherence", [None, GOOD_FROM_2_TO_6])
def test_a_given_band_holds_both_its_ends(coherence):
    assert chosen(a_campaign(coherence), (0.5, 4.0)) == [0.5, 1.0, 2.0, 3.5, 4.0]
    assert chosen(a_campaign(coherence), (0.6, 3.9)) == [1.0, 2.0, 3.5]
    assert chosen(a_campaign(coherence), (3.5, 3.5)) == [3.5]


@pytest.mark.parametrize("band", [(20.0, 30.0), (4.0, 0.5), (4.1, 5.4), (-3.0, -1.0)])
def test_a_band_without_lines_is_refused(band):
    with pytest.raises(InputError, match=r"folder: the band .* holds none of the lines 0\.\.9 Hz"):
        band_lines(a_campaign(None), band, Path("folder"))


def test_channels_across_the_motion_do_not_hide_the_band():
    coherent = np.where((FREQ >= 2) & (FREQ <= 5.5), 0.95, 0.1)
    noise = np.full(len(FREQ), 0.1)
    campaign = a_campaign(np.column_stack([coherent, noise, noise]))
    selected = select_band(campaign)
    np.testing.assert_array_equal(selected.freq_hz, [2.0, 3.5, 4.0, 5.5])
    assert "only 1 of 3 channels are coherent" in selected.remarks[-1]


@pytest.mark.parametrize("level", [0.0, 0.3, 0.5])
def test_coherence_too_low_everywhere_is_refused_with_a_remedy(level):
    with pytest.raises(InputError, match=r"camp: .* at no line: .* give a band"):
        band_lines(a_campaign(np.full(9, level)))


@pytest.mark.parametrize("values", [1, 500_000, 500_001, 1_400_000, 23_040_000])
def test_a_part_of_many_channels_has_all_axes_of_triaxial_sensors(values):
    step = band._channel_step(values)
    assert values / step <= 500_000
    assert {place % 3 for place in range(0, 3 * step, step)} == {0, 1, 2}
