"""Gauss-Newton between bounds: its steps against SciPy, its minima against known ones."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import example, given
from hypothesis import strategies as st

from tests.helpers.squares import TRUTH, Squares, arrow_of, box_of, decay
from tuning.solvers.bounded_step import bounded_step
from tuning.solvers.gauss_newton import gauss_newton


def rosenbrock():
    return Squares(
        lambda x: np.array([1 - x[0], 10 * (x[1] - x[0] ** 2)]),
        lambda x: np.array([[-1.0, 0.0], [-20 * x[0], 10.0]]),
        np.zeros(2),
    )


def reference(problem, box, start):
    """The same minimum by SciPy."""
    root = np.sqrt(0.5 * problem.precision)
    result = scipy.optimize.least_squares(
        lambda x: np.concatenate([problem.residual(x), root * x]),
        start,
        lambda x: np.vstack([problem.jacobian(x), np.diag(root)]),
        bounds=(box.lower, box.upper),
        xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    return result.x, 2 * result.cost


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 3, 5, 8, 13]), st.sampled_from([0.0, 2.0]))
@example(377, 3, 2.0)  # in these boxes, sets of bounds that are let go all at once come back
@example(384, 5, 2.0)
@example(229, 13, 2.0)
def test_a_bounded_step_is_the_bottom_of_its_box(seed, n, bad):
    random = np.random.default_rng(seed)
    jacobian = random.normal(size=(n + 2, n))
    jacobian = jacobian @ (np.eye(n) + bad * random.normal(size=(n, n)) / np.sqrt(n))
    gradient = jacobian.T @ random.normal(size=n + 2) * 3
    added = 10.0 ** random.uniform(-4, 0, n)
    # One in five coordinates is at a bound already, one in five has none on that side.
    lower, upper = -random.exponential(0.5, n), random.exponential(0.5, n)
    at = random.integers(0, 5, n)
    lower[at == 0], upper[at == 1], lower[at == 2], upper[at == 3] = 0.0, 0.0, -np.inf, np.inf
    normal = jacobian.T @ jacobian
    result = bounded_step(arrow_of(normal, n_own=n // 2), gradient, added, (lower, upper))
    whole = normal + np.diag(added)
    upright = np.linalg.cholesky(whole).T
    expected = scipy.optimize.lsq_linear(
        upright, -np.linalg.solve(upright.T, gradient), (lower, upper), method="bvls", tol=1e-14
    ).x
    assert (result >= lower).all()
    assert (result <= upper).all()
    costs = [gradient @ d + 0.5 * d @ whole @ d for d in (result, expected)]
    assert costs[0] <= costs[1] + 1e-9 * abs(costs[1]) + 1e-12


def test_without_bounds_a_step_is_that_of_newton():
    random = np.random.default_rng(3)
    jacobian, gradient = random.normal(size=(9, 6)), random.normal(size=6)
    added = random.uniform(0.1, 1, 6)
    normal = jacobian.T @ jacobian
    result = bounded_step(
        arrow_of(normal, n_own=2), gradient, added, (np.full(6, -np.inf), np.full(6, np.inf))
    )
    expected = -np.linalg.solve(normal + np.diag(added), gradient)
    np.testing.assert_allclose(result, expected, rtol=1e-10)


def test_the_bottom_of_the_valley_is_found():
    result = gauss_newton(rosenbrock(), np.array([-1.2, 1.0]), box_of(2), min_gain_nats=1e-20)
    np.testing.assert_allclose(result.x, [1.0, 1.0], rtol=1e-8)
    assert result.outcome == "converged"
    assert not result.advice


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        ([-5, -5], [0.5, 5], [0.5, 0.25]),
        ([-5, 2.0], [5, 5], [-np.sqrt(2), 2.0]),
        ([-5, -5], [-0.5, 0.1], None),
    ],
)
def test_a_valley_that_ends_at_a_bound_is_followed_to_it(lower, upper, expected):
    box = box_of(2, lower, upper)
    result = gauss_newton(
        rosenbrock(),
        np.array([-1.2, 1.0]),
        box,
        min_gain_nats=1e-16,
        tolerance=1e-14,
        max_steps=200,
    )
    best, cost = reference(rosenbrock(), box, np.clip([-1.0, 0.0], lower, upper))
    if expected is not None:
        np.testing.assert_allclose(result.x, expected, rtol=0.01)
    np.testing.assert_allclose(result.x, best, rtol=1e-4, atol=1e-4)
    assert rosenbrock().value(result.x) == pytest.approx(cost, rel=1e-7)
    assert result.outcome == "converged"


def test_exact_data_are_fitted_exactly():
    result = gauss_newton(decay(), np.array([0.0, 0.5, 0.5, -0.2]), box_of(4), min_gain_nats=1e-12)
    np.testing.assert_allclose(result.x, TRUTH, rtol=1e-6)


@pytest.mark.parametrize("precision", [0.0, 1.0, 50.0])
@pytest.mark.parametrize("lower", [-3.0, 0.25])
def test_noisy_data_are_fitted_as_by_another_solver(precision, lower):
    start, box = np.array([0.3, 0.5, 0.5, 0.3]), box_of(4, lower, 3.0, precision)
    problem = decay(noise=0.01, precision=precision)
    result = gauss_newton(problem, start, box, min_gain_nats=1e-9, tolerance=0.0)
    best, cost = reference(problem, box, start)
    assert problem.value(result.x) == pytest.approx(cost, rel=1e-9)
    np.testing.assert_allclose(result.x, best, rtol=1e-3, atol=1e-4)


def test_the_value_is_that_of_the_point_which_is_returned():
    for problem, start in (
        (rosenbrock(), np.array([-1.2, 1.0])),
        (decay(noise=0.01), np.array([0.0, 0.5, 0.5, -0.2])),
    ):
        for steps in (1, 3, 60):
            result = gauss_newton(problem, start, box_of(len(start)), max_steps=steps)
            assert result.value == pytest.approx(problem.value(result.x), rel=1e-12), steps


def test_what_is_left_when_it_ends_is_less_than_was_promised():
    start, box = np.array([0.0, 0.5, 0.5, -0.2]), box_of(4)
    problem = decay(noise=0.01)
    _, cost = reference(problem, box, start)
    for min_gain_nats in (1.0, 1e-2, 1e-4):
        result = gauss_newton(problem, start, box, min_gain_nats=min_gain_nats, tolerance=0.0)
        assert problem.value(result.x) - cost < min_gain_nats


def test_a_direction_that_nothing_sees_stays_where_it_began():
    # The residuals see x0 + x1 and x2; x0 - x1 and x3 are flat.
    matrix = np.array([[2.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0], [1.0, 1.0, -1.0, 0.0]])
    truth = np.array([0.5, 0.2, -0.4, 0.0])
    problem = Squares(lambda x: matrix @ (x - truth), lambda _: matrix, np.zeros(4))
    start = np.array([0.1, -0.2, 0.3, 0.77])
    result = gauss_newton(problem, start, box_of(4, -9, 9), min_gain_nats=1e-16)
    assert result.outcome == "converged"
    assert result.x[3] == pytest.approx(0.77, abs=1e-12)
    assert result.x[0] - result.x[1] == pytest.approx(0.3, abs=1e-6)
    assert result.x[0] + result.x[1] == pytest.approx(0.7, abs=1e-6)


def test_a_prior_holds_what_the_data_do_not_see_at_the_drawing():
    matrix = np.array([[1.0, 0.0], [2.0, 0.0]])
    problem = Squares(lambda x: matrix @ x - 1.0, lambda _: matrix, np.array([0.0, 1.0]))
    result = gauss_newton(
        problem, np.array([0.0, 1.5]), box_of(2, -2.5, 2.5, [0, 1]), min_gain_nats=1e-12
    )
    np.testing.assert_allclose(result.x, [0.6, 0.0], atol=1e-6)


def test_a_start_outside_the_box_is_pulled_in():
    seen = []
    problem = rosenbrock()
    inner = problem.residual
    problem.residual = lambda x: (seen.append(x.copy()), inner(x))[1]
    box = box_of(2, [-2, -1], [2, 3])
    gauss_newton(problem, np.array([-9.0, 7.0]), box)
    assert (np.array(seen) >= box.lower - 1e-12).all()
    assert (np.array(seen) <= box.upper + 1e-12).all()


def test_no_step_is_longer_than_what_a_linearisation_may_be_trusted_for():
    seen = []
    problem = decay()
    inner = problem.residual
    problem.residual = lambda x: (seen.append(x.copy()), inner(x))[1]
    gauss_newton(problem, np.array([0.0, 3.0, 4.0, -3.0]), box_of(4, -6, 6))
    accepted = [seen[0]]
    for x in seen[1:]:
        assert np.abs(x - accepted[-1]).max() <= 1.5 + 1e-12
        if decay().value(x) < decay().value(accepted[-1]):
            accepted.append(x)


def test_every_evaluation_is_counted_and_reported_in_order():
    reports = []
    problem = decay(noise=0.01)
    result = gauss_newton(
        problem,
        np.array([0.0, 0.5, 0.5, -0.2]),
        box_of(4),
        report=lambda *what: reports.append(what),
    )
    counts, values = zip(*reports, strict=True)
    assert result.evaluations == problem.calls
    assert list(counts) == sorted(set(counts))
    assert list(values) == sorted(values, reverse=True)


def test_the_steps_are_bounded_and_that_is_said():
    result = gauss_newton(rosenbrock(), np.array([-1.2, 1.0]), box_of(2), max_steps=2)
    assert result.outcome == "out of evaluations"
    assert "more evaluations" in result.advice
    assert rosenbrock().value(result.x) < rosenbrock().value(np.array([-1.2, 1.0]))


def test_a_start_without_a_finite_value_fails_with_advice():
    problem = rosenbrock()
    problem.residual = lambda x: np.array([np.nan, x[1]])
    result = gauss_newton(problem, np.array([-1.2, 1.0]), box_of(2))
    assert result.outcome == "failed"
    assert result.advice
    assert np.array_equal(result.x, [-1.2, 1.0])


def test_a_gradient_that_is_not_finite_fails_with_advice():
    problem = rosenbrock()
    problem.jacobian = lambda _: np.full((2, 2), np.nan)
    result = gauss_newton(problem, np.array([-1.2, 1.0]), box_of(2))
    assert result.outcome == "failed"
    assert result.advice


def test_a_step_into_nowhere_is_shortened_until_there_is_a_value():
    # The logarithm of x has no value at 0 and below, where the first steps would go.
    problem = Squares(
        lambda x: np.array([np.log(x[0]), 3.0 * x[1]]),
        lambda x: np.array([[1 / x[0], 0.0], [0.0, 3.0]]),
        np.zeros(2),
    )
    result = gauss_newton(problem, np.array([2.9, 0.5]), box_of(2, -5, 5), min_gain_nats=1e-16)
    assert result.outcome == "converged"
    np.testing.assert_allclose(result.x, [1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("call", [2, 5, 9, 12])
def test_an_interrupt_keeps_the_best_point(call):
    start = np.array([-1.2, 1.0])
    problem, seen = rosenbrock(), []
    inner = problem.residual

    def residual(x):
        seen.append((float(inner(x) @ inner(x)), x.copy()))
        return inner(x)

    problem.residual, problem.interrupt_at = residual, call
    result = gauss_newton(problem, start, box_of(2))
    assert result.outcome == "interrupted"
    assert "kept" in result.advice
    np.testing.assert_array_equal(result.x, min(seen, key=lambda first: first[0])[1])


def test_an_error_in_the_problem_comes_out_as_itself():
    problem = rosenbrock()

    def broken(_):
        raise ZeroDivisionError("mine")

    problem.jacobian = broken
    with pytest.raises(ZeroDivisionError, match="mine"):
        gauss_newton(problem, np.zeros(2), box_of(2))


def swinging(x):
    """Madsen's: the residual's curvature, which N lacks, sends every step too far."""
    return np.array([x[0] + 1, -0.8 * x[0] ** 2 + x[0] - 1 + 0.1 * x[1], x[1] - x[0]])


def slopes_of_swinging(x):
    return np.array([[1.0, 0.0], [-1.6 * x[0] + 1, 0.1], [-1.0, 1.0]])


def normals_until_the_end(**more):
    problem = Squares(swinging, slopes_of_swinging, np.zeros(2))
    count = []
    normal = problem.quadratic_model
    problem.quadratic_model = lambda x: (count.append(x), normal(x))[1]
    result = gauss_newton(
        problem, np.array([0.8, 0.5]), box_of(2), min_gain_nats=1e-14, tolerance=0.0, **more
    )
    return result, len(count)


def test_steps_that_go_too_far_by_the_same_factor_are_cut_to_their_best_length(monkeypatch):
    cut, few = normals_until_the_end()
    monkeypatch.setattr("tuning.solvers.gauss_newton._MIN_LENGTH_CHANGE", np.inf)
    swung, many = normals_until_the_end()
    best = scipy.optimize.least_squares(swinging, [0.8, 0.5], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert cut.x == pytest.approx(best.x, abs=1e-6)
    assert cut.value <= swung.value + 1e-12
    assert few < 0.7 * many


@pytest.mark.parametrize("wrong", [0.05, 1.0, 30.0])
def test_normal_equations_that_somebody_knew_may_be_wrong(wrong):
    problem = Squares(swinging, slopes_of_swinging, np.zeros(2))
    start = np.array([0.8, 0.5])
    known = problem.quadratic_model(start)[2] * wrong
    result = gauss_newton(
        problem, start, box_of(2), initial_normal=known, min_gain_nats=1e-14, tolerance=0.0
    )
    alone, _ = normals_until_the_end()
    assert result.x == pytest.approx(alone.x, abs=1e-5)


def test_damping_does_not_hide_what_a_prior_alone_tells_apart():
    # The data know the sum; by the prior of the first the minimum is zero.
    problem = Squares(
        lambda x: np.array([1e3 * (x[0] + x[1])]),
        lambda x: np.array([[1e3, 1e3]]),
        np.array([1.0, 0.0]),
    )
    end = gauss_newton(problem, np.array([2.5, -2.5]), box_of(2, precision=problem.precision))
    assert end.outcome == "converged"
    np.testing.assert_allclose(end.x, 0.0, atol=0.05)
