"""NLopt in whitened coordinates: their map, bounds, minima, and how a search ends."""

import numpy as np
import pytest
import scipy.optimize

from identification.words import UsageError
from tests.helpers.squares import TRUTH, Squares, arrow_of, box_of, decay
from tuning.solvers.gauss_newton import gauss_newton
from tuning.solvers.whitened_search import search_whitened, whiten

START = np.array([0.0, 0.5, 0.5, -0.2])


def linear(n=12, condition=1e4, precision=0.0, seed=5):
    """Return a quadratic J of a given condition, and its minimum without bounds."""
    random = np.random.default_rng(seed)
    left, _ = np.linalg.qr(random.normal(size=(2 * n, n)))
    right, _ = np.linalg.qr(random.normal(size=(n, n)))
    matrix = left * np.geomspace(1.0, np.sqrt(condition), n) @ right
    data = matrix @ random.uniform(-0.5, 0.5, n) + 0.01 * random.normal(size=2 * n)
    problem = Squares(lambda x: matrix @ x - data, lambda _: matrix, np.full(n, precision))
    hessian = 2 * matrix.T @ matrix + precision * np.eye(n)
    return problem, np.linalg.solve(hessian, 2 * matrix.T @ data)


def valley():
    return Squares(
        lambda x: np.array([1 - x[0], 10 * (x[1] - x[0] ** 2)]),
        lambda x: np.array([[-1.0, 0.0], [-20 * x[0], 10.0]]),
        np.zeros(2),
    )


def recorded(problem):
    """Return the problem and the list that takes every point at which it is evaluated."""
    seen, inner = [], problem.residual
    problem.residual = lambda x: (seen.append(x.copy()), inner(x))[1]
    return problem, seen


@pytest.mark.parametrize("precision", [0.0, 3.0])
def test_in_whitened_coordinates_the_hessian_is_the_unit_matrix(precision):
    problem, best = linear(precision=precision)
    box = box_of(12, precision=precision)
    x = np.linspace(-0.3, 0.3, 12)
    value, gradient, normal = problem.quadratic_model(x)
    whitening = whiten(x, gradient, normal, box_of(12, precision=precision, lower=-9, upper=9), 0.0)
    step = 1e-3
    zero = np.zeros(12)

    def slope(y):
        return whitening.gradient(y, problem(whitening.x(y))[1])

    columns = [(slope(step * e) - slope(-step * e)) / (2 * step) for e in np.eye(12)]
    np.testing.assert_allclose(columns, np.eye(12), atol=1e-6)
    # Steepest descent by one leads to the minimum, whose J the model knows.
    at = x + whitening.matrix @ -slope(zero)
    np.testing.assert_allclose(at, best, atol=1e-8)
    assert value - whitening.predicted == pytest.approx(problem.value(best), rel=1e-9)
    assert box.precision[0] == precision


def test_the_gradient_by_whitened_coordinates_is_that_of_differences():
    problem = decay(noise=0.01)
    box = box_of(4, -3.0, 3.0)
    _, gradient, normal = problem.quadratic_model(START)
    whitening = whiten(START, gradient, normal, box, 1e-3)
    y = -0.3 * whitening.gradient(np.zeros(whitening.matrix.shape[1]), gradient)
    expected = scipy.optimize.approx_fprime(y, lambda y: problem.value(whitening.x(y)), 1e-7)
    actual = whitening.gradient(y, problem(whitening.x(y))[1])
    np.testing.assert_allclose(actual, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_steepest_descent_from_the_origin_is_the_bounded_step():
    # Three bounds hold at the minimum of the quadratic model: the others adapt to them.
    problem, best = linear()
    lower, upper = np.full(12, -0.6), np.full(12, 0.6)
    upper[0], lower[4], upper[7] = best[0] - 0.05, best[4] + 0.04, best[7] - 0.03
    x = np.clip(np.zeros(12), lower, upper)
    _, gradient, normal = problem.quadratic_model(x)
    whitening = whiten(x, gradient, normal, box_of(12, lower, upper), 0.0)
    step = whitening.x(-whitening.gradient(np.zeros(whitening.matrix.shape[1]), gradient))
    jacobian = problem.jacobian(x)
    expected = scipy.optimize.lsq_linear(
        jacobian, jacobian @ x - problem.residual(x), (lower, upper), method="bvls", tol=1e-14
    ).x
    assert whitening.matrix.shape[1] < 12
    np.testing.assert_allclose(step, expected, atol=1e-8)


@pytest.mark.parametrize("algorithm", ["LD_LBFGS", "LD_VAR2", "LD_SLSQP"])
@pytest.mark.parametrize("condition", [1e2, 1e6])
def test_a_quadratic_is_solved_in_very_few_evaluations(algorithm, condition):
    problem, best = linear(condition=condition)
    result = search_whitened(
        problem, np.zeros(12), box_of(12, -9, 9), algorithm=algorithm, damping=1e-9,
        min_gain_nats=1e-9,
    )  # fmt: skip
    assert result.outcome == "converged"
    assert result.value == pytest.approx(problem.value(best), rel=1e-6)
    assert result.evaluations <= 4
    assert problem.calls - 1 == result.evaluations  # J is not evaluated twice at one point


@pytest.mark.parametrize("precision", [0.0, 1.0, 50.0])
@pytest.mark.parametrize("lower", [-3.0, 0.25])
def test_the_minimum_is_that_of_gauss_newton(precision, lower):
    start, box = np.array([0.3, 0.5, 0.5, 0.3]), box_of(4, lower, 3.0, precision)
    problem = decay(noise=0.01, precision=precision)
    named = {"min_gain_nats": 1e-7, "tolerance": 0.0}
    expected = gauss_newton(problem, start, box, **named)
    result = search_whitened(problem, start, box, **named)
    assert result.outcome == "converged"
    assert result.value == pytest.approx(expected.value, rel=1e-6)
    np.testing.assert_allclose(result.x, expected.x, rtol=1e-2, atol=1e-3)


def test_exact_data_are_fitted_exactly():
    result = search_whitened(decay(), START, box_of(4), min_gain_nats=1e-10, tolerance=0.0)
    np.testing.assert_allclose(result.x, TRUTH, rtol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_no_evaluation_lies_outside_the_bounds(seed):
    random = np.random.default_rng(seed)
    centre = random.normal(0.0, 0.7, 4)
    lower, upper = centre - random.exponential(0.5, 4), centre + random.exponential(0.5, 4)
    problem, seen = recorded(decay(noise=0.01))
    result = search_whitened(problem, random.normal(0, 2, 4), box_of(4, lower, upper))
    assert (np.array(seen) >= lower).all()
    assert (np.array(seen) <= upper).all()
    best = scipy.optimize.least_squares(
        decay(noise=0.01).residual, np.clip(TRUTH, lower, upper), bounds=(lower, upper)
    )
    assert result.value <= 2 * best.cost * (1 + 1e-3) + 0.1


def test_no_coordinate_goes_further_from_where_it_was_whitened_than_its_step_limit():
    problem, seen = recorded(decay())
    start = np.array([0.0, 3.0, 4.0, -3.0])
    search_whitened(problem, start, box_of(4, -6, 6), max_whitenings=1)
    distances = np.abs(np.array(seen) - start).max(axis=1)
    assert 0.69 < distances.max() <= 0.7 + 1e-12


@pytest.mark.parametrize(
    ("lower", "upper"), [([-5, -5], [0.5, 5]), ([-5, 2.0], [5, 5]), ([-5, -5], [5, 5])]
)
def test_a_valley_that_ends_at_a_bound_is_followed_to_it(lower, upper):
    box = box_of(2, lower, upper)
    result = search_whitened(
        valley(), np.array([-1.2, 1.0]), box, min_gain_nats=1e-9, tolerance=0.0, max_whitenings=200
    )
    expected = gauss_newton(
        valley(), np.array([-1.2, 1.0]), box, min_gain_nats=1e-12, tolerance=0.0, max_steps=200
    )
    assert result.outcome == "converged"
    assert result.value == pytest.approx(expected.value, rel=1e-6, abs=1e-6)


def test_a_start_in_the_corner_into_which_everything_pushes_has_converged():
    problem, best = linear()
    corner = best + 0.5
    is_upper = problem(corner)[1] < 0
    box = box_of(12, np.where(is_upper, -9, corner), np.where(is_upper, corner, 9))
    result = search_whitened(problem, corner, box)
    assert result.outcome == "converged"
    assert result.evaluations == 1
    np.testing.assert_array_equal(result.x, corner)


def test_a_direction_that_nothing_sees_stays_where_it_began():
    matrix = np.array([[2.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0], [1.0, 1.0, -1.0, 0.0]])
    truth = np.array([0.5, 0.2, -0.4, 0.0])
    problem = Squares(lambda x: matrix @ (x - truth), lambda _: matrix, np.zeros(4))
    start = np.array([0.1, -0.2, 0.3, 0.77])
    result = search_whitened(problem, start, box_of(4, -9, 9), min_gain_nats=1e-10)
    assert result.outcome == "converged"
    assert result.x[3] == pytest.approx(0.77, abs=1e-12)
    assert result.x[0] + result.x[1] == pytest.approx(0.7, abs=1e-4)


def test_every_evaluation_is_counted_and_reported_with_the_best_value():
    reports = []
    problem = decay(noise=0.01)
    result = search_whitened(problem, START, box_of(4), report=lambda *what: reports.append(what))
    counts, values = zip(*reports, strict=True)
    assert list(counts) == list(range(1, result.evaluations + 1))
    assert result.evaluations == problem.calls
    assert list(values) == sorted(values, reverse=True)
    assert result.value == values[-1] == pytest.approx(problem.value(result.x), rel=1e-12)


def test_the_whitenings_are_bounded_and_that_is_said():
    result = search_whitened(valley(), np.array([-1.2, 1.0]), box_of(2), max_whitenings=2)
    assert result.outcome == "out of evaluations"
    assert "more evaluations" in result.advice
    assert result.value < valley().value(np.array([-1.2, 1.0]))


@pytest.mark.parametrize("broken", ["residual", "jacobian"])
def test_a_start_without_finite_value_and_gradient_fails_with_advice(broken):
    problem = valley()
    setattr(problem, broken, lambda _: np.full((2, 2)[: 1 + (broken == "jacobian")], np.nan))
    result = search_whitened(problem, np.array([-1.2, 1.0]), box_of(2))
    assert result.outcome == "failed"
    assert result.advice
    assert np.array_equal(result.x, [-1.2, 1.0])


def test_a_step_into_nowhere_is_shortened_until_there_is_a_value():
    # The logarithm of x has no value at 0 and below, where the first steps would go.
    problem = Squares(
        lambda x: np.array([np.log(x[0]), 3.0 * x[1]]),
        lambda x: np.array([[1 / x[0], 0.0], [0.0, 3.0]]),
        np.zeros(2),
    )
    box = box_of(2, -5, 5, precision=0.0)
    wide = type(box)(box.lower, box.upper, box.precision, np.full(2, np.inf))
    result = search_whitened(problem, np.array([2.9, 0.5]), wide, min_gain_nats=1e-12)
    assert result.outcome == "converged"
    np.testing.assert_allclose(result.x, [1.0, 0.0], atol=1e-5)


@pytest.mark.parametrize("call", [2, 5, 9, 12])
def test_an_interrupt_keeps_the_best_point(call):
    problem, seen = recorded(valley())
    problem.interrupt_at = call
    result = search_whitened(problem, np.array([-1.2, 1.0]), box_of(2))
    assert result.outcome == "interrupted"
    assert "kept" in result.advice
    best = min(seen, key=lambda x: valley().value(x))
    np.testing.assert_array_equal(result.x, best)
    assert result.value == valley().value(best)


def test_an_error_in_the_problem_comes_out_as_itself():
    problem, count = valley(), []
    inner = problem.jacobian

    def breaks(x):
        count.append(x)
        if len(count) == 3:
            raise ZeroDivisionError("mine")
        return inner(x)

    problem.jacobian = breaks
    with pytest.raises(ZeroDivisionError, match="mine"):
        search_whitened(problem, np.array([-1.2, 1.0]), box_of(2))


def test_an_algorithm_that_does_not_exist_is_refused():
    with pytest.raises(UsageError, match="LD_LBFGS"):
        search_whitened(valley(), np.array([1.0, 1.0]), box_of(2), algorithm="LD_NONSENSE")


def test_normal_equations_of_blocks_are_whitened_like_dense_ones():
    problem, _ = linear()
    x = np.linspace(-0.2, 0.2, 12)
    _, gradient, normal = problem.quadratic_model(x)
    first, second = (
        whiten(x, gradient, arrow_of(normal.dense(), n_own=n), box_of(12, -9, 9), 1e-3)
        for n in (0, 5)
    )
    np.testing.assert_allclose(first.matrix, second.matrix, rtol=1e-9, atol=1e-12)
