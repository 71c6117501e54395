"""Modes that may be combination tones: sums and differences of the frequencies of stronger modes.

A machine whose force has terms of second or third order in its motion responds at 2 f_i, f_i + f_j,
|f_i - f_j|, 3 f_i and |2 f_i +- f_j| without having a mode there (Nayfeh and Mook 1979, ch. 4 and
6). After a hit these responses ring like modes, so that FRFs hold poles for them. Such a pole is
far weaker than the modes that cause it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from identification.words import ModalModel, Real

_MIN_PARENT_STRENGTH = 10.0  # response of a parent over that of the tone, at their resonances
_MAX_DEVIATIONS = 3.0  # standard deviations between a frequency and the combination that it is
# Expected number of combinations that lie so near by chance: many modes have sums everywhere.
_MAX_CHANCE = 0.05


@dataclass(frozen=True)
class _Combination:
    """A sum, difference or multiple of natural frequencies.

    Args:
        name: its name in a sentence.
        freq_hz: its frequency [Hz].
        factors: each mode and its integer factor.
        order: order of the force that causes it: sum of the absolute factors.
    """

    name: str
    freq_hz: float
    factors: tuple[tuple[int, int], ...]
    order: int


def find_combination_tones(model: ModalModel, count: int) -> dict[int, str]:
    """Return what each possible combination tone is a combination of, as a part of a sentence.

    Args:
        model: modes, those inside the band first.
        count: number of modes inside the band.
    """
    freq, sd = model.freq_hz[:count], model.freq_sd[:count]
    size = np.linalg.norm(model.shapes, axis=0) * np.linalg.norm(model.participation, axis=0)
    half_width = np.maximum(np.abs(model.poles.real), np.finfo(float).tiny)
    strength = (size * np.abs(model.poles) / half_width)[:count]
    width = float(freq.max() - freq.min()) if count else 0.0
    reasons: dict[int, str] = {}
    for mode in np.argsort(-strength, kind="stable"):
        strong = np.flatnonzero(strength > _MIN_PARENT_STRENGTH * strength[mode])
        parents = [int(parent) for parent in strong if parent not in reasons]
        combinations = list(_list_combinations(parents, freq))
        second = [tone for tone in combinations if tone.order == 2]
        doubles = [tone for tone in second if len(tone.factors) == 1]
        for tones in (doubles, second, combinations):  # the simplest first: fewest by chance
            name = _find_nearest(tones, float(freq[mode]), float(sd[mode]), sd, width)
            if name:
                reasons[int(mode)] = (
                    f"its frequency is {name}, and it is far weaker: a nonlinear machine responds "
                    "at sums, differences and multiples of its frequencies without a mode there"
                )
                break
    return reasons


def _find_nearest(
    combinations: Sequence[_Combination], freq_hz: float, own_sd: float, sd: Real, width_hz: float
) -> str:
    """Return the combination that a frequency is; empty if none, or if chance gives one."""
    name, nearest = "", _MAX_DEVIATIONS
    for tone in combinations:
        spread = sum((factor * sd[mode]) ** 2 for mode, factor in tone.factors)
        deviation = float(np.sqrt(own_sd**2 + spread))
        distance = abs(tone.freq_hz - freq_hz)
        chance = 2 * max(distance, deviation) * len(combinations)
        if distance < nearest * deviation and chance <= _MAX_CHANCE * width_hz:
            name, nearest = tone.name, distance / deviation
    return name


def _list_combinations(modes: Sequence[int], freq: Real) -> Iterator[_Combination]:
    """Yield each combination of second and third order."""
    for mode in modes:
        for order in (2, 3):
            yield _Combination(
                f"{order} times that of mode {mode + 1}",
                float(order * freq[mode]),
                ((mode, order),),
                order,
            )
    for first, second in permutations(modes, 2):
        for factor in (1, 2) if first > second else (2,):
            twice = "" if factor == 1 else "twice "
            for sign, word in ((1, "sum"), (-1, "difference")):
                yield _Combination(
                    f"the {word} of {twice}that of mode {first + 1} and that of mode {second + 1}",
                    float(abs(factor * freq[first] + sign * freq[second])),
                    ((first, factor), (second, sign)),
                    factor + 1,
                )
