"""Sums of squares to be minimised, with normal equations as fits have them."""

from dataclasses import dataclass

import numpy as np

from tuning.misfit.normal_equations import ArrowMatrix
from tuning.solvers.gauss_newton import Box


def arrow_of(dense, n_own=0):
    """An arrow of a matrix whose last ``own`` coordinates are one block."""
    n = len(dense)
    shared, block = np.arange(n - n_own), np.arange(n - n_own, n)
    count = 1 if n_own else 0
    return ArrowMatrix(
        dense[np.ix_(shared, shared)],
        dense[np.ix_(block, shared)].reshape(count, n_own, n - n_own),
        dense[np.ix_(block, block)].reshape(count, n_own, n_own),
        shared,
        block.reshape(count, n_own),
    )


@dataclass(eq=False)
class Squares:
    """J = sum r^2 + 1/2 sum precision x^2 of residuals r(x) with their Jacobian."""

    residual: object
    jacobian: object
    precision: np.ndarray
    calls: int = 0
    interrupt_at: int = -1

    def value(self, x):
        self.calls += 1
        if self.calls == self.interrupt_at:
            raise KeyboardInterrupt
        with np.errstate(all="ignore"):
            r = self.residual(x)
        return float(r @ r + 0.5 * self.precision @ x**2)

    def __call__(self, x):
        return self.quadratic_model(x)[:2]

    def quadratic_model(self, x):
        value = self.value(x)
        with np.errstate(all="ignore"):
            r, jacobian = self.residual(x), self.jacobian(x)
        gradient = 2 * jacobian.T @ r + self.precision * x
        return value, gradient, arrow_of(2 * jacobian.T @ jacobian, n_own=1)


def box_of(n, lower=-np.inf, upper=np.inf, precision=0.0):
    return Box(
        *(np.broadcast_to(np.asarray(v, float), n).copy() for v in (lower, upper, precision))
    )


TIME = np.linspace(0.0, 3.0, 40)
TRUTH = np.array([0.4, 0.9, 0.8, -0.2])


def decay(noise=0.0, precision=0.0):
    """Two decays, sizes and rates by their logarithms: exp(x0 - e^x1 t) + exp(x2 - e^x3 t / 4)."""

    def parts(x):
        one = np.exp(x[0] - np.exp(x[1]) * TIME)
        two = np.exp(x[2] - 0.25 * np.exp(x[3]) * TIME)
        return one, two

    measured = sum(parts(TRUTH)) + noise * np.random.default_rng(6).normal(size=len(TIME))

    def jacobian(x):
        one, two = parts(x)
        rates = -np.exp(x[1]) * TIME * one, -0.25 * np.exp(x[3]) * TIME * two
        return np.stack([one, rates[0], two, rates[1]], axis=1) / 0.01

    return Squares(
        lambda x: (sum(parts(x)) - measured) / 0.01, jacobian, np.full(4, float(precision))
    )
