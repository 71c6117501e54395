"""NLopt behind its one function."""

import numpy as np
import pytest

from identification.words import UsageError
from tuning.solvers.nlopt_solver import minimise

BOUNDS = (np.full(2, -5.0), np.full(2, 5.0))


def rosenbrock(x):
    value = (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2
    slope = np.array([-2 * (1 - x[0]) - 400 * x[0] * (x[1] - x[0] ** 2), 200 * (x[1] - x[0] ** 2)])
    return value, slope


@pytest.mark.parametrize("algorithm", ["LD_LBFGS", "LD_SLSQP", "LD_TNEWTON"])
def test_each_algorithm_finds_the_bottom_of_the_valley(algorithm):
    result = minimise(
        rosenbrock, np.array([-1.2, 1.0]), BOUNDS, algorithm=algorithm, tolerance=1e-14,
        max_evaluations=3000,
    )  # fmt: skip
    assert result.x == pytest.approx([1.0, 1.0], abs=1e-3)
    assert result.outcome == "converged"


def test_an_interrupt_keeps_the_best_point():
    seen = []

    def objective(x):
        value, slope = rosenbrock(x)
        seen.append(value)
        if len(seen) == 12:
            raise KeyboardInterrupt
        return value, slope

    result = minimise(objective, np.array([-1.2, 1.0]), BOUNDS)
    assert result.outcome == "interrupted"
    assert result.value == min(seen[:-1])
    assert rosenbrock(result.x)[0] == result.value
    assert "kept" in result.advice


def test_the_evaluations_are_bounded_and_that_is_said():
    result = minimise(rosenbrock, np.array([-1.2, 1.0]), BOUNDS, max_evaluations=5)
    assert result.outcome == "out of evaluations"
    assert result.evaluations == 5


def test_a_value_that_is_not_a_number_fails_with_advice_and_the_best_point():
    calls = []

    def objective(x):
        calls.append(x)
        value, slope = rosenbrock(x)
        return (np.nan if len(calls) > 4 else value), slope

    result = minimise(objective, np.array([-1.2, 1.0]), BOUNDS)
    assert result.outcome == "failed"
    assert np.isfinite(result.value)
    assert result.advice


def test_an_error_in_the_objective_comes_out_as_itself():
    def objective(x):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        minimise(objective, np.zeros(2), BOUNDS)


def test_a_start_outside_the_bounds_is_pulled_in():
    result = minimise(rosenbrock, np.array([-9.0, 7.0]), BOUNDS, tolerance=1e-12)
    assert np.isfinite(result.value)
    assert (result.x >= BOUNDS[0]).all()
    assert (result.x <= BOUNDS[1]).all()


@pytest.mark.parametrize("name", ["LD_NONSENSE", "LN_BOBYQA", "opt"])
def test_an_algorithm_without_gradient_or_existence_is_refused(name):
    with pytest.raises(UsageError, match="LD_LBFGS"):
        minimise(rosenbrock, np.zeros(2), BOUNDS, algorithm=name)


def test_a_search_that_is_told_to_stop_keeps_the_best_point():
    seen = []

    def objective(x):
        seen.append(rosenbrock(x)[0])
        return rosenbrock(x)

    result = minimise(objective, np.array([-1.2, 1.0]), BOUNDS, stop=lambda: len(seen) == 7)
    assert result.outcome == "converged"
    assert result.evaluations == len(seen) == 7
    assert result.value == min(seen)


def test_a_search_ends_at_an_absolute_change_too():
    first, second = (
        minimise(rosenbrock, np.array([-1.2, 1.0]), BOUNDS, tolerance=0.0, min_change=change)
        for change in (1.0, 1e-10)
    )
    assert first.evaluations < second.evaluations
    assert second.value < 1e-8
