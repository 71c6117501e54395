"""The optimiser of mujoco.sysid on our residual with our exact Jacobian, for the bench alone.

``mujoco.sysid.optimize`` hands its residual to ``mujoco.minimize.least_squares``, which is called
here directly: optimize always has it keep the Jacobian of every iteration, 190 MB each here.
It is given what our own fit has: the residual of each stage with its weights, on the same lines, as
a function of the logarithms of the parameters, with exact derivatives, between the same bounds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco.minimize
import numpy as np

from identification.words import Campaign
from mbmodel import Model
from tuning import Parametrisation, Stage
from tuning.fitting.stage_search import thin_lines
from tuning.misfit.batch import Batch, batch_tests
from tuning.misfit.weights import FORCE_ERROR_FLOOR

SHORT_TOLERANCE = 1e-3  # of a stage that others follow


@dataclass(frozen=True, eq=False)
class PeerEnd:
    """Where the optimiser ended, and how many residuals and Jacobians it took."""

    x: np.ndarray
    residuals: int
    jacobians: int


def sysid_fit(
    model: Model,
    campaign: Campaign,
    parametrisation: Parametrisation,
    start: np.ndarray,
    stages: Sequence[Stage],
    **options: object,
) -> PeerEnd:
    """Go through some stages, a step of less than the stage's tolerance ending each.

    Args:
        model: machine and parameters, all of them sizes that vary.
        campaign: of one window.
        freedom: coordinates, none with a prior.
        start: theta in SI; (n_parameter,).
        stages: their tolerance is of the step, relative to the length of log theta.
        options: of ``mujoco.minimize.least_squares``.
    """
    drawn = np.log(parametrisation.fixed)
    x = np.log(start)
    residuals = jacobians = 0
    for stage in stages:
        (batch,) = batch_tests(model, thin_lines(campaign, stage.stride))
        problem = Residual(batch, parametrisation, stage)
        x, _ = mujoco.minimize.least_squares(
            x,
            problem.residual,
            bounds=(drawn + parametrisation.lower, drawn + parametrisation.upper),
            jacobian=problem.jacobian,
            xtol=stage.tolerance,
            verbose=mujoco.minimize.Verbosity.SILENT,
            **options,
        )
        residuals, jacobians = residuals + problem.residuals, jacobians + problem.jacobians
    return PeerEnd(x - drawn, residuals, jacobians)


class Residual:
    """The weighted residual of a stage as a column of numbers, and its Jacobian.

    Args:
        batch: all tests.
        freedom: coordinates.
        stage: its allowance, and whether the residual is the logarithm of the ratio.
    """

    def __init__(self, batch: Batch, parametrisation: Parametrisation, stage: Stage) -> None:
        self._batch, self._freedom, self._stage = batch, parametrisation, stage
        size = np.abs(batch.values)
        points = [dof.point for dof in batch.evaluator.request.outputs]
        same = np.array([[here == there for there in points] for here in points], float)
        power = np.einsum("ij,fjt->fit", same, size**2)
        moving = (batch.evaluator.request.factor != 0)[:, None, None] & (size > 0)
        allowed = batch.variance + max(stage.model_error_floor, FORCE_ERROR_FLOOR) ** 2 * power
        self._root = np.where(moving, 1 / np.sqrt(allowed), 0.0)
        self._heard = moving
        self._drawn = np.log(parametrisation.fixed)
        self._x = np.full(parametrisation.size, np.nan)
        self.residuals = self.jacobians = 0

    def _at(self, x: np.ndarray) -> None:
        """Linearise, unless the last question was here too."""
        x = x.ravel() - self._drawn
        if not np.array_equal(x, self._x):
            self._x = x
            self._lines = self._batch.evaluator.at(self._freedom.theta(x))
            self._values = self._batch.select_inputs(self._lines.values)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Weighted r at log theta; (2 n_value, 1)."""
        self.residuals += 1
        self._at(x)
        measured = self._batch.values
        if self._stage.logarithmic:
            ratio = np.where(self._heard, self._values, 1) / np.where(self._heard, measured, 1)
            off = np.abs(measured) * np.log(ratio)
        else:
            off = self._values - measured
        return (self._root * off).reshape(-1).view(float)[:, None]

    def jacobian(self, x: np.ndarray, _: np.ndarray) -> np.ndarray:
        """Its derivatives; (2 n_value, n_x)."""
        self.jacobians += 1
        self._at(x)
        scale = self._root
        if self._stage.logarithmic:
            scale = scale * np.abs(self._batch.values) / np.where(self._heard, self._values, 1)
        columns = self._lines.sensitivities().columns()
        columns *= scale[..., None]
        columns *= self._freedom.rates(self._x)
        flat = np.ascontiguousarray(columns.reshape(-1, columns.shape[-1]))
        jacobian = np.empty((len(flat), 2, flat.shape[1]))
        jacobian[:, 0], jacobian[:, 1] = flat.real, flat.imag
        return jacobian.reshape(-1, flat.shape[1])
