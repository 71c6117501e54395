"""One fault after the other: the most probable is taken out while none is improbable."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import gamma

from identification.solid.body_channels import BodyData
from identification.solid.ranking import Judged, Ranking, rank
from identification.solid.rigid_fit import Moments, fit, project
from identification.solid.sensor_faults import (
    Hypothesis,
    Key,
    State,
    hypotheses,
    without_channel,
)
from identification.words import Real, Tolerance

# A fault is named when "no further fault" has become less probable than this.
_DOUBT = 0.05
_MOST_FAULTS = 3
# Structures with more points than a stage has sensors are looked at as a whole: one sensor's fault
# among so many is for the modal model to show.
_MOST_SPARE = 30
_DEAD = 0.1  # of its gain, below which a channel that holds no more than noise is called dead
# Power over that of noise, in the best tenth of the blocks, above which it holds more: beyond
# chance, and beyond how well the noise is known.
_CHANCE, _KNOWN = 1e-3, 1.2
_READINGS = ("mount_resonance", "sensor_delay")  # a sensor has one of them


@dataclass(frozen=True, eq=False)
class Taken:
    """A fault that was taken out.

    Args:
        hypothesis: which.
        probability: of its effect at its place, whatever the direction.
        parameters: of its reading, if it has one.
        dead: whether it is a channel that reads nothing and is left out from then on.
    """

    hypothesis: Hypothesis
    probability: float
    parameters: tuple[float, ...]
    dead: bool = False

    @property
    def shaped(self) -> bool:
        """Whether it freed a shape."""
        return self.hypothesis.shaped or self.dead


@dataclass(frozen=True, eq=False)
class Search:
    """What forward selection gave for one body.

    Args:
        data: as measured.
        rank: how many of the six motions its channels determine.
        spare: channels beyond those.
        rankings: one more than faults taken; none with fewer than two spare channels.
        taken: the faults.
        state: the body as believed in the end.
        errors: of its sensors.
        noise_scale: variance of the noise over the stated one.
        more: whether something significant remains.
        nats: what the whole explanation costs.
    """

    data: BodyData
    rank: int
    spare: int
    rankings: tuple[Ranking, ...]
    taken: tuple[Taken, ...]
    state: State
    errors: Real
    noise_scale: float
    more: bool
    nats: float

    def excess(self, number: int) -> float:
        """Residual over noise with so many faults taken out; 1 is noise alone."""
        if not self.rankings:
            return 1.0
        look = self.rankings[number].look
        return float(np.sqrt(max(1.0 + look.healthy.data / look.values, 0.0)))


def search(data: BodyData, tolerance: Tolerance) -> Search:
    """Take the most probable fault out, again and again, while one is more probable than none."""
    state = State.healthy(data, tolerance)
    known, spare = _counts(data)
    if spare < 2 or spare > _MOST_SPARE:
        fitted = fit(state.model, Moments.of(data, blocks=1))
        nats = fitted.data + fitted.prior
        return Search(data, known, spare, (), (), state, fitted.errors, 1.0, more=False, nats=nats)
    dead: tuple[Taken, ...] = ()
    while True:
        found = _forward(state, tolerance, (known, spare), dead)
        known_dead = tuple(one for one in found.taken if one.dead)
        if found.taken[: len(known_dead)] == known_dead:
            return found
        # What was taken while a channel that reads nothing was believed is asked again without it.
        dead = known_dead


def _forward(
    state: State, tolerance: Tolerance, counts: tuple[int, int], dead: Sequence[Taken]
) -> Search:
    """Forward selection.

    Args:
        state: of the body, healthy.
        tolerance: of its sensors.
        counts: rank, and channels beyond it.
        dead: channels that are known to be, taken first.
    """
    data = state.data
    known, spare = counts
    taken: list[Taken] = []
    rankings: list[Ranking] = []
    done: set[Key] = set()
    while True:
        before = rankings[0].judged[rankings[0].none].data if rankings else None
        ranking = rank(state, tolerance, frozenset(done), before)
        rankings.append(ranking)
        best, none = ranking.judged[0], ranking.judged[ranking.none]
        found = bool(ranking.probability[ranking.none] < _DOUBT)
        room = spare - state.extra.shape[1] > 1 and len(taken) < _MOST_FAULTS
        if len(taken) < len(dead):
            one = dead[len(taken)]
        elif best.hypothesis is not None and found and room:
            share = _present(ranking, best.hypothesis)
            one = Taken(best.hypothesis, share, best.parameters, _is_dead(best, data))
        else:
            break
        taken.append(one)
        done |= _settled(one, state)
        state = without_channel(state, one.hypothesis.channels[0]) if one.dead else best.state
    scale = ranking.look.scale
    nats = ranking.look.base + sum(one.hypothesis.cost for one in taken)
    return Search(
        data,
        known,
        spare,
        tuple(rankings),
        tuple(taken),
        state,
        none.fitted.errors,
        scale,
        more=found,
        nats=nats,
    )


def _settled(taken: Taken, state: State) -> set[Key]:
    """What is asked no more once a fault is taken out of a state."""
    one = taken.hypothesis
    done = set() if one.effect == "flexible_body" else {one.key}
    if taken.dead:
        done |= {other.key for other in hypotheses(state) if _on(other, one)}
    if one.effect in _READINGS:
        done |= {other.key for other in hypotheses(state) if _reads(other, one)}
    return done


def _is_dead(best: Judged, data: BodyData) -> bool:
    """Whether a channel with hardly a gain holds nothing but noise; one that reads a tenth does."""
    one = best.hypothesis
    if one is None or one.effect != "sensor_gain":
        return False
    (channel,) = one.channels
    if abs(1 + float(best.fitted.errors[channel])) >= _DEAD:
        return False
    moments = Moments.of(data)
    seen, noise = moments.gram[..., channel, channel], moments.noise[..., channel]
    some = noise > 0
    count = np.maximum(moments.count[some], 1.0)
    # Of n complex values of noise the power over its mean is distributed as Gamma(n) / n.
    heard = seen[some] / noise[some] * count / gamma.isf(_CHANCE, count)
    return not len(heard) or float(np.quantile(heard, 0.9)) < _KNOWN


def _reads(one: Hypothesis, taken: Hypothesis) -> bool:
    """Whether a hypothesis is of how the same sensor reads in time."""
    return one.effect in _READINGS and one.location == taken.location


def _on(one: Hypothesis, dead: Hypothesis) -> bool:
    """Whether a hypothesis speaks of a dead channel alone."""
    return (one.location, one.dof) == (dead.location, dead.dof)


def _counts(data: BodyData) -> tuple[int, int]:
    """How many of the six motions the channels determine, and how many channels are left."""
    rows = data.sensors.rows(np.zeros(data.sensors.count)) * data.scale[:, None]
    ranks = [project(rows, mask).rank if mask.any() else 0 for mask in data.measured]
    spare = max(int(m.sum()) - r for m, r in zip(data.measured, ranks, strict=True))
    return max(ranks), spare


def _present(ranking: Ranking, best: Hypothesis) -> float:
    """Probability of an effect at its place, whatever its direction."""
    return float(
        sum(
            share
            for share, one in zip(ranking.probability, ranking.judged, strict=True)
            if one.hypothesis is not None and one.hypothesis.key[:2] == best.key[:2]
        )
    )
