"""Tests that were not made, predicted by a model with the noise of those that were."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identification import smooth_variance
from identification.words import (
    Campaign,
    Condition,
    Frf,
    FrfEstimate,
    Input,
    Output,
    Real,
    Test,
)
from mbmodel import Evaluator, FrfRequest, Model


def predict_tests(
    model: Model,
    theta: Real,
    campaign: Campaign,
    variances: Mapping[Output, Real],
    inputs: tuple[Input, ...],
) -> Campaign:
    """Return a campaign of one predicted test for each hit.

    Args:
        model: machine and Parts.
        theta: parameters [SI]; (n_parameter,).
        campaign: campaign with the lines and the quantity.
        variances: variance of each channel; (n_freq,) each.
        inputs: hits.
    """
    outputs, quantity = tuple(variances), campaign.tests[0].estimate.frf.quantity
    question = FrfRequest(campaign.freq_hz, outputs, inputs, quantity)
    values = Evaluator(model, question).at(theta).values
    variance = np.stack(list(variances.values()), axis=1)[:, :, None]
    measured = np.ones((len(outputs), 1), bool)
    tests = []
    for column, reference in enumerate(inputs):
        frf = Frf(campaign.freq_hz, values[:, :, [column]], outputs, (reference,), quantity)
        estimate = FrfEstimate(frf, variance, "differences", measured)
        tests.append(Test(Condition("not made", reference), estimate))
    return replace(campaign, tests=tuple(tests))


def mean_channel_variance(campaign: Campaign) -> dict[Output, Real]:
    """Return the mean variance of each channel over the tests that measured it; (n_freq,) each."""
    by_channel: dict[Output, list[Real]] = {}
    for test in campaign.tests:
        variance = smooth_variance(test.estimate)
        for row, dof in enumerate(test.estimate.frf.outputs):
            if test.estimate.measured[row, 0]:
                by_channel.setdefault(dof.positive, []).append(variance[:, row, 0])
    return {dof: np.mean(rows, axis=0) for dof, rows in by_channel.items()}
