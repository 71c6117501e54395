"""Every n-th line of a large test stands for all where a check needs no more."""

import numpy as np
import pytest

from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    Test,
    thinning_step,
)


def a_campaign(lines=40):
    output, source = Dof.parse("acc1:+tx"), Dof.parse("acc1:+ty")
    values = np.arange(1.0, lines + 1).reshape(-1, 1, 1) + 1j
    frf = Frf(np.arange(1.0, lines + 1), values, (output,), (source,), "accelerance")
    estimate = FrfEstimate(frf, np.ones(values.shape), "stated", np.ones((1, 1), bool))
    layout = Layout(
        ("body",), np.zeros((1, 3)), ("acc1",), np.zeros(1, int), np.zeros((1, 3)), np.eye(3)[None]
    )
    return Campaign("it", layout, (Test(Condition("it.npz", source), estimate),))


@pytest.mark.parametrize(("values", "step"), [(1, 1), (500_000, 1), (500_001, 2), (4_900_000, 10)])
def test_no_more_values_remain_than_a_check_takes(values, step):
    assert thinning_step(values) == step


def test_every_line_of_an_ordinary_campaign_is_checked():
    campaign = a_campaign()
    assert campaign.thin_lines() is campaign


def test_a_large_campaign_is_thinned_evenly_and_without_a_copy(monkeypatch):
    campaign = a_campaign()
    monkeypatch.setattr(thinning_step, "__defaults__", (15,))
    thin = campaign.thin_lines()
    np.testing.assert_array_equal(thin.freq_hz, campaign.freq_hz[::3])
    values = [of.tests[0].estimate.frf.values for of in (campaign, thin)]
    assert np.shares_memory(*values)
