"""Which hypothesis: the promising ones judged on blocks of lines that no fit has seen."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import softmax

from identification.solid.rigid_fit import Fitted, Moments, fit
from identification.solid.screening import Look, promising, shapes_of
from identification.solid.sensor_faults import Hypothesis, Key, State, lowest
from identification.solid.shared_shape import Shape, folds
from identification.words import Real, Tolerance

_STEPS = 8
_EVALUATIONS = 50
_REACH = ((-1.0, 1.0), (-2.5, 2.0))  # logarithms, about the best of a coarse scan
_INEXACT = 1e-3  # nats a value that decide as little as one: no body is so rigid, no noise so known
_LAW = 2e-3  # of what faults have explained, likewise: no law of a fault is so exact
_EVERY = 250  # lines of an evaluation while parameters of a reading are refined


@dataclass(frozen=True, eq=False)
class Judged:
    """A hypothesis with its best state and what it costs.

    Args:
        hypothesis: None for a body without (a further) fault.
        state: the body if it is true.
        fitted: errors at their best, all lines.
        cost: nats beside the data's.
        data: the data's part, held out, beyond noise.
        parameters: of its reading, if it has one.
    """

    hypothesis: Hypothesis | None
    state: State
    fitted: Fitted
    cost: float
    data: float
    parameters: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Ranking:
    """All that was judged, the most probable first.

    Args:
        judged: with the body without a further fault among them.
        nats: what each costs in all, the least zero.
        probability: of each.
        look: at the body before.
    """

    judged: tuple[Judged, ...]
    nats: Real
    probability: Real
    look: Look

    @property
    def none(self) -> int:
        """Where the body without a further fault stands."""
        return next(k for k, one in enumerate(self.judged) if one.hypothesis is None)


def rank(
    state: State, tolerance: Tolerance, done: frozenset[Key], before: float | None = None
) -> Ranking:
    """Judge a believed body against everything that may be wrong with it beside ``done``.

    Args:
        state: what is believed.
        tolerance: of the drawings.
        done: what has been taken out.
        before: the data's part before that; None if nothing has.
    """
    look = Look.at(state, tolerance)
    judged = [_judge(None, state, look)]
    for found in promising(look, done):
        one = found.hypothesis
        if one.grid:
            parameters = _refined(one, found.parameters, look)
            new = _judge(one, one.read(state, parameters), look)
            judged.append(replace(new, parameters=parameters))
        elif one.shaped:
            judged.append(_judge_shape(one, look))
        else:
            judged.append(_judge(one, found.state, look))
    judged[0] = _begun_elsewhere(judged, state, look)
    miss = min(one.data for one in judged) / look.scale / look.values
    temper = look.scale * (1.0 + max(0.0, miss)) + _INEXACT * look.values
    if before is not None:
        temper += _LAW * max(before - next(one.data for one in judged if one.hypothesis is None), 0)
    nats = np.array([one.data / temper + one.cost for one in judged])
    order = np.argsort(nats, kind="stable")
    nats = nats[order] - nats.min()
    return Ranking(tuple(judged[k] for k in order), nats, softmax(-nats), look)


def _refined(one: Hypothesis, start: tuple[float, ...], look: Look) -> tuple[float, ...]:
    """Parameters of a reading at their best, errors fitted with them (Nelder and Mead)."""
    signs, sizes = np.sign(start), np.abs(start)
    every = max(1, len(look.state.data.freq_hz) // _EVERY)

    def cost(logarithms: Real) -> float:
        tried = one.read(look.state, tuple(signs * sizes * np.exp(logarithms)))
        total = Moments.of(tried.data, tried.reading, blocks=1, every=every)
        fitted = fit(tried.model, total, start=look.state.start, steps=3)
        return every * fitted.data / look.scale + fitted.prior

    simplex = np.vstack([np.zeros(len(start)), 0.1 * np.eye(len(start))])
    options = {"maxfev": _EVALUATIONS, "initial_simplex": simplex, "fatol": 0.1, "xatol": 1e-3}
    bounds = [
        (max(low, np.log(least / size)), high)
        for (low, high), size, least in zip(
            _REACH, sizes, lowest(one, look.state.data.freq_hz), strict=False
        )
    ]
    first = np.zeros(len(start))
    best = minimize(cost, first, method="Nelder-Mead", options=options, bounds=bounds).x
    return tuple(float(x) for x in signs * sizes * np.exp(best))


def _judge(one: Hypothesis | None, state: State, look: Look) -> Judged:
    """Held-out cost: fitted on every other block, judged on the rest, and the reverse."""
    moments = Moments.of(state.data, state.reading)
    data = 0.0
    fitted = fit(state.model, moments.over(slice(None)), start=state.start)
    for train in folds(moments.gram.shape[1]):
        part = fit(state.model, moments.over(train), start=fitted.errors)
        data += state.model.data(moments.over(~train), part.errors)
    cost = fitted.prior + state.penalty(fitted.errors, look.tolerance)
    cost += 0.0 if one is None else one.cost
    return Judged(one, replace(state, start=fitted.errors), fitted, cost, data)


def _begun_elsewhere(judged: list[Judged], state: State, look: Look) -> Judged:
    """The body without a further fault, from where the best with one ended, if that ends better.

    Few spare channels leave a fit several ends: one that a fault's release got past may leave a
    tolerance of two standard deviations where the healthy body seemed to have ones of ten.
    """
    healthy, *others = judged
    known = [one for one in others if one.hypothesis is not None and not one.hypothesis.shaped]
    if not known:
        return healthy

    def nats(one: Judged) -> float:
        return one.data / look.scale + one.cost

    best = min(known, key=nats)
    if nats(best) >= nats(healthy):
        return healthy
    again = _judge(None, replace(state, start=best.fitted.errors), look)
    return min(healthy, again, key=nats)


def _judge_shape(one: Hypothesis, look: Look) -> Judged:
    """The same with a shape found where the errors are, its amplitude free in each block."""
    state, moments = look.state, look.moments
    start = look.healthy.errors if look.quiet else state.start

    def shapes(own: Moments) -> list[Shape]:
        return shapes_of(one, state, own, start, _STEPS)

    halves = [
        [look.shape_data(moments.of_blocks(~train), shape) for shape in shapes(part)]
        for train in folds(moments.gram.shape[1])
        for part in [moments.of_blocks(train)]
    ]
    judged = []
    for found, *data in zip(shapes(moments), *halves, strict=True):
        errors = found.fitted.errors
        cost = found.fitted.prior + state.penalty(errors, look.tolerance) + one.cost + found.price
        new = replace(state, extra=np.column_stack([state.extra, found.shape]), start=errors)
        judged.append(Judged(one, new, found.fitted, cost, sum(data)))
    return min(judged, key=lambda each: each.data + each.cost)
