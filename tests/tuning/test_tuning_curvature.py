"""Steps by J's own curvature, where Gauss-Newton's creep along a valley."""

import numpy as np
import pytest
import scipy.optimize

from tests.helpers.squares import TRUTH, Squares, box_of, decay
from tuning.solvers.gauss_newton import gauss_newton

TURNS = 12.0  # radians that the residual turns per unit of x


def turning(x):
    """A residual that turns and stays as large, beside one that wants x at 3 and one at 1."""
    turns = np.cos(TURNS * x[0]), np.sin(TURNS * x[0])
    return np.array([*turns, x[0] - 3, x[1] - 1, 0.1 * x[0] * x[1]])


def slopes_of_turning(x):
    first = [-TURNS * np.sin(TURNS * x[0]), TURNS * np.cos(TURNS * x[0]), 1.0, 0.0, 0.1 * x[1]]
    return np.array([first, [0.0, 0.0, 0.0, 1.0, 0.1 * x[0]]]).T


def turned(exact_curvature, steps, start=0.0, **box):
    problem = Squares(turning, slopes_of_turning, np.zeros(2))
    return gauss_newton(
        problem,
        np.array([start, 0.0]),
        box_of(2, **box),
        min_gain_nats=1e-9,
        tolerance=0.0,
        max_steps=steps,
        exact_curvature=exact_curvature,
    )


def test_where_residuals_turn_steps_by_their_own_curvature_arrive():
    best = scipy.optimize.minimize(lambda x: turning(x) @ turning(x), [3.0, 1.0], tol=1e-14)
    # N is J's curvature 145 times: each step goes 1 / 145 of the way.
    crept = turned(exact_curvature=False, steps=30)
    assert crept.x[0] < 1.5
    arrived = turned(exact_curvature=True, steps=30)
    assert arrived.outcome == "converged"
    assert arrived.x == pytest.approx(best.x, abs=1e-4)
    assert arrived.value == pytest.approx(best.fun, abs=1e-8)
    assert arrived.evaluations < 150


def test_steps_by_curvature_stay_inside_bounds():
    result = turned(exact_curvature=True, steps=40, upper=[2.0, 0.5])
    assert result.outcome == "converged"
    assert result.x == pytest.approx([2.0, 0.5], abs=1e-9)


def test_steps_by_curvature_never_rise():
    values = []
    problem = Squares(turning, slopes_of_turning, np.zeros(2))
    gauss_newton(
        problem,
        np.array([-5.0, 4.0]),
        box_of(2),
        exact_curvature=True,
        report=lambda _, j: values.append(j),
    )
    assert len(values) > 3
    assert (np.diff(values) <= 0).all()


def test_without_creeping_curvature_costs_nothing():
    start = TRUTH + 0.1
    first, second = (
        gauss_newton(decay(), start, box_of(4), exact_curvature=exact_curvature)
        for exact_curvature in (False, True)
    )
    assert first.evaluations == second.evaluations
    assert (first.x == second.x).all()
