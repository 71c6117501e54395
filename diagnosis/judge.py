r"""From evidence to probabilities: none, unexplained, each cause, several; and to places.

What is left of the gap decides. With e = chi^2 - 1 of the refit without any effect and e1 that of
the best refit with one,

    visible   = expit((log e - log hidden) / width)       more than badly known noise,
                e without bounds of tolerances if the largest is no more than an outlier
    explained = expit((log left - log (e1 / e^0.75)) / width)   one effect takes nearly all of it:
                of a large gap the true one leaves a smaller part

and p(none) = (1 - explained)(1 - visible), p(unexplained) = (1 - explained) visible. Among causes,
costs differ by thousands of nats where the noise alone counts, but a model is never so exact.
Of n values, with cost0 without any effect:

    p(cause) = explained softmax(-cost / (least + inexact n + temper (cost0 - best)))

Places: of what a cause explains, the cause's; of what nothing explains, a softmax of what a free
force gains at each place. Most constants are calibrated on virtual campaigns whose
seeds no reported figure uses; ``calibration.json`` says which.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.special import expit, softmax

from diagnosis.evidence import BENDS, Evidence, Key
from identification.words import Real
from tuning import BOUND

NOTHING = 1.03  # chi square up to which nothing is missing: no hypothesis is asked
_POWER = 0.75  # of the gap: with what is left of it compared
_EXACT = 0.02  # no refit is believed to leave less
_ROW = 0.01  # probability of a cause that is worth a row


class Calibration(BaseModel):
    """The judgement's constants.

    Args:
        hidden: e that may be the noise's own variance, badly known, by where that comes from;
            third differences along frequency tell it worse than coherences do.
        hidden_width: of its logarithm.
        outlier: standard deviations that the largest of all tolerances may have.
        left: part of the gap, to that power, that is as likely explained as not.
        left_width: of its logarithm.
        least: nats that decide nothing.
        inexact: nats a value that decide nothing.
        temper: part of the whole gain that decides nothing.
        share: part of the best place's gain that decides nothing.
        sure: probability of what leaves no doubt.
        campaigns: how many it was made from.
        command: that makes it.
        seeds: of the campaigns.
        evidence: SHA-256 of what they gave.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    hidden: Mapping[str, float]
    hidden_width: float
    outlier: float
    left: float
    left_width: float
    least: float
    inexact: float
    temper: float
    share: float
    sure: float
    campaigns: int = 0
    command: str = ""
    seeds: str = ""
    evidence: str = ""


@cache
def calibrated() -> Calibration:
    """The committed calibration."""
    text = (files("diagnosis") / "calibration.json").read_text("utf-8")
    return Calibration.model_validate(json.loads(text))


@dataclass(frozen=True)
class Judged:
    """Probabilities.

    Args:
        none, unexplained, several: of what is no single cause.
        causes: with the probability that each is present, most probable first.
        where: places by their share.
    """

    none: float
    unexplained: float
    several: float
    causes: tuple[tuple[Key, float], ...]
    where: tuple[tuple[str, float], ...]

    @property
    def word(self) -> str:
        """The verdict's word."""
        single = 1 - self.none - self.unexplained - self.several
        options = {
            "none": self.none,
            "unexplained": self.unexplained,
            "several": self.several,
            "explained": single,
        }
        return max(options, key=lambda name: options[name])

    @property
    def best(self) -> Key | None:
        """The most probable cause, if causes are what is most probable."""
        return self.causes[0][0] if self.word in ("explained", "several") else None


def judge(seen: Evidence, by: Calibration | None = None) -> Judged:
    """Weigh what is left.

    Args:
        seen: the evidence.
        by: the calibration; the committed one if None.
    """
    by = by or calibrated()
    gap = seen.chi_square - 1
    doubt = 1 - by.sure
    if seen.chi_square <= NOTHING:
        visible, explained, weights = 0.0, 0.0, np.zeros(len(seen.refits))
    else:
        likely = seen.pull <= by.outlier  # and all that is left is one tolerance in hundreds
        beyond = max(seen.loose - 1, 1e-6) if likely else gap
        hidden = by.hidden[seen.variance]
        visible = float(expit((np.log(beyond) - np.log(hidden)) / by.hidden_width))
        left = max(min((one.chi_square for one in seen.refits), default=np.inf) - 1, _EXACT)
        left /= gap**_POWER
        explained = float(expit((np.log(by.left) - np.log(left)) / by.left_width))
        if likely and seen.pull > BOUND:  # whatever one released tolerance then explains
            explained *= visible
        weights = _weights(seen, by)
    none, unknown = (1 - explained) * (1 - visible), (1 - explained) * visible
    single = {
        one.key: by.sure * explained * float(weight)
        for one, weight in zip(seen.refits, weights, strict=True)
    }
    none, unknown = by.sure * none + doubt / 2, by.sure * unknown + doubt / 2
    if not seen.proven:
        causes = _kept(single)
        return Judged(none, unknown, 0.0, causes, _places(seen, by, causes, unknown))
    if any(effect == BENDS for effect, _, _ in seen.proven):
        unknown = doubt / 2  # it drives all bodies in ways that no Part holds: a gap is no surprise
    # What a gate proved is present: alone, with another cause, or with what nobody knows.
    sure = 1 - doubt
    certain = dict.fromkeys(seen.proven, sure * (1 - unknown / 2))
    both = {key: sure * value for key, value in single.items()}
    several = sum(both.values()) if len(seen.proven) == 1 else max(certain.values())
    rest = 1 - max(certain.values())
    causes = _kept(certain | both)
    return Judged(doubt / 2, rest - doubt / 2, several, causes, _places(seen, by, causes, rest))


def _weights(seen: Evidence, by: Calibration) -> Real:
    """Of the refits, beside each other."""
    if not seen.refits:
        return np.zeros(0)
    costs = np.array([one.cost for one in seen.refits])
    values = seen.cost / seen.chi_square
    gain = max(seen.cost - costs.min(), 0.0)
    weights: Real = softmax(-costs / (by.least + by.inexact * values + by.temper * gain))
    return weights


def _kept(causes: Mapping[Key, float]) -> tuple[tuple[Key, float], ...]:
    """Most probable first, none below one per cent."""
    order = sorted(causes.items(), key=lambda one: -one[1])
    return tuple(one for one in order if one[1] >= _ROW)


def _places(
    seen: Evidence, by: Calibration, causes: tuple[tuple[Key, float], ...], unknown: float
) -> tuple[tuple[str, float], ...]:
    """Places by their share, which sum to one."""
    shares: dict[str, float] = {}
    for (_, place, _), probability in causes:
        shares[place] = shares.get(place, 0.0) + probability
    if seen.pushed:
        gains = np.array([max(one.gain, 0.0) for one in seen.pushed])
        own = softmax(gains / (by.share * gains.max() + by.least))
        for one, share in zip(seen.pushed, own.tolist(), strict=True):
            shares[one.location] = shares.get(one.location, 0.0) + max(unknown, 1e-3) * share
    total = sum(shares.values())
    order = sorted(shares.items(), key=lambda one: -one[1])
    return tuple((place, share / total) for place, share in order)
