"""A first look at every hypothesis, on all lines, to see which deserve to be judged."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.solid.linearised_scan import Linearised, Spectra, clean_of
from identification.solid.mount_resonance import mount_of
from identification.solid.rigid_fit import Fitted, Moments, fit, project
from identification.solid.sensor_faults import READINGS, Hypothesis, Key, State, hypotheses, lowest
from identification.solid.shared_shape import (
    Shape,
    amplitude_gain,
    channel_shape,
    common_shape,
    noise_scale,
    shared_channels,
)
from identification.words import Real, Tolerance

# Variances stated from few hits, by other software, are off by tens of per cent at most; a larger
# misfit everywhere in the band is not noise.
HIGHEST_NOISE = 1.5
_QUIET = 60.0  # nats of prior and of misfit up to which one step from the healthy fit is enough
_FIRST_STEPS = 4
_RANK = 1e-6  # of the largest: what no motion shows of a place
_SHAPE_NATS = 2.0  # for each direction that a shape may take
_SHARED_NATS = 0.7  # for the one that several sensors share: half of all plates bend that way
_FEW = 10
_SCANS = 2
_COARSE = 3  # of a scan's parameters, one in three when little can be found
_CLOSE = 15.0  # nats behind the best
_COARSELY = 0.01  # of what the best explains, by which a first look may miss
_HOPELESS = 1.0  # nats behind the believed body: not looked at again


@dataclass(frozen=True, eq=False)
class Look:
    """A believed body, its fit and its noise.

    Args:
        state: what is believed.
        tolerance: of the drawings.
        moments: of its data, by block.
        healthy: its fit.
        scale: variance of the noise over the stated one.
        linear: the fit, linearised.
        quiet: whether one step from the fit tells what a hypothesis would change.
    """

    state: State
    tolerance: Tolerance
    moments: Moments
    healthy: Fitted
    scale: float
    linear: Linearised
    quiet: bool

    @classmethod
    def at(cls, state: State, tolerance: Tolerance) -> "Look":
        """Fit a believed body."""
        moments = Moments.of(state.data, state.reading)
        healthy = fit(state.model, moments.over(slice(None)), start=state.start)
        scale = noise_scale(state.model, moments, healthy.errors, HIGHEST_NOISE)
        misfit = healthy.data / scale - 5 * np.sqrt(moments.noise.sum())
        linear = Linearised.of(state.model, moments, healthy.errors)
        quiet = bool(misfit < _QUIET and healthy.prior < _QUIET)
        return cls(state, tolerance, moments, healthy, scale, linear, quiet)

    @cached_property
    def clean(self) -> Real:
        """G - V of each group; (n_group, n_channel, n_channel)."""
        return clean_of(self.moments)

    @property
    def base(self) -> float:
        """Nats of the believed body as it is."""
        penalty = self.state.penalty(self.healthy.errors, self.tolerance)
        return self.healthy.data / self.scale + self.healthy.prior + penalty

    @property
    def values(self) -> float:
        """Noise in the data, in its own units: their number, less where the floor counts."""
        return max(float(self.moments.noise.sum()), 1.0)

    def shape_data(self, moments: Moments, found: Shape) -> float:
        """The data's part with a free amplitude along a shape in each block."""
        model, errors = self.state.model, found.fitted.errors
        gain, _ = amplitude_gain(model, moments, errors, found.shape, self.scale)
        return model.data(moments, errors) - self.scale * gain


@dataclass(frozen=True, eq=False)
class Found:
    """What a first look gave.

    Args:
        nats: data, prior and what the hypothesis costs.
        hypothesis: which.
        state: its best.
        parameters: of its reading, if it has one.
    """

    nats: float
    hypothesis: Hypothesis
    state: State
    parameters: tuple[float, ...] = ()


def promising(look: Look, done: frozenset[Key]) -> list[Found]:
    """Hypotheses that may be better than none: those close to the best, and the best few scans.

    Scans are coarse, so they stay in with larger costs, unless something else explains the data.
    """
    found = [
        one
        for one in first_looks(look)
        if one.hypothesis.key not in done and one.nats < look.base + _HOPELESS
    ]
    better = sorted(found, key=lambda one: one.nats)
    near = _CLOSE + _COARSELY * (look.base - better[0].nats) if better else 0.0
    close = [one for one in better[:_FEW] if one.nats < better[0].nats + near]
    if not better or better[0].nats < _QUIET + 5 * np.sqrt(look.values):
        return close
    scans = [one for one in better if one.hypothesis.grid and one not in close]
    return close + _mounts(found, look, done) + scans[:_SCANS]


def _mounts(found: list[Found], look: Look, done: frozenset[Key]) -> list[Found]:
    """Resonant mounts of the channels that explain most when they are left to themselves."""
    alone = sorted(
        (one for one in found if one.hypothesis.effect == "sensor_unknown"),
        key=lambda one: one.nats,
    )
    mounts = {one.key: one for one in hypotheses(look.state) if one.effect == "mount_resonance"}
    more = []
    for one in alone[:_SCANS]:
        key = ("mount_resonance", one.hypothesis.location, one.hypothesis.dof)
        (left_out,) = shapes_of(
            one.hypothesis, look.state, look.moments, look.state.start, _FIRST_STEPS
        )
        at = mount_of(look.state, left_out, one.hypothesis.channels[0])
        least = lowest(mounts[key], look.state.data.freq_hz)
        if at is not None and at[0] > least[0] and key not in done:
            more.append(Found(one.nats, mounts[key], look.state, at))
    return more


def first_looks(look: Look) -> list[Found]:
    """Cost of each hypothesis on all lines, after few steps."""
    everything = list(hypotheses(look.state))
    found = _scans([one for one in everything if one.grid], look)
    for one in everything:
        if one.shaped:
            found.append(_look_at_shape(one, look))
        elif not one.grid:
            found += _look_at(one, look)
    return found


def shapes_of(
    one: Hypothesis, state: State, moments: Moments, start: Real, steps: int
) -> list[Shape]:
    """The channel's shape, or common shapes, with errors fitted beside them.

    A channel left to itself is a shape too, and where errors of sensors took the shape's part a fit
    of both from these does not come back: so it begins where the best of the channels ended too. A
    direction that channels of several sensors share need not be found among all spare ones.
    """
    model = state.model
    if one.effect != "flexible_body":
        return [channel_shape(model, moments, one.channels[0], start, steps)]
    mask, channels = moments.mask[0], range(len(state.data.scale))
    alone = [channel_shape(model, moments, channel, start, steps) for channel in channels]
    best = min(alone, key=lambda shape: shape.fitted.data)
    spare = int(mask.sum()) - project(model.rows(start) * model.scale[:, None], mask).rank
    price = _SHAPE_NATS * max(spare - 1, 0)
    found = [
        replace(common_shape(model, moments, errors, steps), price=price)
        for errors in (start, best.fitted.errors)
    ]
    shared = shared_channels(model, mask, start)
    return found + [replace(alone[k], price=_SHARED_NATS) for k in shared]


def _scans(scanned: list[Hypothesis], look: Look) -> list[Found]:
    """Readings that vary along lines: one step from the healthy fit for each of a grid.

    What is grossly wrong has driven that fit's errors away: then from where it began.
    """
    state = look.state
    spectra = Spectra.of(state.data, state.reading)
    freq, spread = state.data.freq_hz, state.spread
    linear = look.linear
    if not look.quiet:
        linear = Linearised.of(state.model, look.moments, state.start)
    found = []
    for effect, whole in dict.fromkeys((one.effect, one.grid) for one in scanned):
        grid = whole[:: _COARSE if look.quiet else 1]
        divided = spectra.divided(np.array([READINGS[effect](freq, *at) for at in grid]))
        without = linear.cost(divided.clean(0, []), spread, look.scale)
        base = look.base if look.quiet else without
        for one in scanned:
            if (one.effect, one.grid) == (effect, whole):
                channels = list(one.channels)
                costs = [
                    linear.cost(divided.clean(k, channels), spread, look.scale)
                    for k in range(len(grid))
                ]
                best = int(np.argmin(costs))
                nats = base + costs[best] - without + one.cost
                found.append(Found(nats, one, state, grid[best]))
    return found


def _look_at(one: Hypothesis, look: Look) -> list[Found]:
    """An error released, channels exchanged: one step if the body is quiet, else a fit.

    Returns:
        What was found; nothing of an exchange that leaves more than the believed body does.
    """
    if look.quiet:
        order, signs = one.exchange(len(look.state.data.scale))
        clean = look.clean[:, order][:, :, order] * np.outer(signs, signs)
        # An exchange leaves the priors as they are: what leaves too much need not be built.
        tried = look.state if one.pairs else one.states(look.state)[0]
        cost = look.linear.cost(clean, tried.spread, look.scale)
        nats = cost + tried.penalty(look.healthy.errors, look.tolerance) + one.cost
        if one.pairs:
            if nats >= look.base + _HOPELESS:
                return []
            tried = one.states(look.state)[0]
        return [Found(nats, one, replace(tried, start=look.healthy.errors))]
    states = one.states(look.state)
    total = Moments.of(states[0].data, states[0].reading, blocks=1)
    if one.effect == "sensor_position":
        states += [replace(states[0], start=_displaced(one, states[0], total))]
    elif len(states) > 2:
        starts = [tried.model.data(total, tried.start) for tried in states]
        states = [states[k] for k in np.argsort(starts)[:2]] + states[:1]
    found = []
    for tried in states:
        fitted = fit(tried.model, total, start=tried.start, steps=_FIRST_STEPS)
        prior = fitted.prior + tried.penalty(fitted.errors, look.tolerance)
        begun = replace(tried, start=fitted.errors)
        found.append(Found(fitted.data / look.scale + prior + one.cost, one, begun))
    return [min(found, key=lambda x: x.nats)]


def _displaced(one: Hypothesis, state: State, total: Moments) -> Real:
    """Errors with one sensor where the others tell that it is, by least squares; (n_error,).

    A far place is many steps away from the drawn one, and other errors follow on the way. But
    readings are linear in it: with the motion x = W z by all other channels, those of this sensor
    are rows x + sum_j d_j slope_j x, with offsets d_j.
    """
    model, start = state.model, state.start.copy()
    errors = list(one.channels)
    start[errors] = 0.0
    rows = model.rows(start) * model.scale[:, None]
    slopes = model.sensors.slopes(start)[errors] * model.scale[:, None]
    own = slopes.any(axis=(0, 2))
    square, linear = np.zeros((3, 3)), np.zeros(3)
    for mask, gram, noise in zip(total.mask, total.gram, total.noise, strict=True):
        clean = gram.sum(axis=0) - np.diag(noise.sum(axis=0))
        others = project(rows, mask & ~own).inverse[:6]
        read = np.eye(len(mask))[own] - rows[own, :6] @ others
        by = slopes[:, own] @ others
        square += np.einsum("jcp,pq,lcq->jl", by, clean, by)
        linear += np.einsum("cp,pq,jcq->j", read, clean, by)
    start[errors] = np.linalg.lstsq(square, linear, rcond=_RANK)[0]
    return start


def _look_at_shape(one: Hypothesis, look: Look) -> Found:
    # What is grossly wrong has driven the healthy fit's errors away: begin anew.
    start, steps = (look.healthy.errors, 2) if look.quiet else (look.state.start, _FIRST_STEPS)
    nats = [
        look.shape_data(look.moments, shape) / look.scale
        + shape.fitted.prior
        + look.state.penalty(shape.fitted.errors, look.tolerance)
        + shape.price
        for shape in shapes_of(one, look.state, look.moments, start, steps)
    ]
    return Found(min(nats) + one.cost, one, look.state)
