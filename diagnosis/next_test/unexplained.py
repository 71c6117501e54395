"""Next experiment where no effect of the catalogue explains the gap."""

from collections import Counter

from diagnosis.algorithm import Diagnosis
from identification.words import Campaign, Dof
from mbmodel import Machine, parent_bodies

_MIN_BODY_CHANNELS = (
    6  # channels on a body, as of two triaxial sensors: its motion is known but for a turn
)


def propose_unexplained_test(diagnosis: Diagnosis) -> str:
    """Return an experiment where the missing force acts, or at other levels if there is one.

    Args:
        diagnosis: the diagnosis.
    """
    explained = {cause.location for cause in diagnosis.present.causes}
    places = [place for place, _ in diagnosis.posterior.where if place not in explained]
    first = places[0] if places else ""
    if first in diagnosis.gate.unknown:
        sensor = first.partition(":")[2]
        return f"exchange {sensor}, its cable and its amplifier with those of another and repeat"
    campaign = diagnosis.session.campaign
    if len({test.condition.level_n for test in campaign.tests}) < 2:
        where = f"{first}, where something pushes" if first else "the joints"
        return (
            "repeat at a quarter and at four times the level: friction, backlash and hardening "
            f"change with it; look at {where}"
        )
    return _at(first, diagnosis.session.model.machine, campaign)


def _at(place: str, machine: Machine, campaign: Campaign) -> str:
    """Return the experiment that shows a force at a place: sensors beside it, or clamping it."""
    beside = _beside(place, machine)
    if not beside:
        return f"look at {place or 'the joints'}, and hit other bodies at each level as well"
    channels = Counter(campaign.layout.body_name(dof.point) for dof in _heard(campaign))
    blind = [body for body in beside if channels[body] < _MIN_BODY_CHANNELS]
    if blind:
        return (
            f"put two triaxial sensors or more on {' and '.join(blind)}, and hit there: something "
            f"pushes at {place}"
        )
    kind, _, name = place.partition(":")
    held = f"clamp the joint of {name}" if kind == "joint" else f"clear {name} of all it carries"
    return (
        f"{held} and repeat, {' and '.join(beside)} hit at each level: what pushes at {place} is "
        "gone then, and what is left of the gap pushes elsewhere"
    )


def _heard(campaign: Campaign) -> set[Dof]:
    """Channels that some test measured."""
    return {
        dof.positive
        for test in campaign.tests
        for dof, seen in zip(test.estimate.frf.outputs, test.estimate.measured, strict=True)
        if seen.any()
    }


def _beside(place: str, machine: Machine) -> list[str]:
    """Bodies that a joint joins, the ground left out, or the body itself; none of other places."""
    kind, _, name = place.partition(":")
    if kind not in ("joint", "body") or name not in machine.layout.bodies:
        return []
    below = parent_bodies(machine).get(name) if kind == "joint" else None
    return [name] if below is None else [below, name]
