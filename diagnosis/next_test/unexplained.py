"""Next experiment where no effect of the catalogue explains the gap."""

from collections import Counter

from diagnosis.algorithm import Diagnosis
from diagnosis.inference.evidence import Key
from identification.words import DIRECTIONS, Campaign, Output
from mbmodel import Machine, parent_bodies


def propose_unexplained_test(diagnosis: Diagnosis) -> str:
    """Return an experiment at the place of the unknown force, or at other levels.

    A gap that no single place explains names no place.
    """
    explained = {location for _, location, _ in list_first_mended(diagnosis)}
    places = [place for place, _ in diagnosis.posterior.where if place not in explained]
    place = places[0] if places else ""
    if place in diagnosis.checks.unknown:
        sensor = place.partition(":")[2]
        return f"exchange {sensor}, its cable and its amplifier with those of another and repeat"
    if diagnosis.present.rest.spread == "everywhere":
        place = ""
    campaign = diagnosis.session.campaign
    if len({test.condition.level_n for test in campaign.tests}) < 2:
        where = f"; look at {place}, where an unknown force acts" if place else ""
        return (
            "repeat at a quarter and at four times the level, then at the first again: friction, "
            f"backlash and hardening change with the level and come back, a drift does not{where}"
        )
    return _propose_test_at(place, diagnosis.session.model.machine, campaign)


def list_first_mended(diagnosis: Diagnosis) -> list[Key]:
    """Return the present causes and the proven faults that would close enough of the gap."""
    faults = (
        row.key
        for row in diagnosis.present.remarks
        if row.closed is not None and row.closed >= diagnosis.settings.min_closed
    )
    return [*(cause.key for cause in diagnosis.present.causes), *faults]


def _propose_test_at(place: str, machine: Machine, campaign: Campaign) -> str:
    """Return the experiment that shows a force at a place: sensors beside it, or clamping it.

    A body with fewer channels than its six rigid motions needs more of them first.
    """
    bodies = _find_bodies(place, machine)
    if not bodies:
        return f"look at {place or 'the joints'}, and hit other bodies at each level as well"
    channels = Counter(campaign.layout.owner_name(dof) for dof in _find_measured_channels(campaign))
    blind = [body for body in bodies if channels[body] < len(DIRECTIONS)]
    if blind:
        return (
            f"put two triaxial sensors or more on {' and '.join(blind)}, and hit there: an unknown "
            f"force acts at {place}"
        )
    kind, _, name = place.partition(":")
    change = f"clamp the joint of {name}" if kind == "joint" else f"clear {name} of all it carries"
    return (
        f"{change} and repeat, {' and '.join(bodies)} hit at each level: a force at {place} is "
        "gone then, and a gap that remains has its cause elsewhere"
    )


def _find_measured_channels(campaign: Campaign) -> set[Output]:
    """Return the channels that some test measured."""
    return {
        dof.positive
        for test in campaign.tests
        for dof, measured in zip(test.estimate.frf.outputs, test.estimate.measured, strict=True)
        if measured.any()
    }


def _find_bodies(place: str, machine: Machine) -> list[str]:
    """Return the body at a place, or the bodies that a joint joins without the ground.

    Other places have none.
    """
    kind, _, name = place.partition(":")
    if kind not in ("joint", "body") or name not in machine.layout.bodies:
        return []
    below = parent_bodies(machine).get(name) if kind == "joint" else None
    return [name] if below is None else [below, name]
