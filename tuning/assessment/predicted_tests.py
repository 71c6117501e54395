"""Tests that were not made, as a model foresees them, with the noise of those that were."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identification import smooth_variance
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Real, Test
from mbmodel import Evaluator, Model, Question


def foreseen(
    model: Model,
    theta: Real,
    campaign: Campaign,
    noise: Mapping[Dof, Real],
    inputs: tuple[Dof, ...],
) -> Campaign:
    """The campaign with a test for each hit, and no other.

    Args:
        model: machine and Parts.
        theta: its parameters; (n_parameter,).
        campaign: whose lines and quantity count.
        noise: variance of each channel that is read; (n_freq,) each.
        inputs: hits.
    """
    outputs, quantity = tuple(noise), campaign.tests[0].estimate.frf.quantity
    question = Question(campaign.freq_hz, outputs, inputs, quantity)
    values = Evaluator(model, question).at(theta).values
    variance = np.stack(list(noise.values()), axis=1)[:, :, None]
    measured = np.ones((len(outputs), 1), bool)
    tests = []
    for column, reference in enumerate(inputs):
        frf = Frf(campaign.freq_hz, values[:, :, [column]], outputs, (reference,), quantity)
        estimate = FrfEstimate(frf, variance, "differences", measured)
        tests.append(Test(Condition("not made", reference), estimate))
    return replace(campaign, tests=tuple(tests))


def channel_noise(campaign: Campaign) -> dict[Dof, Real]:
    """Mean variance of each channel over the tests that measured it; (n_freq,) each."""
    found: dict[Dof, list[Real]] = {}
    for test in campaign.tests:
        variance = smooth_variance(test.estimate)
        for row, dof in enumerate(test.estimate.frf.outputs):
            if test.estimate.measured[row, 0]:
                found.setdefault(dof.positive, []).append(variance[:, row, 0])
    return {dof: np.mean(rows, axis=0) for dof, rows in found.items()}
