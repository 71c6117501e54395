r"""Score tests and refits of every hypothesis about the nominal model of a test, in closed form.

FRFs whose change is linear in all coordinates need no fit. Let N be the normal equations of the
coordinates x of the null model and c of all hypotheses, P the priors of x, and d what an effect
moves. The null model follows the effect by x, and what it leaves grows the cost by d' Q d / 2,

    x = C N_x d,    C = (N_xx + P)^-1,    Q = N - N_x' C N_x    [nats].

A fit with the coordinates h of a hypothesis lowers it by the score test's gain (``score_test``),
with S = Q_hh and the slope -Q_h d. A released tolerance is a coordinate of x whose column occurs
in both. Coordinates that would cross their bounds are held there (``clipped_coordinates``);
outliers by chance are admitted as in any fit (``refitting``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.special import ndtri

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.next_test.clipped_coordinates import clip_to_bounds
from diagnosis.search.linearised_fit import find_signed
from diagnosis.settings import HALF_PRECISION, NEGLIGIBLE_SHARE
from identification.words import Integers, Real, first_by_key, group_by_key
from mbmodel import Model
from tuning import Misfit, Parametrisation, parametrise, thin_lines
from tuning.fitting.machine_fit import are_by_chance, widen_outliers


@dataclass(frozen=True, eq=False)
class PredictedFit:
    """Fit of the change that an effect makes.

    Args:
        gap: what is left of the change, over the noise of all fitted values; their sum [nats].
        prior: cost of the tolerances, stiffness and damping [nats].
        x: coordinates of the null model; (n_x,).
        step: coordinates of the hypothesis; (n_coordinate,).
    """

    gap: float
    prior: float
    x: Real
    step: Real

    @property
    def cost(self) -> float:
        """Cost of the fit [nats]."""
        return self.gap + self.prior


@dataclass(frozen=True, eq=False)
class LinearSearch:
    """Normal equations of a test: coordinates of the null model, then of all hypotheses.

    Args:
        hypotheses: all hypotheses.
        varies: coordinates of the null model; n_x.
        whole: these and the scored coordinates of all hypotheses; n.
        normal: N of the lines that a fit sees, of the noise alone; (n, n).
        fitted_values: number of values that a fit sees.
        gap_doubt: what noise may take from a gap per value, in one test of ten.
    """

    hypotheses: tuple[Hypothesis, ...]
    varies: Parametrisation
    whole: Parametrisation
    normal: Real
    fitted_values: int
    gap_doubt: float

    @classmethod
    def linearise(cls, scene: Scene, hypotheses: Sequence[Hypothesis]) -> "LinearSearch":
        """Return the normal equations about the nominal model.

        Args:
            scene: campaign and nominal model; its FRFs do not count, but their noise.
            hypotheses: hypotheses with Parts or released tolerances.
        """
        session, settings = scene.session, scene.settings
        campaign, varies = session.campaign, session.parametrisation
        parts = dict.fromkeys(part for hypothesis in hypotheses for part in hypothesis.parts)
        model = Model(session.model.machine, (*session.model.parts, *parts))
        whole = varies.extend(parametrise(model, campaign.tolerance))
        scored = {name for hypothesis in hypotheses for name in hypothesis.coordinates}
        is_scored = np.isin(np.array(whole.names), list(scored))
        kept = is_scored | (np.arange(whole.size) < varies.size)
        whole = whole.restrict(kept, np.zeros(whole.size))
        thin = thin_lines(campaign, settings.score_stride * scene.stride_factor)
        misfit = Misfit(model, thin, whole, model_error_floor=0.0, threads=scene.jobs)
        normal = misfit.quadratic_model(np.zeros(whole.size))[2].dense()
        schedule = settings.schedule.thin(len(campaign.freq_hz), scene.stride_factor)
        ratio = len(thin_lines(campaign, schedule.stride).freq_hz) / len(thin.freq_hz)
        values = misfit.values * len(campaign.freq_hz) / len(thin.freq_hz)
        doubt = float(ndtri(settings.predicted_share) / np.sqrt(values))
        seen = round(ratio * misfit.values)
        return cls(tuple(hypotheses), varies, whole, ratio * normal, seen, doubt)

    @cached_property
    def count_sites(self) -> int:
        """Number of effects and places of all hypotheses."""
        return len({hypothesis.site for hypothesis in self.hypotheses})

    @cached_property
    def covariance(self) -> Real:
        """C of the coordinates of the null model; (n_x, n_x)."""
        count = self.varies.size
        matrix = self.normal[:count, :count] + np.diag(self.varies.precision)
        scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
        unit = matrix * np.outer(scale, scale) + HALF_PRECISION * np.eye(count)
        inverse: Real = scipy.linalg.inv(unit, check_finite=False) * np.outer(scale, scale)
        return (inverse + inverse.T) / 2

    @cached_property
    def followed(self) -> Real:
        """W, what the null model follows of each coordinate; (n_x, n)."""
        return self.covariance @ self.normal[: self.varies.size]

    @cached_property
    def projected(self) -> Real:
        """Q [nats]; (n, n)."""
        left: Real = self.normal - self.normal[:, : self.varies.size] @ self.followed
        return (left + left.T) / 2

    @cached_property
    def places(self) -> dict[str, int]:
        """Number of each coordinate by its name."""
        return {name: number for number, name in enumerate(self.whole.names)}

    def find_coordinates(self, hypothesis: Hypothesis) -> Integers:
        """Return the numbers of the scored coordinates of a hypothesis."""
        return np.array([self.places[name] for name in hypothesis.coordinates], np.intp)

    def refit(self, moved: Real, hypothesis: Hypothesis | None = None) -> PredictedFit:
        """Return the fit of an effect by the null model, or with a hypothesis.

        Args:
            moved: d, what the effect moves; (n,).
            hypothesis: the hypothesis that is added; None for the null model.
        """
        count, acting = self.varies.size, np.flatnonzero(moved)
        slope = self.projected[:, acting] @ moved[acting]
        chosen, signed = np.zeros(0, np.intp), np.zeros(0, bool)
        if hypothesis is not None:
            chosen, signed = self.find_coordinates(hypothesis), find_signed(hypothesis)
        square = self.projected[np.ix_(chosen, chosen)]
        unit = 1 / np.sqrt(np.maximum(np.diag(square), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(square * np.outer(unit, unit))
        values = np.maximum(values, 0.0) + HALF_PRECISION
        to_x = np.vstack([self.followed[:, chosen], -np.eye(len(chosen))])
        root = to_x @ (unit[:, None] * vectors / np.sqrt(values))
        along = vectors.T @ (unit * slope[chosen]) / np.sqrt(values)
        followed = self.followed[:, acting] @ moved[acting]
        start = np.append(followed, np.zeros(len(chosen))) - root @ along
        ends = np.where(signed, 0.0, -np.inf), np.full(len(chosen), np.inf)
        inside, risen = self._hold_within_bounds(start, root, ends)
        x, cost = inside[:count], float(moved @ slope - along @ along) / 2 + risen
        prior = float(x @ (self.varies.precision * x)) / 2
        return PredictedFit(max(cost - prior, 0.0), prior, x, inside[count:])

    def rank(
        self, rivals: Sequence[Hypothesis], moved: Real, null: PredictedFit
    ) -> list[Hypothesis]:
        """Return the best hypothesis of each effect and place, the most promising first.

        That is the score test about a fit of the null model, without signs and with all tolerances
        free. No gain of a refit is larger.

        Args:
            rivals: hypotheses that are ranked.
            moved: d, what the effect moves; (n,).
            null: fit of it by the null model.
        """
        rest = moved.copy()
        rest[: len(null.x)] -= null.x
        gains = self.bound_gains(self.normal @ rest)
        ranked = sorted(rivals, key=lambda rival: -gains[rival])
        return list(first_by_key((rival.site, rival) for rival in ranked).values())

    def bound_gains(self, left: Real) -> dict[Hypothesis, float]:
        """Return the score test's gain of each hypothesis without signs [nats].

        Args:
            left: slope of the cost of a fit by all coordinates; (n,).
        """
        bounds: dict[Hypothesis, float] = {}
        for hypotheses, chosen, root in self._roots:
            along = np.einsum("hij,hi->hj", root, left[chosen])
            gains = (along**2).sum(axis=1) / 2
            bounds |= zip(hypotheses, gains.tolist(), strict=True)
        return bounds

    @cached_property
    def _roots(self) -> list[tuple[list[Hypothesis], Integers, Real]]:
        """Hypotheses of equally many coordinates, these, and a root of S^-1 of each."""
        by_count = group_by_key((len(each.coordinates), each) for each in self.hypotheses)
        rows = []
        for hypotheses in by_count.values():
            chosen = np.array([self.find_coordinates(hypothesis) for hypothesis in hypotheses])
            square = self.projected[chosen[:, :, None], chosen[:, None, :]]
            diagonal = np.einsum("hii->hi", square)
            unit = 1 / np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
            values, vectors = np.linalg.eigh(square * unit[:, :, None] * unit[:, None, :])
            kept = np.where(values > NEGLIGIBLE_SHARE, values, np.inf)
            rows.append((hypotheses, chosen, unit[:, :, None] * vectors / np.sqrt(kept)[:, None]))
        return rows

    def _hold_within_bounds(
        self, start: Real, root: Real, ends: tuple[Real, Real]
    ) -> tuple[Real, float]:
        """Return coordinates within their bounds, and what that adds to the cost [nats].

        Args:
            start: coordinates of null model and hypothesis without bounds; (n_x + n_coordinate,).
            root: root of what the hypothesis adds to their covariance; like ``start`` by n.
            ends: bounds of the coordinates of the hypothesis.
        """

        def clip(varies: Parametrisation) -> tuple[Real, float]:
            lower, upper = np.append(varies.lower, ends[0]), np.append(varies.upper, ends[1])
            return clip_to_bounds(start, (self.covariance, root), lower, upper)

        narrow, count = clip(self.varies), self.varies.size
        wide = widen_outliers(self.varies, narrow[0][:count])
        if wide is not None:
            wider = clip(wide)
            if wider[1] < narrow[1] and are_by_chance(self.varies, wide, wider[0][:count]):
                return wider
        return narrow
