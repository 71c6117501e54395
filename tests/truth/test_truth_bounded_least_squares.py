"""Bounded least squares against SciPy's, where effects are far larger than the bounds."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from truth.campaign.linear_refit import BOUND, bounded_solution


def draw_problem(random, size, rank, magnitude):
    """J of correlated columns with the prior beneath it, and a change that it is to follow."""
    rows = 4 * size
    jacobian = random.standard_normal((rows, rank)) @ random.standard_normal((rank, size))
    jacobian += 0.01 * random.standard_normal((rows, size))
    bounded = random.random(size) < 0.9
    goal = magnitude * random.standard_normal(rows)
    whole = np.vstack([jacobian, np.diag(bounded.astype(float))])
    return whole, np.append(goal, np.zeros(size)), bounded


@pytest.mark.parametrize("magnitude", [1.0, 1e2, 1e4])
@pytest.mark.parametrize(("size", "rank"), [(12, 12), (40, 12), (60, 20), (90, 30)])
def test_the_cost_is_scipys(size, rank, magnitude):
    """Some of the larger problems go round in circles if whole blocks change until the end."""
    whole, goal, bounded = draw_problem(np.random.default_rng(size), size, rank, magnitude)
    solution = bounded_solution(whole.T @ whole, whole.T @ goal, bounded)
    limit = np.where(bounded, BOUND, np.inf)
    scale = np.linalg.norm(whole, axis=0)
    bounds = (-limit * scale, limit * scale)
    peer = lsq_linear(whole / scale, goal, bounds, method="bvls", tol=1e-14, max_iter=5000)
    residual = whole @ solution - goal
    assert residual @ residual / 2 == pytest.approx(peer.cost, rel=1e-9)
    assert (np.abs(solution) <= limit * (1 + 1e-12)).all()
    np.testing.assert_allclose(solution, peer.x / scale, rtol=1e-4, atol=1e-4)


def test_the_slope_pushes_held_tolerances_outwards():
    """Conditions of optimality (Karush, Kuhn and Tucker), for a change 1e5 times the noise."""
    whole, goal, bounded = draw_problem(np.random.default_rng(1), 120, 36, 1e5)
    normal, right = whole.T @ whole, whole.T @ goal
    solution = bounded_solution(normal, right, bounded)
    slope = (normal @ solution - right) / np.sqrt(np.diag(normal))
    is_held = bounded & (np.abs(solution) >= BOUND * (1 - 1e-12))
    largest = np.abs(right / np.sqrt(np.diag(normal))).max()
    assert is_held.sum() > 10
    assert np.abs(slope[~is_held]).max() < 1e-8 * largest
    assert (slope * np.sign(solution))[is_held].max() < 1e-8 * largest


def test_a_spring_that_no_sensor_sees_stays():
    normal = np.diag([4.0, 0.0, 1.0])
    solution = bounded_solution(normal, np.array([2.0, 0.0, 9.0]), np.array([True, False, True]))
    np.testing.assert_allclose(solution, [0.5, 0.0, BOUND])
