r"""Gains and starts of hypotheses in dynamic stiffness, against the state before a change.

A change of 10 % moves narrow modes by many bandwidths, so that FRFs are far from linear in it: both
sets of peaks show, and a fit that begins without the change ends in a wrong minimum. In dynamic
stiffness Z = H^-1 most effects are linear. With the measured square matrix Y, the residual

    R = Y H(x)^-1 Y - Y,    dR = -(Y H^-1) dH (H^-1 Y),

is linear in Z, and equals that of the FRFs near the solution, so that their weights hold. Each
hypothesis is fitted by a few steps of Gauss and Newton, with the common drift of all stiffness
beside it. What it gains ranks it, and where it ends a refit begins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import add_hypothesis, find_start
from diagnosis.search.linearised_fit import Gained, find_signed, maximise_gain
from diagnosis.search.score_test import Score, extend_model, rank_scores
from identification.words import Campaign, Complex, Real, UsageError
from tuning import Session, thin_lines
from tuning.misfit.batch import Batch, batch_tests
from tuning.misfit.weights import point_power_of
from tuning.parametrisation.parametrisation import Parametrisation

# Relative floor of the weights: gains of a second visit and what the rest does not hold. Starts
# need no better one; the refits estimate their own.
_START_FLOOR = 0.02
_MAX_STIFFNESS_STEPS = 6  # linear effects take two, resonators some more
_MIN_GAIN = 1e-3  # relative decrease of the cost below which the steps end
# Of the hypotheses that one step ranks, those fitted to the end: two shapes of each effect and
# place, and as many of these as twice the refits of a round.
_SHAPES, _SITES_PER_REFIT = 2, 2
_STIFFNESS_HALVINGS = 3  # of a step that lowers no cost


def has_square_matrix(campaign: Campaign) -> bool:
    """Return whether the tests are one square matrix of FRFs, each reference hit once."""
    count = len(campaign.outputs)
    return (
        len(campaign.inputs) == len(campaign.tests) == count
        and all(test.estimate.measured.all() for test in campaign.tests)
        and all(len(test.estimate.frf.outputs) == count for test in campaign.tests)
    )


def rank_by_stiffness(
    scene: Scene, base: Refit, hypotheses: Sequence[Hypothesis], stride: int
) -> list[Score]:
    """Return the scores of hypotheses by their fits in dynamic stiffness, the largest gain first.

    Each hypothesis begins where its fit ends.

    Args:
        scene: campaign and model of the refit.
        base: refit about which they are proposed; with a rest of the state before.
        hypotheses: hypotheses to score.
        stride: every ``stride``-th line counts.
    """
    thin = stride * scene.stride_factor
    null = _fit(scene.session, base.fit.theta, (), thin)
    ranked = rank_scores(hypotheses, _find_linear_gains(scene, base, hypotheses, thin))
    best: dict[str, list[Score]] = {}
    for score in ranked:
        best.setdefault(score.hypothesis.site, []).append(score)
    leading = [
        score.hypothesis
        for of_site in list(best.values())[: _SITES_PER_REFIT * scene.settings.max_refits]
        for score in of_site[:_SHAPES]
    ]
    ends = [_fit_hypothesis(base, hypothesis, thin, _MAX_STIFFNESS_STEPS) for hypothesis in leading]
    fitted = set(map(id, leading))
    further = [score for score in ranked if id(score.hypothesis) not in fitted]
    return [*_rank(leading, ends, null), *further]


def _find_linear_gains(
    scene: Scene, base: Refit, hypotheses: Sequence[Hypothesis], stride: int
) -> list[Gained]:
    """Return the gain of one step of each hypothesis, of all those that add to Z at once.

    Corrected data, and hypotheses whose slope tells little, need evaluations of their own.
    """
    together = [
        hypothesis
        for hypothesis in hypotheses
        if not hypothesis.correct and not hypothesis.reform and hypothesis.is_slope_informative
    ]
    model, whole, x = extend_model(scene, base.fit, together)
    wanted = {name for hypothesis in together for name in hypothesis.coordinates}
    is_wanted = np.isin(np.array(whole.names), list(wanted))
    session = replace(scene.session, model=model, parametrisation=whole)
    problem = _Problem.build(session, whole.restrict(is_wanted, x), stride)
    cost, residual, jacobian = problem.linearise(x[is_wanted])
    place = {name: k for k, name in enumerate(problem.varies.names)}
    gained: dict[int, Gained] = {}
    for hypothesis in together:
        columns = jacobian[:, [place[name] for name in hypothesis.coordinates]]
        gained[id(hypothesis)] = maximise_gain(
            (columns.conj().T @ columns).real,
            (columns.conj().T @ residual).real,
            find_signed(hypothesis),
        )
    for hypothesis in hypotheses:
        if id(hypothesis) not in gained:
            end = _fit_hypothesis(base, hypothesis, stride, 1)
            step = np.array([end.x.get(name, 0.0) for name in hypothesis.coordinates])
            gained[id(hypothesis)] = max(cost - end.cost, 0.0), step
    return [gained[id(hypothesis)] for hypothesis in hypotheses]


def _rank(hypotheses: Sequence[Hypothesis], ends: Sequence["_End"], null: "_End") -> list[Score]:
    """Return the scores of hypotheses that begin where their fits ended."""
    gained = [
        (
            max(null.cost - end.cost, 0.0),
            np.array([end.x.get(name, 0.0) for name in hypothesis.coordinates]),
        )
        for hypothesis, end in zip(hypotheses, ends, strict=True)
    ]
    begun = {
        id(hypothesis): replace(hypothesis, begin={**hypothesis.begin, **end.begin})
        for hypothesis, end in zip(hypotheses, ends, strict=True)
    }
    return [
        replace(score, hypothesis=begun[id(score.hypothesis)])
        for score in rank_scores(hypotheses, gained)
    ]


def _fit_hypothesis(base: Refit, hypothesis: Hypothesis, stride: int, steps: int) -> "_End":
    """Return the best end of fits with a hypothesis, from its start and its alternative ones."""
    session = add_hypothesis(base.session, hypothesis)
    added = {p.name for part in hypothesis.parts for p in part.parameters}
    names = (*hypothesis.release, *(added - {*hypothesis.follow, *hypothesis.held}))
    ends = []
    for start in ({}, *hypothesis.otherwise):
        begun = replace(hypothesis, begin={**hypothesis.begin, **start})
        ends.append(_fit(session, find_start(base, session, begun), names, stride, steps))
    return min(ends, key=lambda end: end.cost)


@dataclass(frozen=True, eq=False)
class _End:
    """End of a fit.

    Args:
        begin: parameters that varied [SI], by name.
        x: coordinates, by name.
        cost: half the weighted sum of squares, and the priors [nats].
    """

    begin: Mapping[str, float]
    x: Mapping[str, float]
    cost: float


def _fit(
    session: Session,
    start: Real,
    names: Sequence[str],
    stride: int,
    steps: int = _MAX_STIFFNESS_STEPS,
) -> _End:
    """Fit some coordinates and the drift of all stiffness in dynamic stiffness.

    Args:
        session: model with the hypothesis, campaign corrected for it.
        start: parameters at the start [SI]; (n_parameter,).
        names: coordinates that vary.
        stride: every ``stride``-th line counts.
        steps: Gauss-Newton steps at most.
    """
    whole = session.parametrisation
    drifts = {p.name for p in whole.parameters if p.known in ("stiffness", "damping")}
    kept = np.isin(np.array(whole.names), [*names, *drifts])
    x_whole = np.clip(whole.coordinates(start), whole.lower, whole.upper)
    varies, x = whole.restrict(kept, x_whole), x_whole[kept]
    problem = _Problem.build(session, varies, stride)
    cost, gradient, normal = problem.expand(x)
    for _ in range(steps):
        if not len(x):
            break
        trial = problem.step(x, cost, gradient, normal)
        if trial is None:
            break
        x, (new_cost, gradient, normal) = trial
        is_small = cost - new_cost < _MIN_GAIN * max(cost, 1.0)
        cost = new_cost
        if is_small:
            break
    x_whole[kept] = x
    values = map_values(whole, varies.theta(x))
    return _End(
        {name: values[name] for name in names},
        dict(zip(whole.names, x_whole.tolist(), strict=True)),
        cost,
    )


@dataclass(frozen=True, eq=False)
class _Problem:
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
    def build(cls, session: Session, varies: Parametrisation, stride: int) -> "_Problem":
        """Return the problem on every ``stride``-th line."""
        campaign = thin_lines(session.campaign, stride)
        n, n_freq = len(campaign.tests), len(campaign.freq_hz)
        measured, variance = np.zeros((n_freq, n, n), complex), np.zeros((n_freq, n, n))
        batches = batch_tests(session.model, campaign)
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
        direction[free] = -np.linalg.lstsq(matrix, gradient[free] / scale, rcond=1e-10)[0] / scale
        for halving in range(_STIFFNESS_HALVINGS + 1):
            nearer = np.clip(x + direction / 2**halving, lower, upper)
            with np.errstate(over="ignore", invalid="ignore"):  # far steps of unbounded sizes
                expansion = self.expand(nearer)
            if expansion[0] < cost:
                return nearer, expansion
        return None
