"""Linearised fit: gain and step of released coordinates, with all others projected out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from diagnosis.hypothesis import Hypothesis
from diagnosis.rounding import HALF_PRECISION, NEGLIGIBLE_SHARE
from identification.words import Integers, Real
from tuning import Parametrisation
from tuning.misfit.accumulation import ProbedEquations

Gained = tuple[float, Real]  # gain in cost [nats]; step of the coordinates


@dataclass(frozen=True, eq=False)
class ScoredFit:
    """Linearised fit.

    Args:
        varies: coordinates of the fit.
        x: their values; (n_x,).
        probed: normal equations of the coordinates, and of the probes of all hypotheses.
    """

    varies: Parametrisation
    x: Real
    probed: ProbedEquations

    @cached_property
    def _normal(self) -> Real:
        return self.probed.normal.dense()

    @cached_property
    def _free(self) -> Integers:
        """Coordinates that are not at a bound."""
        return np.flatnonzero(~self.varies.coordinates_at_bound(self.x))

    def _factor(self, tuned: Integers) -> "Factor":
        precision = np.diag(self.varies.has_prior[tuned].astype(float))
        return Factor.factorise(self._normal[np.ix_(tuned, tuned)] + precision)

    @cached_property
    def _usual(self) -> "Factor":
        return self._factor(self._free)

    def score(self, hypothesis: Hypothesis, chosen: Integers) -> Gained:
        """Return the predicted gain of a hypothesis; its ``chosen`` coordinates, probes last."""
        count, probed, normal = len(self.x), self.probed, self._normal
        old, new = chosen[chosen < count], chosen[chosen >= count] - count
        tuned = self._free[~np.isin(self._free, old)]
        factor = self._usual if len(tuned) == len(self._free) else self._factor(tuned)
        # The gradient of the cost contains that of the priors, which a released coordinate loses.
        pulled = np.where(self.varies.has_prior, self.x, 0.0)[old]
        slope = np.concatenate([probed.gradient[old] - pulled, probed.slope[new]])
        cross = np.hstack([normal[np.ix_(tuned, old)], probed.cross[np.ix_(tuned, new)]])
        square = np.zeros((len(chosen), len(chosen)))
        square[: len(old), : len(old)] = normal[np.ix_(old, old)]
        square[len(old) :, len(old) :] = probed.blocks[np.ix_(new, new)]
        square[: len(old), len(old) :] = probed.cross[np.ix_(old, new)]
        square[len(old) :, : len(old)] = square[: len(old), len(old) :].T
        solved = factor.solve(np.column_stack([cross, probed.gradient[tuned]]))
        schur = square - cross.T @ solved[:, :-1]
        right = slope - cross.T @ solved[:, -1]
        unit = 1 / np.sqrt(np.maximum(np.diag(square), np.finfo(float).tiny))
        gain, step = _maximise_gain(
            schur * np.outer(unit, unit), right * unit, signed=hypothesis.signed
        )
        return gain, step * unit


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky factor of a scaled positive definite matrix.

    Args:
        lower: lower triangle; (n, n).
        scale: factors of rows and columns; (n,).
    """

    lower: Real
    scale: Real

    @classmethod
    def factorise(cls, matrix: Real, scale: Real | None = None) -> "Factor":
        """Return the factor of a matrix, scaled by its diagonal if no scale is given."""
        if scale is None:
            scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
        scaled = matrix * np.outer(scale, scale) + HALF_PRECISION * np.eye(len(matrix))
        lower: Real = np.asarray(np.linalg.cholesky(scaled), float)
        return cls(lower, scale)

    def solve(self, right: Real) -> Real:
        """Return the solution ``x`` of ``A x = right``."""
        halved = scipy.linalg.solve_triangular(
            self.lower, right * self.scale[:, None], lower=True, check_finite=False
        )
        solved: Real = scipy.linalg.solve_triangular(
            self.lower, halved, lower=True, trans=1, check_finite=False
        )
        return solved * self.scale[:, None]


def _maximise_gain(square: Real, slope: Real, *, signed: bool) -> tuple[float, Real]:
    """Return gain and step of the quadratic model; signed steps cannot be negative."""
    chosen = np.arange(len(slope))
    step = np.zeros(len(slope))
    while len(chosen):
        values, vectors = np.linalg.eigh(square[np.ix_(chosen, chosen)])
        determined = values > NEGLIGIBLE_SHARE
        along = vectors[:, determined].T @ slope[chosen]
        best = -(vectors[:, determined] @ (along / values[determined]))
        if not signed or (best >= 0).all():
            step[chosen] = best
            return 0.5 * float((along**2 / values[determined]).sum()), step
        chosen = np.delete(chosen, np.argmin(best))
    return 0.0, step
