"""Screening: approximate cost of every hypothesis on all lines, to select those to be ranked."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.solid.linearised_scan import LinearisedFit, LineSums, subtract_noise
from identification.solid.moments import Moments
from identification.solid.mount_resonance import estimate_mount
from identification.solid.rigid_fit import FittedErrors, fit_errors
from identification.solid.sensor_faults import (
    READING_RESPONSES,
    BelievedBody,
    FaultHypothesis,
    Key,
    list_hypotheses,
    min_parameters,
)
from identification.solid.shared_shape import (
    FreeShape,
    FreeShapes,
    amplitude_gain,
    estimate_noise_scale,
)
from identification.solid.slope_products import project
from identification.words import Real, Tolerance

# Variance of the noise over the stated one, at most. Variances that other software states from few
# hits are off by tens of per cent; a larger misfit everywhere in the band is not noise.
MAX_NOISE_SCALE = 1.5
# Prior and misfit [nats] up to which one step from the healthy fit is accurate enough.
_MAX_QUIET_NATS = 60.0
_SCREENING_STEPS = 4  # Gauss-Newton steps of a screening fit
# Singular value over the largest below which no motion shows a component of a sensor's place.
_PLACE_RANK_TOLERANCE = 1e-6
_MAX_CLOSE_FAULTS = 10  # hypotheses close to the best that are ranked
_MAX_SCANNED_FAULTS = 2  # hypotheses with scanned parameters that are ranked besides
_COARSE_GRID_STEP = 3  # step through the grid of a scan when the body is nearly healthy
_MAX_GAP_NATS = 15.0  # difference to the best hypothesis up to which one is ranked [nats]
_SCREENING_ERROR = 0.01  # error of the screening, relative to what the best hypothesis explains
# Difference to the believed body from which a hypothesis is discarded [nats].
_MAX_EXCESS_NATS = 1.0


@dataclass(frozen=True, eq=False)
class BodyFit:
    """A believed body with its fit and its noise.

    Args:
        state: the believed body.
        tolerance: tolerances of the sensors.
        moments: sums of its data, by block.
        healthy: fit without a further fault.
        noise_scale: variance of the noise over the stated one.
        linear: the fit, linearised.
        is_quiet: whether one step from the fit gives the effect of a hypothesis accurately enough.
    """

    state: BelievedBody
    tolerance: Tolerance
    moments: Moments
    healthy: FittedErrors
    noise_scale: float
    linear: LinearisedFit
    is_quiet: bool

    @classmethod
    def at(cls, state: BelievedBody, tolerance: Tolerance) -> "BodyFit":
        """Fit a believed body."""
        moments = Moments.of(state.data, state.reading)
        healthy = fit_errors(state.model, moments.sum_blocks(slice(None)), start=state.start)
        scale = estimate_noise_scale(state.model, moments, healthy.errors, MAX_NOISE_SCALE)
        misfit = healthy.data / scale - 5 * np.sqrt(moments.noise.sum())
        linear = LinearisedFit.of(state.model, moments, healthy.errors)
        is_quiet = bool(misfit < _MAX_QUIET_NATS and healthy.prior < _MAX_QUIET_NATS)
        return cls(state, tolerance, moments, healthy, scale, linear, is_quiet)

    @cached_property
    def clean(self) -> Real:
        """Return G - V of each group, and W1 and W2; (n_sum, n_group, n_channel, n_channel)."""
        delays = self.state.model.sensors.delays(self.healthy.errors)
        return subtract_noise(self.moments, delays)

    def moments_of(self, state: BelievedBody) -> Moments:
        """Return the sums of a state's data, by block."""
        if state.data is self.state.data and state.reading is self.state.reading:
            return self.moments
        return Moments.of(state.data, state.reading)

    def exchanged_moments(self, hypothesis: FaultHypothesis, state: BelievedBody) -> Moments:
        """Return the sums of a hypothesis, whose state has exchanged channels at most."""
        order, signs = hypothesis.channel_order(len(self.state.data.scale))
        if np.array_equal(state.reading, state.reading[:, order]):
            return self.moments.exchange_channels(order, signs)
        return Moments.of(state.data, state.reading)

    @property
    def base_nats(self) -> float:
        """Cost of the believed body without a further fault [nats]."""
        penalty = self.state.penalty(self.healthy.errors, self.tolerance)
        return self.healthy.data / self.noise_scale + self.healthy.prior + penalty

    @property
    def noise_energy(self) -> float:
        """Noise in the data in its own units: the number of values, less where the floor counts."""
        return max(float(self.moments.noise.sum()), 1.0)

    def shape_data(self, moments: Moments, shape: FreeShape) -> float:
        """Return the data's cost with a free amplitude along a shape in each block."""
        model, errors = self.state.model, shape.fitted.errors
        gain, _ = amplitude_gain(model, moments, errors, shape.shape, self.noise_scale)
        return model.data(moments, errors) - self.noise_scale * gain


@dataclass(frozen=True, eq=False)
class ScreenedFault:
    """Result of the screening of one hypothesis.

    Args:
        nats: approximate cost of data, prior and hypothesis [nats].
        state: its best state.
        parameters: parameters of its reading, if it has one.
    """

    nats: float
    hypothesis: FaultHypothesis
    state: BelievedBody
    parameters: tuple[float, ...] = ()


def screen_faults(body_fit: BodyFit, excluded: frozenset[Key]) -> list[ScreenedFault]:
    """Select the hypotheses that may explain the data better than no further fault.

    These are the hypotheses close to the best, and the best few scans. Scans are coarse, so they
    stay with larger costs, unless another hypothesis explains the data.

    Args:
        body_fit: fit of the believed body.
        excluded: hypotheses that are not considered.
    """
    screened = [
        fault
        for fault in screen_all(body_fit)
        if fault.hypothesis.key not in excluded
        and fault.nats < body_fit.base_nats + _MAX_EXCESS_NATS
    ]
    ranked = sorted(screened, key=lambda fault: fault.nats)
    margin = (
        _MAX_GAP_NATS + _SCREENING_ERROR * (body_fit.base_nats - ranked[0].nats) if ranked else 0.0
    )
    close = [fault for fault in ranked[:_MAX_CLOSE_FAULTS] if fault.nats < ranked[0].nats + margin]
    if not ranked or ranked[0].nats < _MAX_QUIET_NATS + 5 * np.sqrt(body_fit.noise_energy):
        return close
    scans = [fault for fault in ranked if fault.hypothesis.grid and fault not in close]
    return close + _estimate_mounts(screened, body_fit, excluded) + scans[:_MAX_SCANNED_FAULTS]


def _estimate_mounts(
    screened: list[ScreenedFault], body_fit: BodyFit, excluded: frozenset[Key]
) -> list[ScreenedFault]:
    """Estimate resonant mounts of the channels that explain most if their readings are free."""
    unknown = sorted(
        (fault for fault in screened if fault.hypothesis.effect == "sensor_unknown"),
        key=lambda fault: fault.nats,
    )
    mounts = {
        hypothesis.key: hypothesis
        for hypothesis in list_hypotheses(body_fit.state)
        if hypothesis.effect == "mount_resonance"
    }
    estimated = []
    shapes = FreeShapes(body_fit.state, body_fit.moments, body_fit.state.start, _SCREENING_STEPS)
    for fault in unknown[:_MAX_SCANNED_FAULTS]:
        key = ("mount_resonance", fault.hypothesis.location, fault.hypothesis.dof)
        (left_out,) = shapes.fit(fault.hypothesis)
        parameters = estimate_mount(body_fit.state, left_out, fault.hypothesis.channels[0])
        smallest = min_parameters(mounts[key], body_fit.state.data.freq_hz)
        if parameters is not None and parameters[0] > smallest[0] and key not in excluded:
            estimated.append(ScreenedFault(fault.nats, mounts[key], body_fit.state, parameters))
    return estimated


def screen_all(body_fit: BodyFit) -> list[ScreenedFault]:
    """Compute the approximate cost of each hypothesis on all lines, after few steps."""
    every_hypothesis = list(list_hypotheses(body_fit.state))
    screened = _screen_scans(
        [hypothesis for hypothesis in every_hypothesis if hypothesis.grid], body_fit
    )
    # A gross fault has driven the errors of the healthy fit far off, so that the fit starts anew.
    start, steps = (
        (body_fit.healthy.errors, 2)
        if body_fit.is_quiet
        else (body_fit.state.start, _SCREENING_STEPS)
    )
    shapes = FreeShapes(body_fit.state, body_fit.moments, start, steps)
    for hypothesis in every_hypothesis:
        if hypothesis.frees_shape:
            screened.append(_screen_shape(hypothesis, body_fit, shapes))
        elif not hypothesis.grid:
            screened += _screen_one(hypothesis, body_fit)
    return screened


def _screen_scans(scanned: list[FaultHypothesis], body_fit: BodyFit) -> list[ScreenedFault]:
    """Screen readings that vary along lines: one step from the healthy fit for each grid value.

    A gross fault drives the errors of that fit far off. Then the step is taken from its start.
    """
    state = body_fit.state
    freq, spread = state.data.freq_hz, state.spread
    linear = body_fit.linear
    if not body_fit.is_quiet:
        linear = LinearisedFit.of(state.model, body_fit.moments, state.start)
    delayed = state.data.sensors.delay_factor(linear.errors, freq)
    spectra = LineSums.of(state.data, state.reading * delayed)
    screened = []
    for effect, full_grid in dict.fromkeys(
        (hypothesis.effect, hypothesis.grid) for hypothesis in scanned
    ):
        grid = full_grid[:: _COARSE_GRID_STEP if body_fit.is_quiet else 1]
        corrected = spectra.divide(np.array([READING_RESPONSES[effect](freq, *at) for at in grid]))
        null_cost = float(linear.costs(corrected.clean([]), spread, body_fit.noise_scale)[0])
        base_nats = body_fit.base_nats if body_fit.is_quiet else null_cost
        for hypothesis in scanned:
            if (hypothesis.effect, hypothesis.grid) == (effect, full_grid):
                clean = corrected.clean(list(hypothesis.channels))
                costs = linear.costs(clean, spread, body_fit.noise_scale)
                best = int(np.argmin(costs))
                nats = base_nats + float(costs[best]) - null_cost + hypothesis.cost
                screened.append(ScreenedFault(nats, hypothesis, state, grid[best]))
    return screened


def _screen_one(hypothesis: FaultHypothesis, body_fit: BodyFit) -> list[ScreenedFault]:
    """Screen a released error or exchanged channels: one step if the body is quiet, else a fit.

    Returns:
        The hypothesis with its cost; empty for an exchange that costs more than the believed body.
    """
    if body_fit.is_quiet:
        order, signs = hypothesis.channel_order(len(body_fit.state.data.scale))
        clean = body_fit.clean[:, :, order][:, :, :, order] * np.outer(signs, signs)
        # An exchange does not change the priors, so that the state is only built if it is needed.
        trial = body_fit.state if hypothesis.pairs else hypothesis.states(body_fit.state)[0]
        (cost,) = body_fit.linear.costs(clean[:, :, None], trial.spread, body_fit.noise_scale)
        nats = (
            float(cost)
            + trial.penalty(body_fit.healthy.errors, body_fit.tolerance)
            + hypothesis.cost
        )
        if hypothesis.pairs:
            if nats >= body_fit.base_nats + _MAX_EXCESS_NATS:
                return []
            trial = hypothesis.states(body_fit.state)[0]
        return [ScreenedFault(nats, hypothesis, replace(trial, start=body_fit.healthy.errors))]
    states = hypothesis.states(body_fit.state)
    total = body_fit.exchanged_moments(hypothesis, states[0]).sum_blocks(slice(None))
    if hypothesis.effect == "sensor_position":
        states += [replace(states[0], start=_solve_displacement(hypothesis, states[0], total))]
    elif len(states) > 2:
        starts = [trial.model.data(total, trial.start) for trial in states]
        states = [states[k] for k in np.argsort(starts)[:2]] + states[:1]
    screened = []
    for trial in states:
        fitted = fit_errors(trial.model, total, start=trial.start, steps=_SCREENING_STEPS)
        prior = fitted.prior + trial.penalty(fitted.errors, body_fit.tolerance)
        started = replace(trial, start=fitted.errors)
        screened.append(
            ScreenedFault(
                fitted.data / body_fit.noise_scale + prior + hypothesis.cost, hypothesis, started
            )
        )
    return [min(screened, key=lambda x: x.nats)]


def _solve_displacement(hypothesis: FaultHypothesis, state: BelievedBody, total: Moments) -> Real:
    """Return errors with one sensor at the place that the others determine, by least squares.

    A distant place is many steps away from the nominal one, and other errors would adapt on the
    way. But readings are linear in the place. With the motion x = W z by all other channels, the
    readings of this sensor are rows x + sum_j d_j slope_j x, with offsets ``d_j``.

    Returns:
        Errors; (n_error,).
    """
    model, start = state.model, state.start.copy()
    errors = list(hypothesis.channels)
    start[errors] = 0.0
    rows = model.rows(start) * model.scale[:, None]
    slopes = model.sensors.slopes(start)[errors] * model.scale[:, None]
    is_own = slopes.any(axis=(0, 2))
    square, linear = np.zeros((3, 3)), np.zeros(3)
    total = total.without_delays(model.sensors.delays(start))
    for mask, gram, noise in zip(total.mask, total.gram, total.noise, strict=True):
        clean = gram.sum(axis=0) - np.diag(noise.sum(axis=0))
        inverse_of_others = project(rows, mask & ~is_own).inverse[:6]
        reading = np.eye(len(mask))[is_own] - rows[is_own, :6] @ inverse_of_others
        slope_readings = slopes[:, is_own] @ inverse_of_others
        square += np.einsum("jcp,pq,lcq->jl", slope_readings, clean, slope_readings)
        linear += np.einsum("cp,pq,jcq->j", reading, clean, slope_readings)
    start[errors] = np.linalg.lstsq(square, linear, rcond=_PLACE_RANK_TOLERANCE)[0]
    return start


def _screen_shape(
    hypothesis: FaultHypothesis, body_fit: BodyFit, shapes: FreeShapes
) -> ScreenedFault:
    """Screen a hypothesis with a free shape."""
    nats = [
        body_fit.shape_data(body_fit.moments, shape) / body_fit.noise_scale
        + shape.fitted.prior
        + body_fit.state.penalty(shape.fitted.errors, body_fit.tolerance)
        + shape.price
        for shape in shapes.fit(hypothesis)
    ]
    return ScreenedFault(min(nats) + hypothesis.cost, hypothesis, body_fit.state)
