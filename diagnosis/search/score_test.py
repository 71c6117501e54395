r"""How much each hypothesis would gain, all that is tuned and tolerated projected out.

About a fit, with the normal equations A = N + D of everything that varies (D the priors) and
gradient g of the cost, freeing the coordinates c of a hypothesis lowers the cost by

    gain = 1/2 g_c' S^-1 g_c,   S = N_cc - N_ct A_tt^-1 N_tc,   g_c -> g_c - N_ct A_tt^-1 g_t,

t what else varies and is not held by a bound, c without its prior. Values count with an allowance
of some part of |H|: at the weights of the noise a fit that lacks a strong effect sits many standard
deviations off, and a missing mass seems to explain anything.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import Key
from identification.words import Integers, Real
from mbmodel import Model
from tuning import (
    Fit,
    Misfit,
    Parametrisation,
    parametrise,
    thin_lines,
)
from tuning.misfit.accumulation import ProbedEquations

_RIDGE = 1e-9
_SEEN = 1e-6  # of a coordinate's own curvature: what is left of it beside all that varies

Gained = tuple[float, Real]  # of the cost, in nats; step of the coordinates


@dataclass(frozen=True, eq=False)
class Score:
    """What a hypothesis would gain.

    Args:
        hypothesis: which.
        gain: of the cost, in nats at weights with the allowance.
        step: of its coordinates.
    """

    hypothesis: Hypothesis
    gain: float
    step: Real


def scores(
    scene: Scene,
    found: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> list[Score]:
    """Score hypotheses about a fit at its model-error floor, the most promising first.

    Args:
        scene: campaign and model of the fit.
        found: the fit about which all is linear.
        hypotheses: what may be missing.
        model_error_floor: of that fit.
        stride: every ``stride``-th line counts.
    """
    return ranked(hypotheses, gains(scene, found, hypotheses, model_error_floor, stride))


def ranked(hypotheses: Sequence[Hypothesis], gained: Sequence[Gained]) -> list[Score]:
    """Hypotheses with their gains as scores, the most promising first, of those alike the first."""
    made = [Score(one, gain, step) for one, (gain, step) in zip(hypotheses, gained, strict=True)]
    best: dict[Key, float] = {}
    for row in made:
        best[row.hypothesis.key] = max(row.gain, best.get(row.hypothesis.key, 0.0))

    def counted(row: Score) -> float:
        most = best[row.hypothesis.key]
        return most if row.gain >= (1 - row.hypothesis.alike) * most else row.gain

    return sorted(made, key=lambda row: -counted(row))


def gains(
    scene: Scene,
    found: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> list[Gained]:
    """Return gain and step of each hypothesis; arguments as of ``scores``."""
    # Parts that act in some tests only make every test an evaluation of its own.
    machine = scene.model.machine
    always = [all(Model(machine, one.parts).acting_fractions(None)) for one in hypotheses]
    made: dict[int, Gained] = {}
    for when in (True, False):
        own = [k for k, acts in enumerate(always) if acts is when]
        some = [hypotheses[k] for k in own]
        made |= zip(
            own, _scored(scene, found, some, model_error_floor, stride) if some else (), strict=True
        )
    return [made[k] for k in range(len(hypotheses))]


def _scored(
    scene: Scene,
    found: Fit,
    hypotheses: Sequence[Hypothesis],
    model_error_floor: float,
    stride: int,
) -> Iterator[Gained]:
    """Gains and steps in the order of the hypotheses."""
    model, whole, x = _extended(scene, found, hypotheses)
    count = found.parametrisation.size
    wanted = {name for one in hypotheses for name in one.coordinates}
    asked = np.array([name in wanted for name in whole.names[count:]], bool)
    varies = whole.restrict(np.arange(whole.size) < count, x)
    probes = whole.restrict(np.append(np.zeros(count, bool), asked), x)
    thin = thin_lines(scene.session.campaign, stride * scene.pace)
    probed = Misfit(model, thin, varies, model_error_floor=model_error_floor).probe_coordinates(
        found.x, probes
    )
    fitted = _Fitted(found.parametrisation, found.x, probed)
    place = {name: k for k, name in enumerate((*varies.names, *probes.names))}
    for one in hypotheses:
        yield fitted.score(one, np.array([place[name] for name in one.coordinates], np.intp))


def cosines(
    scene: Scene, found: Fit, leading: Sequence[Score], model_error_floor: float, stride: int
) -> Real:
    """How alike the changes of FRFs are that hypotheses make, all else projected out.

    With d the change by a hypothesis' step at the weights of the allowance and P what takes from
    it all that can be tuned, d_a' P d_b / (|P d_a| |P d_b|): twins have nearly 1.

    Args:
        scene: as of the scores.
        found: the fit about which they were made.
        leading: hypotheses, each with its step.
        model_error_floor: of that fit.
        stride: every ``stride``-th line counts.

    Returns:
        (n_leading, n_leading).
    """
    model, whole, x = _extended(scene, found, [one.hypothesis for one in leading])
    count = found.parametrisation.size
    thin = thin_lines(scene.session.campaign, stride * scene.pace)
    normal = (
        Misfit(model, thin, whole, model_error_floor=model_error_floor)
        .quadratic_model(x)[2]
        .dense()
    )
    place = {name: k for k, name in enumerate(whole.names)}
    steps = np.zeros((whole.size, len(leading)))
    for column, one in enumerate(leading):
        for name, step in zip(one.hypothesis.coordinates, one.step, strict=True):
            steps[place[name], column] = step
    released = np.isin(np.arange(whole.size), np.flatnonzero(steps.any(axis=1)))
    others = np.flatnonzero(
        ~released & ~whole.coordinates_at_bound(x) & (np.arange(whole.size) < count)
    )
    precision = np.diag(whole.has_prior[others].astype(float))
    factor = Factor.of(normal[np.ix_(others, others)] + precision)
    cross = normal[others] @ steps
    inner = steps.T @ normal @ steps - cross.T @ factor.solve(cross)
    size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    found_cosines: Real = inner / np.outer(size, size)
    return found_cosines


def _extended(
    scene: Scene, found: Fit, hypotheses: Sequence[Hypothesis]
) -> tuple[Model, Parametrisation, Real]:
    """Model and coordinates with the Parts of hypotheses, and where the fit is in them."""
    session = scene.session
    parts = dict.fromkeys(part for one in hypotheses for part in one.parts)
    model = Model(session.model.machine, (*session.model.parts, *parts))
    whole = found.parametrisation.extend(parametrise(model, session.campaign.tolerance))
    return model, whole, np.append(found.x, np.zeros(whole.size - found.parametrisation.size))


@dataclass(frozen=True, eq=False)
class _Fitted:
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

    def _factor(self, others: Integers) -> "Factor":
        precision = np.diag(self.varies.has_prior[others].astype(float))
        return Factor.of(self._normal[np.ix_(others, others)] + precision)

    @cached_property
    def _usual(self) -> "Factor":
        return self._factor(self._free)

    def score(self, one: Hypothesis, chosen: Integers) -> Gained:
        """What one hypothesis would gain; chosen are its coordinates, probes behind what varies."""
        count, probed, normal = len(self.x), self.probed, self._normal
        own, new = chosen[chosen < count], chosen[chosen >= count] - count
        others = self._free[~np.isin(self._free, own)]
        factor = self._usual if len(others) == len(self._free) else self._factor(others)
        # The cost's gradient holds the pull of the priors; a released coordinate has none.
        pulled = np.where(self.varies.has_prior, self.x, 0.0)[own]
        slope = np.concatenate([probed.gradient[own] - pulled, probed.slope[new]])
        cross = np.hstack([normal[np.ix_(others, own)], probed.cross[np.ix_(others, new)]])
        square = np.zeros((len(chosen), len(chosen)))
        square[: len(own), : len(own)] = normal[np.ix_(own, own)]
        square[len(own) :, len(own) :] = probed.blocks[np.ix_(new, new)]
        square[: len(own), len(own) :] = probed.cross[np.ix_(own, new)]
        square[len(own) :, : len(own)] = square[: len(own), len(own) :].T
        solved = factor.solve(np.column_stack([cross, probed.gradient[others]]))
        schur = square - cross.T @ solved[:, :-1]
        right = slope - cross.T @ solved[:, -1]
        unit = 1 / np.sqrt(np.maximum(np.diag(square), 1e-300))
        gain, step = _gained(schur * np.outer(unit, unit), right * unit, signed=one.signed)
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
        scaled = matrix * np.outer(scale, scale) + _RIDGE * np.eye(len(matrix))
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


def _gained(square: Real, slope: Real, *, signed: bool) -> tuple[float, Real]:
    """Gain and step of the quadratic model; of sizes none may be negative."""
    chosen = np.arange(len(slope))
    step = np.zeros(len(slope))
    while len(chosen):
        values, vectors = np.linalg.eigh(square[np.ix_(chosen, chosen)])
        seen = values > _SEEN
        along = vectors[:, seen].T @ slope[chosen]
        own = -(vectors[:, seen] @ (along / values[seen]))
        if not signed or (own >= 0).all():
            step[chosen] = own
            return 0.5 * float((along**2 / values[seen]).sum()), step
        chosen = np.delete(chosen, np.argmin(own))
    return 0.0, step
