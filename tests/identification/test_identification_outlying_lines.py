"""Lines that stand far above their neighbours."""

import numpy as np
import pytest

from identification.checks.files import outlying_line_remarks, shifted_axis_remark
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

OUTPUTS = tuple(Dof(site, "+tz") for site in ("acc1", "acc2"))
LAYOUT = Layout(
    ("b",), np.zeros((1, 3)), ("acc1", "acc2"), np.zeros(2, int), np.eye(3)[:2],
    np.tile(np.eye(3), (2, 1, 1)),
)  # fmt: skip
FREQ_HZ = np.arange(1.0, 201.0)


def campaign(values, noise=1e-3):
    """Return a campaign of one test with these FRFs and this standard deviation; (n_freq, 2)."""
    reference = Dof("acc1", "+tz")
    frf = Frf(FREQ_HZ, values[:, :, None], OUTPUTS, (reference,), "accelerance")
    variance = np.broadcast_to(np.asarray(noise) ** 2, frf.values.shape).copy()
    estimate = FrfEstimate(frf, variance, "coherence", np.ones((2, 1), bool), None, 10)
    return Campaign("c", LAYOUT, (Test(Condition("a.uff", reference), estimate),))


def resonance(damping):
    """Return two channels of a mode at 100 Hz, in phase."""
    ratio = FREQ_HZ / 100.0
    return (ratio**2 / (1 - ratio**2 + 2j * damping * ratio))[:, None] * np.array([1.0, 0.4])


def test_a_line_of_another_size_is_named_with_its_channels() -> None:
    values = resonance(0.01)
    values[40] *= 1000
    (remark,) = outlying_line_remarks(campaign(values))
    assert "30 times at 41 Hz (2 of 2 channels): a disturbance" in remark
    values[140, 1] *= 1000
    (remark,) = outlying_line_remarks(campaign(values))
    assert "at 41 Hz (2 of 2 channels), 141 Hz (1 of 2 channels): " in remark


@pytest.mark.parametrize("damping", [0.05, 0.003, 5e-4])
def test_modes_are_no_outliers_down_to_a_twentieth_of_the_spacing_of_lines(damping) -> None:
    assert outlying_line_remarks(campaign(resonance(damping))) == ()


def test_a_line_that_its_noise_takes_out_of_the_fit_is_not_spoken_of() -> None:
    values = resonance(0.01)
    values[40] *= 1000
    noise = np.full((*values.shape, 1), 1e-3)
    noise[40] = np.abs(values[40, :, None])
    assert outlying_line_remarks(campaign(values, noise)) == ()


def test_few_lines_have_no_neighbours_to_compare_with() -> None:
    short = resonance(0.01)
    assert len(short) == len(FREQ_HZ)
    reference = Dof("acc1", "+tz")
    frf = Frf(FREQ_HZ[:4], short[:4, :, None], OUTPUTS, (reference,), "accelerance")
    estimate = FrfEstimate(frf, np.ones((4, 2, 1)), "coherence", np.ones((2, 1), bool), None, 10)
    assert (
        outlying_line_remarks(
            Campaign("c", LAYOUT, (Test(Condition("a.uff", reference), estimate),))
        )
        == ()
    )


def test_an_axis_whose_first_line_is_that_of_0_hz_is_doubted() -> None:
    values = resonance(0.01)
    assert shifted_axis_remark(campaign(values)) == ""
    values[0] = np.abs(values[0])  # as a discrete Fourier transform gives it at 0 Hz
    assert "stated at 1 Hz, is real in all channels" in shifted_axis_remark(campaign(values))
    real = np.abs(resonance(0.01)).astype(complex)  # magnitudes alone: another fault
    assert shifted_axis_remark(campaign(real)) == ""
