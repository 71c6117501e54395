"""What a drawing lacks: which effects, where, and how much of each survives a refit."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.survival import SurvivalRefit
from truth.effects import Effect, Scene
from truth.effects.effect import stated_number
from truth.effects.other_packages import known_effects
from truth.errors import NoPlaceError, TruthError
from truth.random_streams import stream

_MAX_EFFECT_DRAWS = 20  # of place and shape, for an effect as strong as is wanted
_RATIO_TOLERANCE = 0.04  # of the wanted ratio
_HIDDEN = 1.1  # of the logarithm of the wanted ratio: a refit takes nearly all
_MORE = 4.0  # times the ratio, what the first step may have to leave
_MAX_SIZE_STEPS = 12  # repetitions of the search for a size
_OVERSHOT = 0.25  # of the logarithm of the ratio: a correction that goes farther is taken back
_BETWEEN = 3  # sizes between one that leaves too little and one that leaves too much, at most


@dataclass(frozen=True)
class Wanted:
    """An effect that is to be drawn.

    Args:
        effect: its name in the catalogue.
        place: such as ``joint:ty``; drawn if None.
        ratio: survival ratio that its size is chosen for; None: the size is drawn.
        corrections: how often the size is corrected for what the further steps of a refit hide.
        parameter: name and value of the parameter of its answer that its size is chosen for,
            instead of a ratio.
        draws: of place and shape at most, until one can be as strong as that.
    """

    effect: str
    place: str | None = None
    ratio: float | None = None
    corrections: int = 1
    parameter: tuple[str, float] | None = None
    draws: int = _MAX_EFFECT_DRAWS


@dataclass(frozen=True)
class Cause:
    """What a campaign's drawing lacks.

    Args:
        wanted: the effects, the one that is graded first, first.
        mistuned: no tolerance is at work, and stiffness and damping are twice as far off as usual.
        kind: of the case, for the record.
    """

    wanted: tuple[Wanted, ...] = ()
    mistuned: bool = False
    kind: str = ""


@dataclass(frozen=True, eq=False)
class Drawn:
    """An effect as drawn.

    Args:
        effect: ready to be put into the machine.
        ratio: its survival ratio; None if nobody asked.
    """

    effect: Effect
    ratio: float | None


@dataclass(frozen=True, eq=False)
class Draws:
    """Effects as drawn, and how many draws were thrown away for them."""

    drawn: tuple[Drawn, ...]
    discarded: int


def draw_effects(
    machine: TrueMachine, scene: Scene, cause: Cause, refit: Callable[[], SurvivalRefit], seed: int
) -> Draws:
    """Draw the effects of a cause, each as strong as is wanted.

    The refit is made only where a ratio is wanted, and but once.

    Machine and test are drawn before and stay: only place and shape of an effect are drawn again
    where no size in its limits gives the ratio. Else the machines would tell what is wrong.

    Raises:
        TruthError: an effect is unknown, or the machine cannot have it at all.
    """
    linear = refit() if any(wanted.ratio is not None for wanted in cause.wanted) else None
    effects: list[Drawn] = []
    discarded = 0
    for number, wanted in enumerate(cause.wanted):
        if wanted.effect not in known_effects():
            raise TruthError(
                f"effect {wanted.effect!r} is unknown; choose from {', '.join(known_effects())}"
            )
        name = f"effect.{wanted.effect}" + (f".{number}" if number else "")
        random = stream(seed, name)
        taken = {drawn.effect.answer().location for drawn in effects}
        drawn, more = _draw_effect(random, machine, scene, wanted, linear, taken)
        effects.append(drawn)
        discarded += more
    both = replace(machine, effects=tuple(drawn.effect for drawn in effects))
    rigs = [both.rig(occasion) for occasion in scene.occasions[:1]]
    if any(rig.joints and rig.laws for rig in rigs):
        raise NoPlaceError("a stiffness that depends on frequency cannot stand beside a nonlinear")
    return Draws(tuple(effects), discarded)


def _draw_effect(
    random: np.random.Generator,
    machine: TrueMachine,
    scene: Scene,
    wanted: Wanted,
    refit: SurvivalRefit | None,
    taken: set[str],
) -> tuple[Drawn, int]:
    """Draw one effect; of draws that all fail the one that comes nearest to its ratio is kept."""
    best: Drawn | None = None
    for number in range(wanted.draws):
        effect = known_effects()[wanted.effect](random, scene, wanted.place)
        if effect is None:
            raise NoPlaceError(f"{wanted.effect}: {machine.station.name} has no place for it")
        if effect.answer().location in taken and wanted.place is None and taken != {""}:
            continue
        sized = effect if wanted.parameter is None else size_by_parameter(effect, *wanted.parameter)
        if sized is None:
            continue
        if wanted.ratio is None or refit is None:
            return Drawn(sized, None), number
        drawn, near = _strong(effect, machine, wanted.ratio, refit, wanted.corrections)
        if near:
            return drawn, number
        if best is None or _off(drawn, wanted.ratio) < _off(best, wanted.ratio):
            best = drawn
    if best is None:
        full = f"every place of {machine.station.name} is taken"
        if wanted.parameter is not None:
            name, value = wanted.parameter
            full = f"no draw of {wanted.draws} can have the {name} {value:g}"
        raise NoPlaceError(f"{wanted.effect}: {full}")
    return best if refit is None else _whole(best, machine, refit), wanted.draws


def _off(drawn: Drawn, ratio: float) -> float:
    return abs(float(np.log(_surviving(drawn) / ratio)))


def size_by_parameter(effect: Effect, name: str, value: float) -> Effect | None:
    """Return the effect at the size at which its answer has a parameter; None if none has it."""
    names = effect.answer().parameters
    if name not in names:
        has = f"it has {', '.join(names)}" if names else "it has none"
        raise TruthError(f"{effect.answer().effect}: no parameter {name!r} sets its size: {has}")

    def off(logarithm: float) -> float:
        stated = effect.sized(float(np.exp(logarithm))).answer().parameters[name]
        return stated_number(name, stated) - value

    if effect.limits is None:
        return None
    low, high = (float(np.log(limit)) for limit in effect.limits)
    if off(low) * off(high) > 0:
        return None
    return effect.sized(float(np.exp(brentq(off, low, high, xtol=1e-12))))


def _strong(
    effect: Effect, machine: TrueMachine, ratio: float, refit: SurvivalRefit, corrections: int
) -> tuple[Drawn, bool]:
    """Choose the size for a ratio; whether a refit leaves about as much as was aimed at.

    Its further steps hide more, of some effects much more: the size is then chosen anew for a
    ratio of the first step that is larger by what they have hidden. They may hide a smaller part of
    a larger size, whose ratio is then too large: sizes between are tried.
    """
    least = ratio * float(np.exp(-_HIDDEN))
    first = _first_step(effect, machine, ratio, refit)
    if effect.size is not None and (first.ratio or 0.0) < least:
        return first, False  # further steps leave even less
    tried = [_whole(first, machine, refit, least)]
    if effect.size is None:
        return tried[0], True
    aim = ratio
    for _ in range(corrections):
        if (
            _surviving(first) < aim * np.exp(-2 * _RATIO_TOLERANCE)
            or _off(tried[-1], ratio) <= 2 * _RATIO_TOLERANCE
        ):
            break
        aim = min(aim * ratio / _surviving(tried[-1]), _MORE * ratio)
        first = _first_step(effect, machine, aim, refit)
        tried.append(_whole(first, machine, refit, least))
    nearest = _interpolate_size(tried, machine, ratio, refit)
    return nearest, _off(nearest, ratio) <= _HIDDEN


def _interpolate_size(
    tried: list[Drawn], machine: TrueMachine, ratio: float, refit: SurvivalRefit
) -> Drawn:
    """Return the size that comes nearest to a ratio, of those tried and of some between them.

    Between a size with a smaller ratio and one with a larger ratio, the logarithm of the ratio is
    interpolated over that of the size (regula falsi).
    """
    for _ in range(_BETWEEN):
        smaller = [drawn for drawn in tried if _surviving(drawn) < ratio]
        larger = [drawn for drawn in tried if _surviving(drawn) >= ratio]
        nearest = min(_off(drawn, ratio) for drawn in tried)
        if not smaller or not larger or nearest <= _OVERSHOT:
            break
        low, high = max(smaller, key=_surviving), min(larger, key=_surviving)
        share = np.log(ratio / _surviving(low)) / np.log(_surviving(high) / _surviving(low))
        ends = np.log([drawn.effect.size or 1.0 for drawn in (low, high)])
        size = float(np.exp(ends[0] + share * (ends[1] - ends[0])))
        tried = [*tried, _whole(Drawn(low.effect.sized(size), None), machine, refit)]
    return min(tried, key=lambda drawn: _off(drawn, ratio))


def _surviving(drawn: Drawn) -> float:
    """Return the survival ratio, more than zero."""
    return max(drawn.ratio or 0.0, 1e-9)


def _whole(first: Drawn, machine: TrueMachine, refit: SurvivalRefit, least: float = 0.0) -> Drawn:
    """Return an effect with the ratio that a whole refit leaves; it stops below the least."""
    faulty = replace(machine, effects=(first.effect,))
    return replace(first, ratio=refit.retuned_ratio(faulty, least))


def _first_step(effect: Effect, machine: TrueMachine, ratio: float, refit: SurvivalRefit) -> Drawn:
    """Choose the size for a ratio to first order: it grows in proportion until it saturates."""

    def survives(candidate: Effect) -> float:
        return refit.ratio(replace(machine, effects=(candidate,)))

    if effect.size is None or effect.limits is None:
        return Drawn(effect, survives(effect))
    low, high = np.log(effect.limits)
    ends, at = (low, high), float(np.log(effect.size))
    best = Drawn(effect, 0.0)
    for _ in range(_MAX_SIZE_STEPS):
        tried = effect.sized(float(np.exp(at)))
        best = Drawn(tried, survives(tried))
        off = float(np.log(_surviving(best) / ratio))
        if abs(off) <= _RATIO_TOLERANCE:
            break
        if at in ends:  # not even there
            break
        low, high = (at, high) if off < 0 else (low, at)
        ahead, end = at - off, high if off < 0 else low
        beyond = end if end in ends else (low + high) / 2  # first: can it be had at all
        at = ahead if low < ahead < high else beyond
    return best
