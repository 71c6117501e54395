"""From refits to probabilities: none, unexplained, each cause, several.

What is left of the gap decides: the excess chi square - 1 of each refit beside that of the refit
without any effect. A cause that leaves a tenth of it or less explains; what no cause explains is
unexplained. Among causes, costs differ by thousands of nats where the noise alone counted, but a
model is never so exact: their differences are divided by a part of the whole gain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, softmax

from diagnosis.hypothesis import Hypothesis
from diagnosis.refit import Refit
from diagnosis.score import Score

NOTHING = 1.03  # chi square up to which nothing is missing
# Chi square above one that may be the noise's own variance, badly known; third differences along
# frequency tell it worse than coherences do.
_VISIBLE = {"coherence": 0.08, "differences": 0.2}
_EXACT = 0.02  # no refit is believed to leave less
_ROW = 0.01  # probability of a cause that is worth a row
_SURE = 0.98  # probability of what leaves no doubt
_LEFT, _WIDTH = 0.15, 0.4  # of the gap: as likely explained as not; and its logarithm's spread
_TEMPER = 0.03  # of the whole gain: differences below it decide nothing
_LEAST = 10.0  # nats
_SHARE = 0.1  # of the best gain: places that gain less by this have 1/e of its share


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause with its probability.

    Args:
        hypothesis: which.
        probability: that it is present.
        refit: its fit; None of what a gate proved.
    """

    hypothesis: Hypothesis
    probability: float
    refit: Refit | None


@dataclass(frozen=True, eq=False)
class Judged:
    """Probabilities.

    Args:
        none, unexplained, several: of what is no single cause.
        causes: most probable first.
        where: places by their share.
        best: the most probable cause; None if nothing or nothing known is missing.
    """

    none: float
    unexplained: float
    several: float
    causes: tuple[Cause, ...]
    where: tuple[tuple[str, float], ...]
    best: Hypothesis | None

    @property
    def word(self) -> str:
        """The verdict's word."""
        single = max((cause.probability for cause in self.causes), default=0.0) - self.several
        options = {
            "none": self.none,
            "unexplained": self.unexplained,
            "several": self.several,
            "explained": single,
        }
        return max(options, key=lambda name: options[name])


def judge(
    nothing: Refit, refits: Sequence[Refit], proven: Sequence[Hypothesis], scored: Sequence[Score]
) -> Judged:
    """Weigh what is left.

    Args:
        nothing: the refit without any effect.
        refits: with one each.
        proven: what a gate took out before.
        scored: of all hypotheses, for the places.
    """
    places = _places(scored, proven)
    before = nothing.chi_square - 1
    if nothing.chi_square <= NOTHING:
        return _after_gate(proven, places, _SURE)
    costs = np.array([one.cost for one in refits])
    temper = _LEAST + _TEMPER * max(nothing.cost - costs.min(initial=nothing.cost), 0.0)
    weights = softmax(-costs / temper) if len(costs) else costs
    left = max(min((one.chi_square for one in refits), default=np.inf) - 1, _EXACT) / before
    explained = float(expit((np.log(_LEFT) - np.log(left)) / _WIDTH))
    sources = {t.estimate.variance_source for t in nothing.session.campaign.tests}
    hidden = max(_VISIBLE[source] for source in sources)
    visible = float(expit((np.log(before) - np.log(hidden)) / _WIDTH))
    if (1 - explained) * (1 - visible) > 0.5:
        return _after_gate(proven, places, _SURE * (1 - visible))
    single = [
        Cause(one.hypothesis, float(weight) * explained * _SURE, one)
        for one, weight in zip(refits, weights, strict=True)
        if one.hypothesis is not None
    ]
    if proven:
        # What a gate proved is present: alone, with another cause, or with what nobody knows.
        alone = _SURE * (1 - explained) * (1 - visible)
        both = sum(cause.probability for cause in single)
        sure = alone + both
        unexplained = (1 - sure) * 0.9
        certain = [Cause(one, sure, None) for one in proven]
        several = both if len(proven) == 1 else sure
        return Judged(0.0, unexplained, several, _kept((*certain, *single)), places, proven[0])
    causes = _kept(single)
    none = _SURE * (1 - explained) * (1 - visible) + 0.5 * (1 - _SURE)
    unexplained = 1 - none - sum(cause.probability for cause in single)
    best = causes[0].hypothesis if causes and causes[0].probability > unexplained else None
    return Judged(none, unexplained, 0.0, causes, places, best)


def _after_gate(
    proven: Sequence[Hypothesis], places: tuple[tuple[str, float], ...], sure: float
) -> Judged:
    """Nothing is left once what the gate proved is taken out."""
    if not proven:
        return Judged(sure, 1 - sure, 0.0, (), places, None)
    rest = 1 - sure
    several = sure if len(proven) > 1 else 0.0
    causes = tuple(Cause(one, sure, None) for one in proven)
    return Judged(rest / 2, rest / 2, several, causes, places, proven[0])


def _kept(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Most probable first, none below one per cent."""
    order = sorted(causes, key=lambda cause: -cause.probability)
    return tuple(cause for cause in order if cause.probability >= _ROW)


def _places(scored: Sequence[Score], proven: Sequence[Hypothesis]) -> tuple[tuple[str, float], ...]:
    """Places by share: what freeing each alone gains."""
    gains: dict[str, float] = {}
    for score in scored:
        place = score.hypothesis.location
        gains[place] = max(gains.get(place, 0.0), score.gain)
    sure = [one.location for one in proven]
    if not gains:
        return tuple((place, 1 / len(sure)) for place in sure)
    names = list(gains)
    values = np.array([gains[name] for name in names])
    shares = softmax(values / max(_SHARE * values.max(), 1e-9)) / (1 + len(sure))
    order = np.argsort(-shares, kind="stable")
    return (
        *((place, 1 / (1 + len(sure))) for place in sure),
        *((names[k], float(shares[k])) for k in order),
    )
