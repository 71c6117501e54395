"""Tests that one evaluation of the model answers, stacked side by side."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification import smooth_variance
from identification.words import Campaign, Complex, Dof, Integers, Mask, Real, Test, distinct
from mbmodel import Evaluator, Linearised, Model, Question

# Of the modal form with the direct solve: far below the noise, and what directions that stiff
# springs hold leave of sixteen digits.
_AGREEMENT = 1e-6


@dataclass(frozen=True, eq=False)
class Batch:
    """Tests of one window in which the same Parts act: their channels, and what was measured.

    Args:
        evaluator: of the union of their outputs and inputs.
        tests: numbers of the tests in the campaign; n_test.
        columns: number of the input of each test; (n_test,).
        values: measured FRFs, signs as in ``outputs``; (n_freq, n_out, n_test).
        variance: of them, smooth along frequency; (n_freq, n_out, n_test).
        measured: (n_out, n_test).
    """

    evaluator: Evaluator
    tests: tuple[int, ...]
    columns: Integers
    values: Complex
    variance: Real
    measured: Mask

    def pick(self, values: Complex) -> Complex:
        """From every input to the tests' inputs; (n_freq, n_out, n_in) to (.., n_test)."""
        if np.array_equal(self.columns, np.arange(values.shape[2])):
            return values
        return np.moveaxis(np.moveaxis(values, 0, 2)[:, self.columns], 2, 0)

    def spread(self, cotangent: Complex) -> Complex:
        """The transpose of ``pick``: sum over the tests of each input."""
        n_in = len(self.evaluator.question.inputs)
        if np.array_equal(self.columns, np.arange(n_in)):
            return cotangent
        spread = np.zeros((cotangent.shape[1], n_in, cotangent.shape[0]), complex)
        for test, column in enumerate(self.columns):
            spread[:, column] += cotangent[:, :, test].T
        return np.moveaxis(spread, 2, 0)


def batches(model: Model, campaign: Campaign, *, direct: bool = False) -> tuple[Batch, ...]:
    """Group the tests that one evaluation answers."""
    groups: dict[tuple[float, tuple[float, ...]], list[int]] = {}
    for number, test in enumerate(campaign.tests):
        key = test.estimate.window_tau, model.acting(test.condition)
        groups.setdefault(key, []).append(number)
    return tuple(_batch(model, campaign, tuple(numbers), direct) for numbers in groups.values())


def _batch(model: Model, campaign: Campaign, numbers: tuple[int, ...], direct: bool) -> Batch:
    tests = [campaign.tests[number] for number in numbers]
    outputs = distinct(dof for test in tests for dof in test.estimate.frf.outputs)
    inputs = distinct(test.condition.reference for test in tests)
    question = Question(
        campaign.freq_hz,
        outputs,
        inputs,
        tests[0].estimate.frf.quantity,
        window_tau=tests[0].estimate.window_tau,
    )
    condition = tests[0].condition if any(model.acting(tests[0].condition)) else None
    shape = (len(outputs), len(tests), len(campaign.freq_hz))
    values, variance = np.zeros(shape, complex), np.zeros(shape)
    measured = np.zeros(shape[:2], bool)
    for column, test in enumerate(tests):
        rows, signs = _places(test, outputs)
        frf = test.estimate.frf
        values[rows, column] = (frf.values[:, :, 0] * signs).T
        variance[rows, column] = smooth_variance(test.estimate)[:, :, 0].T
        measured[rows, column] = test.estimate.measured[:, 0]
    return Batch(
        evaluator=Evaluator(
            model, question, condition=condition, direct=direct, agreement=_AGREEMENT
        ),
        tests=numbers,
        columns=np.array([inputs.index(t.condition.reference.positive) for t in tests], np.intp),
        values=values.transpose(2, 0, 1),
        variance=variance.transpose(2, 0, 1),
        measured=measured,
    )


def _places(test: Test, outputs: tuple[Dof, ...]) -> tuple[list[int], Real]:
    """Rows of a test's channels among the outputs, and the sign of each against them."""
    where = {dof: row for row, dof in enumerate(outputs)}
    measured = test.estimate.frf.outputs
    signs = [dof.sign * test.condition.reference.sign for dof in measured]
    return [where[dof.positive] for dof in measured], np.array(signs, float)


def predict(model: Model, theta: Real, campaign: Campaign) -> tuple[Complex, ...]:
    """The model's answer to each test, in the test's own labels; (n_freq, n_out, 1) each."""
    return answers(model, campaign, lambda lines: lines.values, theta)


def answers(
    model: Model, campaign: Campaign, ask: Callable[[Linearised], Complex], theta: Real
) -> tuple[Complex, ...]:
    """What is asked of the linearised model, for each test; (n_freq, n_out, 1) each.

    Args:
        model: machine and Parts.
        campaign: the tests.
        ask: gives (n_freq, n_out, n_in) of a linearised model.
        theta: parameters in SI; (n_parameter,).
    """
    found: dict[int, Complex] = {}
    for batch in batches(model, campaign):
        picked = batch.pick(ask(batch.evaluator.at(theta)))
        question = batch.evaluator.question
        for column, number in enumerate(batch.tests):
            rows, signs = _places(campaign.tests[number], question.outputs)
            found[number] = (picked[:, rows, column] * signs)[:, :, None]
    return tuple(found[number] for number in range(len(campaign.tests)))
