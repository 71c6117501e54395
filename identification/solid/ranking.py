"""Ranking of fault hypotheses by their held-out cost, with posterior probabilities.

The promising hypotheses are compared on blocks of lines that their fits have not used (two-fold
cross-validation).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import softmax

from identification.solid.moments import Moments
from identification.solid.rigid_fit import FittedErrors, fit_errors, min_data
from identification.solid.screening import BodyFit, screen_faults
from identification.solid.sensor_faults import BelievedBody, FaultHypothesis, Key, min_parameters
from identification.solid.shared_shape import FreeShapes, folds
from identification.words import Real, Tolerance

_MAX_SHAPE_STEPS = 8  # Gauss-Newton steps of a fit with a free shape
_MAX_EVALUATIONS = 50  # evaluations of the Nelder-Mead refinement
# Bounds of the logarithms of a reading's parameters, relative to the best of a coarse scan.
_PARAMETER_BOUNDS_LOG = ((-1.0, 1.0), (-2.5, 2.0))
# Model error, in nats a value: no body is exactly rigid, and no noise is known exactly.
_MODEL_ERROR_PER_VALUE = 1e-3
# Model error relative to the cost that faults have explained: no law of a fault is exact.
_EXPLAINED_ERROR = 2e-3
# Lines of an evaluation while the parameters of a reading are refined.
_REFINEMENT_LINES = 250


@dataclass(frozen=True, eq=False)
class RankedFault:
    """A hypothesis with its best state and its cost.

    Args:
        hypothesis: None for the body without a (further) fault, the null model.
        state: the body under the hypothesis.
        fitted: errors fitted to all lines.
        cost: cost of priors and penalties [nats].
        data: held-out cost of the data, beyond noise.
        parameters: parameters of its reading, if it has one.
    """

    hypothesis: FaultHypothesis | None
    state: BelievedBody
    fitted: FittedErrors
    cost: float
    data: float
    parameters: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Ranking:
    """All hypotheses that were compared, the most probable first.

    Args:
        candidates: hypotheses, among them the null model.
        nats: total cost of each, relative to the least [nats]; (n_candidate,).
        probability: posterior probability of each; (n_candidate,).
        body_fit: fit of the body without a further fault.
    """

    candidates: tuple[RankedFault, ...]
    nats: Real
    probability: Real
    body_fit: BodyFit

    @property
    def null_index(self) -> int:
        """Position of the body without a further fault."""
        return next(
            k for k, candidate in enumerate(self.candidates) if candidate.hypothesis is None
        )


def rank_faults(
    state: BelievedBody,
    tolerance: Tolerance,
    excluded: frozenset[Key],
    data_before: float | None = None,
) -> Ranking:
    """Rank everything that may be wrong with a believed body, except what is excluded.

    Args:
        excluded: hypotheses that are not considered, such as accepted faults.
        data_before: held-out cost of the data at the nominal body; None for that body itself.
    """
    body_fit = BodyFit.at(state, tolerance)
    candidates = [_held_out_cost(None, state, body_fit)]
    shapes = _HeldOutShapes(body_fit)
    for screened in screen_faults(body_fit, excluded):
        hypothesis = screened.hypothesis
        if hypothesis.grid:
            parameters = _refine_parameters(hypothesis, screened.parameters, body_fit)
            candidate = _held_out_cost(hypothesis, hypothesis.read(state, parameters), body_fit)
            candidates.append(replace(candidate, parameters=parameters))
        elif hypothesis.frees_shape:
            candidates += shapes.candidates(hypothesis)
        else:
            candidates.append(_held_out_cost(hypothesis, screened.state, body_fit))
    candidates[0] = _restart_null(candidates, state, body_fit)
    misfit = (
        min(hypothesis.data for hypothesis in candidates)
        / body_fit.noise_scale
        / body_fit.noise_energy
    )
    temper = (
        body_fit.noise_scale * (1.0 + max(0.0, misfit))
        + _MODEL_ERROR_PER_VALUE * body_fit.noise_energy
    )
    if data_before is not None:
        temper += _EXPLAINED_ERROR * max(
            data_before
            - next(hypothesis.data for hypothesis in candidates if hypothesis.hypothesis is None),
            0,
        )
    candidates = _select_best_shapes(candidates, temper)
    nats = np.array([hypothesis.data / temper + hypothesis.cost for hypothesis in candidates])
    order = np.argsort(nats, kind="stable")
    nats = nats[order] - nats.min()
    return Ranking(tuple(candidates[k] for k in order), nats, softmax(-nats), body_fit)


def _refine_parameters(
    hypothesis: FaultHypothesis, start: tuple[float, ...], body_fit: BodyFit
) -> tuple[float, ...]:
    """Minimise the cost over the parameters of a reading, errors fitted (Nelder and Mead 1965)."""
    signs, sizes = np.sign(start), np.abs(start)
    every = max(1, len(body_fit.state.data.freq_hz) // _REFINEMENT_LINES)

    def cost(logarithms: Real) -> float:
        trial = hypothesis.read(body_fit.state, tuple(signs * sizes * np.exp(logarithms)))
        total = Moments.of(trial.data, trial.reading, blocks=1, every=every)
        fitted = fit_errors(trial.model, total, start=body_fit.state.start, steps=3)
        return every * fitted.data / body_fit.noise_scale + fitted.prior

    simplex = np.vstack([np.zeros(len(start)), 0.1 * np.eye(len(start))])
    options = {"maxfev": _MAX_EVALUATIONS, "initial_simplex": simplex, "fatol": 0.1, "xatol": 1e-3}
    bounds = [
        (max(low, np.log(least / size)), high)
        for (low, high), size, least in zip(
            _PARAMETER_BOUNDS_LOG,
            sizes,
            min_parameters(hypothesis, body_fit.state.data.freq_hz),
            strict=False,
        )
    ]
    first = np.zeros(len(start))
    best = minimize(cost, first, method="Nelder-Mead", options=options, bounds=bounds).x
    return tuple(float(x) for x in signs * sizes * np.exp(best))


def _held_out_cost(
    hypothesis: FaultHypothesis | None, state: BelievedBody, body_fit: BodyFit
) -> RankedFault:
    """Compute the held-out cost by two-fold cross-validation over alternate blocks of lines."""
    moments = body_fit.moments_of(state)
    data = 0.0
    fitted = fit_errors(state.model, moments.sum_blocks(slice(None)), start=state.start)
    for train in folds(moments.gram.shape[1]):
        part = fit_errors(state.model, moments.sum_blocks(train), start=fitted.errors)
        data += state.model.data(moments.sum_blocks(~train), part.errors)
    data = max(data, min_data(moments))
    cost = fitted.prior + state.penalty(fitted.errors, body_fit.tolerance)
    cost += 0.0 if hypothesis is None else hypothesis.cost
    return RankedFault(hypothesis, replace(state, start=fitted.errors), fitted, cost, data)


def _restart_null(
    candidates: list[RankedFault], state: BelievedBody, body_fit: BodyFit
) -> RankedFault:
    """Refit the null model from the errors of the best hypothesis, and keep it if it ends better.

    With few redundant channels a fit has several minima. Releasing a fault can lead past one of
    them, to errors of two standard deviations where the null model ended with errors of ten.
    """
    healthy, *rivals = candidates
    with_fault = [
        candidate
        for candidate in rivals
        if candidate.hypothesis is not None and not candidate.hypothesis.frees_shape
    ]
    if not with_fault:
        return healthy

    def nats(candidate: RankedFault) -> float:
        return candidate.data / body_fit.noise_scale + candidate.cost

    best = min(with_fault, key=nats)
    if nats(best) >= nats(healthy):
        return healthy
    restarted = _held_out_cost(None, replace(state, start=best.fitted.errors), body_fit)
    return min(healthy, restarted, key=nats)


def _select_best_shapes(candidates: list[RankedFault], temper: float) -> list[RankedFault]:
    """Keep the best shape of each hypothesis, at the weight that the data have in the ranking."""
    best: dict[Key | None, RankedFault] = {}
    for candidate in candidates:
        key = None if candidate.hypothesis is None else candidate.hypothesis.key
        rival = best.setdefault(key, candidate)
        if candidate.data / temper + candidate.cost < rival.data / temper + rival.cost:
            best[key] = candidate
    return list(best.values())


class _HeldOutShapes:
    """Held-out costs of free shapes, with a free amplitude in each block."""

    def __init__(self, body_fit: BodyFit) -> None:
        state, moments = body_fit.state, body_fit.moments
        start = body_fit.healthy.errors if body_fit.is_quiet else state.start
        self._body_fit = body_fit
        self._whole = FreeShapes(state, moments, start, _MAX_SHAPE_STEPS)
        self._folds = [
            (
                FreeShapes(state, moments.select_blocks(train), start, _MAX_SHAPE_STEPS),
                moments.select_blocks(~train),
            )
            for train in folds(moments.gram.shape[1])
        ]

    def candidates(self, hypothesis: FaultHypothesis) -> list[RankedFault]:
        """Return each free shape of a hypothesis with its held-out cost."""
        body_fit, state = self._body_fit, self._body_fit.state
        halves = [
            [body_fit.shape_data(held_out, shape) for shape in shapes.fit(hypothesis)]
            for shapes, held_out in self._folds
        ]
        candidates = []
        for fitted_shape, *data in zip(self._whole.fit(hypothesis), *halves, strict=True):
            errors = fitted_shape.fitted.errors
            cost = (
                fitted_shape.fitted.prior
                + state.penalty(errors, body_fit.tolerance)
                + hypothesis.cost
                + fitted_shape.price
            )
            wider = replace(
                state, extra=np.column_stack([state.extra, fitted_shape.shape]), start=errors
            )
            candidates.append(RankedFault(hypothesis, wider, fitted_shape.fitted, cost, sum(data)))
        return candidates
