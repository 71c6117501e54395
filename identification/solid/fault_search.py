"""Forward selection of faults: the most probable fault is accepted until none is probable.

Size of a fault against the tolerance of its sensor: within it nothing is wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammainccinv

from identification.solid.body_channels import BodyData
from identification.solid.moments import Moments
from identification.solid.ranking import RankedFault, Ranking, rank_faults
from identification.solid.rigid_fit import fit_errors
from identification.solid.sensor_faults import (
    BelievedBody,
    FaultHypothesis,
    Key,
    leave_out_channel,
    list_hypotheses,
    mount_response,
)
from identification.solid.slope_products import project
from identification.words import TOLERANCE_BOUND_SIGMA, Real, Tolerance

# Posterior probability of "no further fault" below which a fault is accepted.
_MAX_NULL_PROBABILITY = 0.05
_MAX_FAULTS = 3  # faults of one body
MIN_REDUNDANT_CHANNELS = 2  # with fewer, a fault cannot be assigned to a channel
# Redundant channels above which single sensors are not searched: a structure with many points is
# checked as a whole, and the modal model shows a fault of one sensor.
_MAX_REDUNDANT = 30
# Relative gain below which a channel that reads no more than noise is dead.
_MAX_DEAD_GAIN = 0.1
# A channel reads more than noise if its power, in the best tenth of the blocks, exceeds the
# quantile of noise at this chance by this factor, which allows for errors of the stated noise.
_FALSE_ALARM_CHANCE, _MIN_SIGNAL_TO_NOISE = 1e-3, 1.2
_READING_EFFECTS = ("mount_resonance", "sensor_delay")  # a sensor has at most one of them


@dataclass(frozen=True, eq=False)
class AcceptedFault:
    """A fault that was accepted.

    Args:
        hypothesis: the fault.
        probability: probability of its effect at its place, whatever the direction.
        parameters: parameters of its reading, if it has one.
        dead: whether it is a dead channel, which is left out from then on.
    """

    hypothesis: FaultHypothesis
    probability: float
    parameters: tuple[float, ...]
    dead: bool = False

    @property
    def frees_shape(self) -> bool:
        """Whether the fault has a free shape."""
        return self.hypothesis.frees_shape or self.dead


@dataclass(frozen=True, eq=False)
class FaultSearch:
    """Result of the forward selection for one body.

    Args:
        data: measured channels.
        rank: how many of the six rigid motions the channels determine.
        redundant: number of channels beyond those.
        rankings: one more than accepted faults; none with fewer than two redundant channels.
        accepted: the faults.
        state: the body with all accepted faults.
        errors: errors of its sensors; (n_error,).
        noise_scale: variance of the noise over the stated one.
        has_unexplained: whether a significant residual remains.
        nats: negative log evidence of the whole explanation.
    """

    data: BodyData
    rank: int
    redundant: int
    rankings: tuple[Ranking, ...]
    accepted: tuple[AcceptedFault, ...]
    state: BelievedBody
    errors: Real
    noise_scale: float
    has_unexplained: bool
    nats: float

    def excess(self, number: int) -> float:
        """Return residual over noise after a number of accepted faults; noise alone gives 1."""
        if not self.rankings:
            return 1.0
        body_fit = self.rankings[number].body_fit
        return float(np.sqrt(max(1.0 + body_fit.healthy.data / body_fit.noise_energy, 0.0)))


def search_faults(
    data: BodyData, tolerance: Tolerance, excluded: frozenset[Key] = frozenset()
) -> FaultSearch:
    """Accept the most probable fault repeatedly, while it is more probable than no fault."""
    state = BelievedBody.healthy(data, tolerance)
    rank, redundant = count_channels(data)
    if redundant < MIN_REDUNDANT_CHANNELS or redundant > _MAX_REDUNDANT:
        fitted = fit_errors(state.model, Moments.of(data, blocks=1))
        nats = fitted.data + fitted.prior
        return FaultSearch(
            data,
            rank,
            redundant,
            (),
            (),
            state,
            fitted.errors,
            1.0,
            has_unexplained=False,
            nats=nats,
        )
    dead: tuple[AcceptedFault, ...] = ()
    while True:
        result = _forward_selection(state, tolerance, (rank, redundant), dead, excluded)
        dead_faults = tuple(fault for fault in result.accepted if fault.dead)
        if result.accepted[: len(dead_faults)] == dead_faults:
            return result
        # Faults accepted before a channel was known to be dead are searched again without it.
        dead = dead_faults


def _forward_selection(
    state: BelievedBody,
    tolerance: Tolerance,
    counts: tuple[int, int],
    dead: Sequence[AcceptedFault],
    excluded: frozenset[Key],
) -> FaultSearch:
    """Select faults one after the other (stepwise forward selection).

    Args:
        state: the healthy body.
        counts: rank, and channels beyond it.
        dead: channels that are known to be dead, accepted first.
    """
    data = state.data
    rank, redundant = counts
    accepted: list[AcceptedFault] = []
    rankings: list[Ranking] = []
    done = set(excluded)
    while True:
        before = rankings[0].candidates[rankings[0].null_index].data if rankings else None
        ranking = rank_faults(state, tolerance, frozenset(done), before)
        rankings.append(ranking)
        best, null = ranking.candidates[0], ranking.candidates[ranking.null_index]
        has_fault = bool(ranking.probability[ranking.null_index] < _MAX_NULL_PROBABILITY)
        has_room = redundant - state.extra.shape[1] > 1 and len(accepted) < _MAX_FAULTS
        if len(accepted) < len(dead):
            fault = dead[len(accepted)]
        elif best.hypothesis is not None and has_fault and has_room:
            probability = _effect_probability(ranking, best.hypothesis)
            fault = AcceptedFault(
                best.hypothesis, probability, best.parameters, _is_dead(best, data)
            )
        else:
            break
        accepted.append(fault)
        done |= _exclude_keys(fault, state)
        state = leave_out_channel(state, fault.hypothesis.channels[0]) if fault.dead else best.state
    scale = ranking.body_fit.noise_scale
    nats = ranking.body_fit.base_nats + sum(fault.hypothesis.cost for fault in accepted)
    return FaultSearch(
        data,
        rank,
        redundant,
        tuple(rankings),
        tuple(accepted),
        state,
        null.fitted.errors,
        scale,
        has_unexplained=has_fault or _is_implausible(null),
        nats=nats,
    )


def _is_implausible(null: RankedFault) -> bool:
    """Return whether the errors of all sensors lie beyond tolerance in the root mean square.

    Such errors explain a body that is not solid at all, and are no explanation.
    """
    return 2 * null.fitted.prior > TOLERANCE_BOUND_SIGMA**2 * len(null.fitted.errors)


def _exclude_keys(fault: AcceptedFault, state: BelievedBody) -> set[Key]:
    """Return the hypotheses that are no longer considered once a fault is accepted."""
    hypothesis = fault.hypothesis
    done = set() if hypothesis.effect == "flexible_body" else {hypothesis.key}
    if fault.dead:
        done |= {
            candidate.key
            for candidate in list_hypotheses(state)
            if _concerns_channel(candidate, hypothesis)
        }
    if hypothesis.effect in _READING_EFFECTS:
        done |= {
            candidate.key
            for candidate in list_hypotheses(state)
            if _has_same_reading(candidate, hypothesis)
        }
    return done


def _is_dead(best: RankedFault, data: BodyData) -> bool:
    """Return whether a channel with nearly no gain reads only noise.

    A channel that reads a tenth of the motion is not dead.
    """
    hypothesis = best.hypothesis
    if hypothesis is None or hypothesis.effect != "sensor_gain":
        return False
    (channel,) = hypothesis.channels
    if abs(1 + float(best.fitted.errors[channel])) >= _MAX_DEAD_GAIN:
        return False
    moments = Moments.of(data)
    power, noise = moments.gram[..., channel, channel], moments.noise[..., channel]
    usable = noise > 0
    count = np.maximum(moments.count[usable], 1.0)
    # The power of n complex values of noise over its mean is distributed as Gamma(n) / n.
    excess = power[usable] / noise[usable] * count / gammainccinv(count, _FALSE_ALARM_CHANCE)
    return not len(excess) or float(np.quantile(excess, 0.9)) < _MIN_SIGNAL_TO_NOISE


def _has_same_reading(hypothesis: FaultHypothesis, accepted: FaultHypothesis) -> bool:
    """Return whether a hypothesis concerns the reading in time of an accepted fault's sensor."""
    return hypothesis.effect in _READING_EFFECTS and hypothesis.location == accepted.location


def _concerns_channel(hypothesis: FaultHypothesis, dead: FaultHypothesis) -> bool:
    """Return whether a hypothesis concerns only a dead channel."""
    return (hypothesis.location, hypothesis.dof) == (dead.location, dead.dof)


def count_channels(data: BodyData) -> tuple[int, int]:
    """Return how many of the six rigid motions the channels determine, and the redundant ones."""
    rows = data.sensors.rows(np.zeros(data.sensors.count)) * data.scale[:, None]
    ranks = [project(rows, mask).rank if mask.any() else 0 for mask in data.measured]
    redundant = max(int(m.sum()) - r for m, r in zip(data.measured, ranks, strict=True))
    return max(ranks), redundant


def _effect_probability(ranking: Ranking, best: FaultHypothesis) -> float:
    """Return the probability of an effect at its place, whatever its direction."""
    return float(
        sum(
            share
            for share, candidate in zip(ranking.probability, ranking.candidates, strict=True)
            if candidate.hypothesis is not None and candidate.hypothesis.key[:2] == best.key[:2]
        )
    )


def is_within_tolerance(
    hypothesis: FaultHypothesis,
    errors: Real,
    parameters: tuple[float, ...],
    freq_hz: Real,
    tolerance: Tolerance,
) -> bool:
    """Return whether a fault is at most 2.5 standard deviations of its tolerance large.

    A mount counts by what it changes in the band, |h - 1|, which the gain's tolerance covers: far
    below its frequency f0 it is a gain of 1 / (1 - (f / f0)^2).

    Args:
        errors: errors of all sensors of the body, as fitted with the fault; (n_error,).
        parameters: parameters of its reading, if it has one.
        freq_hz: lines [Hz]; (n_freq,).
    """
    if hypothesis.effect == "sensor_delay":
        size, deviation = abs(parameters[0]), tolerance.sensor_delay
    elif hypothesis.effect == "mount_resonance":
        reading = mount_response(freq_hz, parameters[0], parameters[1])
        size, deviation = float(np.abs(reading - 1).max()), tolerance.sensor_gain
    else:
        released = {
            "sensor_gain": tolerance.sensor_gain,
            "sensor_misalignment": tolerance.sensor_angle,
            "sensor_position": tolerance.sensor_position,
        }
        if hypothesis.effect not in released:
            return False
        size = float(np.abs(errors[list(hypothesis.channels)]).max())
        deviation = released[hypothesis.effect]
    return size <= TOLERANCE_BOUND_SIGMA * deviation
