"""Batches: tests of one condition, which one evaluation of the model predicts together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from identification import smooth_variance
from identification.words import (
    Campaign,
    Complex,
    Integers,
    Mask,
    Output,
    Real,
    Test,
    distinct_dofs,
    group_by_key,
)
from mbmodel import Evaluator, FrfRequest, Linearised, Model

# Relative difference that the modal form may have from the direct solution: far below the noise,
# and within the digits that stiff springs leave of double precision.
MODAL_FORM_ERROR = 1e-6


@dataclass(frozen=True, eq=False)
class Batch:
    """Tests of one machine and window in which equal Parts act: their channels and measured values.

    Args:
        evaluator: model of the union of their outputs and inputs.
        tests: index of each test in the campaign; n_test.
        columns: index of each test's input; (n_test,).
        values: measured FRFs, with the signs of the evaluator's labels; (n_freq, n_out, n_test).
        variance: their variance, smoothed along frequency; (n_freq, n_out, n_test).
        measured: whether each channel was measured; (n_out, n_test).
        kept_weights: weights of the values by model-error floor and lines that count, which many
            fits of one campaign share.
    """

    evaluator: Evaluator
    tests: tuple[int, ...]
    columns: Integers
    values: Complex
    variance: Real
    measured: Mask
    kept_weights: dict[tuple[float, bytes], Real] = field(default_factory=dict)

    def select_inputs(self, values: Complex) -> Complex:
        """Return the values of each test's input.

        Args:
            values: (n_freq, n_out, n_in).

        Returns:
            (n_freq, n_out, n_test).
        """
        if np.array_equal(self.columns, np.arange(values.shape[2])):
            return values
        return np.moveaxis(np.moveaxis(values, 0, 2)[:, self.columns], 2, 0)

    def sum_by_input(self, cotangent: Complex) -> Complex:
        """Return sums over the tests of each input, the transpose of ``select_inputs``.

        Args:
            cotangent: (n_freq, n_out, n_test).

        Returns:
            (n_freq, n_out, n_in).
        """
        n_in = len(self.evaluator.request.inputs)
        if np.array_equal(self.columns, np.arange(n_in)):
            return cotangent
        total = np.zeros((cotangent.shape[1], n_in, cotangent.shape[0]), complex)
        for test, column in enumerate(self.columns):
            total[:, column] += cotangent[:, :, test].T
        return np.moveaxis(total, 2, 0)


# Batches of every campaign in use, by the numbers of their tests: many fits count equal lines.
_BATCHES: WeakKeyDictionary[Campaign, dict[tuple[int, ...], Batch]] = WeakKeyDictionary()


def batch_tests(model: Model, campaign: Campaign, *, direct: bool = False) -> tuple[Batch, ...]:
    """Group the tests that one evaluation of the model answers.

    Args:
        direct: whether the model solves the equations of motion directly instead of by its modes.
    """
    return tuple(
        _batch(model, campaign, numbers, direct) for numbers in _group_tests(model, campaign)
    )


def _group_tests(model: Model, campaign: Campaign) -> list[tuple[int, ...]]:
    """Return the numbers of the tests of each group that one evaluation answers."""
    groups = group_by_key(
        ((at.variant, test.estimate.window_tau, model.acting_fractions(at)), number)
        for number, test in enumerate(campaign.tests)
        for at in [test.condition]
    )
    return [tuple(numbers) for numbers in groups.values()]


def _evaluator(model: Model, tests: Sequence[Test], direct: bool) -> Evaluator:
    """Return the evaluator of the union of some tests' outputs and inputs."""
    estimate, first = tests[0].estimate, tests[0].condition
    request = FrfRequest(
        estimate.frf.freq_hz,
        distinct_dofs(dof for test in tests for dof in test.estimate.frf.outputs),
        distinct_dofs(test.condition.reference for test in tests),
        estimate.frf.quantity,
        window_tau=estimate.window_tau,
    )
    condition = first if first.variant or any(model.acting_fractions(first)) else None
    return Evaluator(model, request, condition=condition, direct=direct, agreement=MODAL_FORM_ERROR)


def _batch(model: Model, campaign: Campaign, numbers: tuple[int, ...], direct: bool) -> Batch:
    """Build the batch of some tests; its measured values are those of earlier batches."""
    tests = [campaign.tests[number] for number in numbers]
    evaluator = _evaluator(model, tests, direct)
    batches = _BATCHES.setdefault(campaign, {})
    if numbers not in batches:
        batches[numbers] = _read_batch(evaluator, tests, numbers)
    return replace(batches[numbers], evaluator=evaluator)


def _read_batch(evaluator: Evaluator, tests: Sequence[Test], numbers: tuple[int, ...]) -> Batch:
    """Return the measured values of some tests, one beside the other."""
    outputs, inputs = evaluator.request.outputs, evaluator.request.inputs
    shape = (len(outputs), len(tests), len(evaluator.request.freq_hz))
    values, variance = np.zeros(shape, complex), np.zeros(shape)
    measured = np.zeros(shape[:2], bool)
    for column, test in enumerate(tests):
        rows, signs = _rows_and_signs(test, outputs)
        frf = test.estimate.frf
        values[rows, column] = (frf.values[:, :, 0] * signs).T
        variance[rows, column] = smooth_variance(test.estimate)[:, :, 0].T
        measured[rows, column] = test.estimate.measured[:, 0]
    return Batch(
        evaluator=evaluator,
        tests=numbers,
        columns=np.array([inputs.index(t.condition.reference.positive) for t in tests], np.intp),
        values=values.transpose(2, 0, 1),
        variance=variance.transpose(2, 0, 1),
        measured=measured,
    )


def _rows_and_signs(test: Test, outputs: tuple[Output, ...]) -> tuple[list[int], Real]:
    """Return the row of each channel of a test among the outputs, and its sign there."""
    row_of = {dof: row for row, dof in enumerate(outputs)}
    labels = test.estimate.frf.outputs
    signs = [dof.sign * test.condition.reference.sign for dof in labels]
    return [row_of[dof.positive] for dof in labels], np.array(signs, float)


def predict(model: Model, theta: Real, campaign: Campaign) -> tuple[Complex, ...]:
    """Return the model's answer to each test in the test's labels; (n_freq, n_out, 1) each.

    Args:
        theta: parameters [SI]; (n_parameter,).
    """
    return evaluate_tests(model, campaign, lambda lines: lines.values, theta)


def evaluate_tests(
    model: Model, campaign: Campaign, evaluate: Callable[[Linearised], Complex], theta: Real
) -> tuple[Complex, ...]:
    """Evaluate a function of the linearised model for each test; (n_freq, n_out, 1) each.

    Args:
        evaluate: function from a linearised model to (n_freq, n_out, n_in).
        theta: parameters [SI]; (n_parameter,).
    """
    by_test: dict[int, Complex] = {}
    for numbers in _group_tests(model, campaign):
        tests = [campaign.tests[number] for number in numbers]
        evaluator = _evaluator(model, tests, direct=False)
        request, evaluated = evaluator.request, evaluate(evaluator.at(theta))
        for number, test in zip(numbers, tests, strict=True):
            rows, signs = _rows_and_signs(test, request.outputs)
            column = request.inputs.index(test.condition.reference.positive)
            by_test[number] = (evaluated[:, rows, column] * signs)[:, :, None]
    return tuple(by_test[number] for number in range(len(campaign.tests)))
