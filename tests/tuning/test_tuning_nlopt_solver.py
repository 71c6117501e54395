"""NLopt behind its one function."""

import numpy as np
import pytest

from identification.words import UsageError
from tuning import minimise

BOUNDS = (np.full(2, -5.0), np.full(2, 5.0))


def rosenbrock(x):
    value = (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2
    slope = np.array([-2 * (1 - x[0]) - 400 * x[0] * (x[1] - x[0] ** 2), 200 * (x[1] - x[0] ** 2)])
    return value, slope


@pytest.mark.parametrize("algorithm", ["LD_LBFGS", "LD_SLSQP", "LD_TNEWTON"])
def test_each_algorithm_finds_the_bottom_of_the_valley(algorithm):
    found = minimise(
        rosenbrock, np.array([-1.2, 1.0]), BOUNDS, algorithm=algorithm, tolerance=1e-14,
        max_evaluations=3000,
    )  # fmt: skip
    assert found.x == pytest.approx([1.0, 1.0], abs=1e-3)
    assert found.outcome == "converged"


def test_an_interrupt_keeps_the_best_point():
    seen = []

    def objective(x):
        value, slope = rosenbrock(x)
        seen.append(value)
        if len(seen) == 12:
            raise KeyboardInterrupt
        return value, slope

    found = minimise(objective, np.array([-1.2, 1.0]), BOUNDS)
    assert found.outcome == "interrupted"
    assert found.value == min(seen[:-1])
    assert rosenbrock(found.x)[0] == found.value
    assert "kept" in found.advice


def test_the_evaluations_are_bounded_and_that_is_said():
    found = minimise(rosenbrock, np.array([-1.2, 1.0]), BOUNDS, max_evaluations=5)
    assert found.outcome == "out of evaluations"
    assert found.evaluations == 5


def test_a_value_that_is_not_a_number_fails_with_advice_and_the_best_point():
    calls = []

    def objective(x):
        calls.append(x)
        value, slope = rosenbrock(x)
        return (np.nan if len(calls) > 4 else value), slope

    found = minimise(objective, np.array([-1.2, 1.0]), BOUNDS)
    assert found.outcome == "failed"
    assert np.isfinite(found.value)
    assert found.advice


def test_an_error_in_the_objective_comes_out_as_itself():
    def objective(x):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        minimise(objective, np.zeros(2), BOUNDS)


def test_a_start_outside_the_bounds_is_pulled_in():
    found = minimise(rosenbrock, np.array([-9.0, 7.0]), BOUNDS, tolerance=1e-12)
    assert np.isfinite(found.value)
    assert (found.x >= BOUNDS[0]).all()
    assert (found.x <= BOUNDS[1]).all()


@pytest.mark.parametrize("name", ["LD_NONSENSE", "LN_BOBYQA", "opt"])
def test_an_algorithm_without_gradient_or_existence_is_refused(name):
    with pytest.raises(UsageError, match="LD_LBFGS"):
        minimise(rosenbrock, np.zeros(2), BOUNDS, algorithm=name)
