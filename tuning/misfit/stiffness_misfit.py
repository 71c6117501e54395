r"""Least squares in dynamic stiffness, of tests that are one square matrix of FRFs.

With the measured square matrix Y, the residual

    R = Y H(x)^-1 Y - Y,    dR = -(Y H^-1) dH (H^-1 Y),

is linear in the dynamic stiffness Z = H^-1, and so in most changes of a machine, however far narrow
modes move. Near the solution it equals that of the FRFs, so that their weights hold.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Complex, Real, UsageError
from mbmodel import Model
from tuning.misfit.batch import Batch, batch_tests
from tuning.misfit.weights import point_power_of
from tuning.parametrisation.parametrisation import Parametrisation

# Relative floor of the weights: gains of a second visit and what the rest does not hold. Starts
# need no better one; the refits estimate their own.
_START_FLOOR = 0.02
_STIFFNESS_HALVINGS = 3  # of a step that lowers no cost
_MIN_SINGULAR_SHARE = 1e-10  # of the scaled normal matrix: directions that nothing shows stay


@dataclass(frozen=True, eq=False)
class StiffnessMisfit:
    """Least squares in dynamic stiffness.

    Args:
        batches: tests on the lines that count, by what is evaluated at once.
        varies: coordinates.
        measured: Y; (n_freq, n, n).
        weight: 1 / standard deviation of each value; (n_freq, n, n).
    """

    batches: Sequence[Batch]
    varies: Parametrisation
    measured: Complex
    weight: Real

    @classmethod
    def build(cls, model: Model, campaign: Campaign, varies: Parametrisation) -> "StiffnessMisfit":
        """Return the least squares of tests that are one square matrix of FRFs.

        Args:
            campaign: each reference hit once, at all channels.
        """
        n, n_freq = len(campaign.tests), len(campaign.freq_hz)
        measured, variance = np.zeros((n_freq, n, n), complex), np.zeros((n_freq, n, n))
        batches = batch_tests(model, campaign)
        for batch in batches:
            power = point_power_of(batch.values, batch.evaluator.request.outputs)
            measured[:, :, batch.tests] = batch.values
            variance[:, :, batch.tests] = batch.variance + _START_FLOOR**2 * power
        weight = 1 / np.sqrt(np.maximum(variance, np.finfo(float).tiny))
        return cls(batches, varies, measured, weight)

    def expand(self, x: Real) -> tuple[float, Real, Real]:
        """Return the cost at x, its gradient and the normal matrix, with the priors."""
        precision = self.varies.precision
        try:
            cost, residual, jacobian = self.linearise(x)
        except UsageError:  # a far step to a machine without a finite response
            return np.inf, np.zeros(len(x)), np.eye(len(x))
        if not (np.isfinite(cost) and np.isfinite(jacobian).all()):
            return np.inf, np.zeros(len(x)), np.eye(len(x))
        gradient = (jacobian.conj().T @ residual).real + precision * x
        return cost, gradient, (jacobian.conj().T @ jacobian).real + np.diag(precision)

    def linearise(self, x: Real) -> tuple[float, Complex, Complex]:
        """Return the cost at x with the priors, the weighted residual, and its slopes.

        Returns:
            Cost [nats], (n_value,), (n_value, n_x).
        """
        theta, varies = self.varies.theta(x), self.varies
        values = np.zeros(self.measured.shape, complex)
        slopes = np.zeros((*self.measured.shape, len(x)), complex)
        rates, chosen = varies.rates(x), varies.free
        for batch in self.batches:
            lines = batch.evaluator.at(theta)
            values[:, :, batch.tests] = batch.select_inputs(lines.values)
            if not len(x):
                continue
            columns = lines.sensitivities(chosen, rates, varies.coordinate_of[chosen]).columns()
            slopes[:, :, batch.tests] = columns[:, :, batch.columns]
        inverse = np.linalg.inv(values)
        left, right = self.measured @ inverse, inverse @ self.measured
        residual = self.weight * (left @ self.measured - self.measured)
        moved = -np.einsum("fij,fjkp,fkl->filp", left, slopes, right, optimize=True)
        jacobian = (self.weight[..., None] * moved).reshape(residual.size, len(x))
        flat = residual.ravel()
        cost = float(np.vdot(flat, flat).real + x @ (varies.precision * x)) / 2
        return cost, flat, jacobian

    def step(
        self, x: Real, cost: float, gradient: Real, normal: Real
    ) -> tuple[Real, tuple[float, Real, Real]] | None:
        """Return the next x within the bounds, with its expansion; None if no step lowers it."""
        lower, upper = self.varies.lower, self.varies.upper
        blocked = ((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0))
        free = np.flatnonzero(~blocked)
        direction = np.zeros(len(x))
        scale = np.sqrt(np.maximum(np.diag(normal)[free], np.finfo(float).tiny))
        matrix = normal[np.ix_(free, free)] / np.outer(scale, scale)
        direction[free] = (
            -np.linalg.lstsq(matrix, gradient[free] / scale, rcond=_MIN_SINGULAR_SHARE)[0] / scale
        )
        for halving in range(_STIFFNESS_HALVINGS + 1):
            nearer = np.clip(x + direction / 2**halving, lower, upper)
            with np.errstate(over="ignore", invalid="ignore"):  # far steps of unbounded sizes
                expansion = self.expand(nearer)
            if expansion[0] < cost:
                return nearer, expansion
        return None
