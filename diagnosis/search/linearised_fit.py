"""A fit, linearised: gain and step of freed coordinates, all that is tuned projected out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from diagnosis.hypothesis import Hypothesis
from identification.words import Integers, Real
from tuning import Parametrisation
from tuning.misfit.accumulation import ProbedEquations

_RIDGE_SHARE = 1e-9  # of a scaled diagonal, which keeps a factor positive
_MIN_CURVATURE_SHARE = 1e-6  # of a coordinate's own curvature, beside all that varies
Gained = tuple[float, Real]  # gain in cost [nats]; step of the coordinates


@dataclass(frozen=True, eq=False)
class ScoredFit:
    """A fit, linearised.

    Args:
        varies: what does.
        x: where; (n_x,).
        probed: normal equations, and those of what may be missing.
    """

    varies: Parametrisation
    x: Real
    probed: ProbedEquations

    @cached_property
    def _normal(self) -> Real:
        return self.probed.normal.dense()

    @cached_property
    def _free(self) -> Integers:
        """Coordinates that no bound holds."""
        return np.flatnonzero(~self.varies.coordinates_at_bound(self.x))

    def _factor(self, tuned: Integers) -> "Factor":
        precision = np.diag(self.varies.has_prior[tuned].astype(float))
        return Factor.of(self._normal[np.ix_(tuned, tuned)] + precision)

    @cached_property
    def _usual(self) -> "Factor":
        return self._factor(self._free)

    def score(self, hypothesis: Hypothesis, chosen: Integers) -> Gained:
        """Return the predicted gain of a hypothesis; its ``chosen`` coordinates, probes last."""
        count, probed, normal = len(self.x), self.probed, self._normal
        old, new = chosen[chosen < count], chosen[chosen >= count] - count
        tuned = self._free[~np.isin(self._free, old)]
        factor = self._usual if len(tuned) == len(self._free) else self._factor(tuned)
        # The cost's gradient holds the pull of the priors; a released coordinate has none.
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
        unit = 1 / np.sqrt(np.maximum(np.diag(square), 1e-300))
        gain, step = _maximise_gain(
            schur * np.outer(unit, unit), right * unit, signed=hypothesis.signed
        )
        return gain, step * unit


@dataclass(frozen=True, eq=False)
class Factor:
    """A positive definite matrix, scaled and factored."""

    lower: Real
    scale: Real

    @classmethod
    def of(cls, matrix: Real, scale: Real | None = None) -> "Factor":
        """Scaled by its own diagonal if nothing else is given."""
        if scale is None:
            scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
        scaled = matrix * np.outer(scale, scale) + _RIDGE_SHARE * np.eye(len(matrix))
        lower: Real = np.asarray(np.linalg.cholesky(scaled), float)
        return cls(lower, scale)

    def solve(self, right: Real) -> Real:
        """The solution ``x`` of ``A x = right``."""
        halved = scipy.linalg.solve_triangular(
            self.lower, right * self.scale[:, None], lower=True, check_finite=False
        )
        solved: Real = scipy.linalg.solve_triangular(
            self.lower, halved, lower=True, trans=1, check_finite=False
        )
        return solved * self.scale[:, None]


def _maximise_gain(square: Real, slope: Real, *, signed: bool) -> tuple[float, Real]:
    """Gain and step of the quadratic model; of sizes none may be negative."""
    chosen = np.arange(len(slope))
    step = np.zeros(len(slope))
    while len(chosen):
        values, vectors = np.linalg.eigh(square[np.ix_(chosen, chosen)])
        seen = values > _MIN_CURVATURE_SHARE
        along = vectors[:, seen].T @ slope[chosen]
        best = -(vectors[:, seen] @ (along / values[seen]))
        if not signed or (best >= 0).all():
            step[chosen] = best
            return 0.5 * float((along**2 / values[seen]).sum()), step
        chosen = np.delete(chosen, np.argmin(best))
    return 0.0, step
