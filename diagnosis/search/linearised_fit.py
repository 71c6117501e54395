"""Linearised fit: gain and step of released coordinates, with all others projected out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from diagnosis.hypothesis import Hypothesis
from diagnosis.settings import HALF_PRECISION, NEGLIGIBLE_SHARE
from identification.words import Integers, Mask, Real
from tuning import Parametrisation
from tuning.misfit.probing import ProbedEquations

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

    @cached_property
    def _place(self) -> Integers:
        """Place of each coordinate among the free ones; -1 at a bound."""
        place = np.full(len(self.x), -1)
        place[self._free] = np.arange(len(self._free))
        return place

    @cached_property
    def _factor(self) -> "Factor":
        """Factor L of A of all free coordinates."""
        free = self._free
        precision = np.diag(self.varies.precision[free])
        return Factor.factorise(self._normal[np.ix_(free, free)] + precision)

    @cached_property
    def _halved_probes(self) -> Real:
        """L^-1 times the coupling of the free coordinates to all probes; (n_free, n_probe)."""
        return self._factor.solve_half(self.probed.cross[self._free])

    @cached_property
    def _halved_gradient(self) -> Real:
        """L^-1 times the gradient; (n_free, 1)."""
        return self._factor.solve_half(self.probed.gradient[self._free, None])

    @cached_property
    def _halved_units(self) -> Real:
        """L^-1 times the unit vectors of the free coordinates; (n_free, n_free)."""
        return self._factor.solve_half(np.eye(len(self._free)))

    def score(self, hypothesis: Hypothesis, chosen: Integers) -> Gained:
        """Return the predicted gain of a hypothesis; its ``chosen`` coordinates, probes last."""
        count, probed, normal = len(self.x), self.probed, self._normal
        old, new = chosen[chosen < count], chosen[chosen >= count] - count
        # The gradient of the cost contains that of the priors, which a released coordinate loses.
        pulled = (self.varies.precision * self.x)[old]
        slope = np.concatenate([probed.gradient[old] - pulled, probed.slope[new]])
        square = np.zeros((len(chosen), len(chosen)))
        square[: len(old), : len(old)] = normal[old[:, None], old]
        square[len(old) :, len(old) :] = probed.blocks[new[:, None], new]
        square[: len(old), len(old) :] = probed.cross[old[:, None], new]
        square[len(old) :, : len(old)] = square[: len(old), len(old) :].T
        halved = self._halved_probes[:, new]
        if len(old):
            of_old = self._factor.solve_half(normal[self._free[:, None], old])
            halved = np.hstack([of_old, halved])
        both = np.hstack([halved, self._halved_gradient])
        projected = halved.T @ both
        released = self._place[old]
        released = released[released >= 0]
        if len(released):
            projected -= self._couple_to_released(released, halved, both)
        schur, right = square - projected[:, :-1], slope - projected[:, -1]
        unit = 1 / np.sqrt(np.maximum(np.diag(square), np.finfo(float).tiny))
        gain, step = maximise_gain(
            schur * np.outer(unit, unit), right * unit, find_signed(hypothesis)
        )
        return gain, step * unit

    def _couple_to_released(self, released: Integers, left: Real, right: Real) -> Real:
        """Return what the released coordinates themselves take part in ``left' right``.

        With A^-1 = L^-T L^-1 over the free coordinates, of which o are released and t stay,

            b_t' A_tt^-1 c_t = b' A^-1 c - (A^-1 b)_o' [(A^-1)_oo]^-1 (A^-1 c)_o.

        Args:
            released: places among the free coordinates; (n_o,).
            left: L^-1 b; (n_free, n_b).
            right: L^-1 c; (n_free, n_c).
        """
        units = self._halved_units[:, released]
        taken: Real = (left.T @ units) @ np.linalg.solve(units.T @ units, units.T @ right)
        return taken


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

    def solve_half(self, right: Real) -> Real:
        """Return L^-1 S b: the products of two such halves are b' A^-1 c."""
        halved: Real = scipy.linalg.solve_triangular(
            self.lower, right * self.scale[:, None], lower=True, check_finite=False
        )
        return halved

    def solve(self, right: Real) -> Real:
        """Return the solution ``x`` of ``A x = right``."""
        solved: Real = scipy.linalg.solve_triangular(
            self.lower, self.solve_half(right), lower=True, trans=1, check_finite=False
        )
        return solved * self.scale[:, None]


def find_signed(hypothesis: Hypothesis) -> Mask:
    """Return which coordinates cannot be negative; (n_coordinate,)."""
    starts_at_bound = {name for name, (low, _) in hypothesis.bounds.items() if low == 0.0}
    return np.array(
        [hypothesis.signed or name in starts_at_bound for name in hypothesis.coordinates], bool
    )


def maximise_gain(square: Real, slope: Real, signed: Mask) -> tuple[float, Real]:
    """Return gain and step of the quadratic model; signed steps cannot be negative."""
    chosen = np.arange(len(slope))
    step = np.zeros(len(slope))
    while len(chosen):
        values, vectors = np.linalg.eigh(square[np.ix_(chosen, chosen)])
        determined = values > NEGLIGIBLE_SHARE
        along = vectors[:, determined].T @ slope[chosen]
        best = -(vectors[:, determined] @ (along / values[determined]))
        limited = np.where(signed[chosen], best, 0.0)
        if (limited >= 0).all():
            step[chosen] = best
            return 0.5 * float((along**2 / values[determined]).sum()), step
        chosen = np.delete(chosen, np.argmin(limited))
    return 0.0, step
