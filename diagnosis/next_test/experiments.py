"""Experiments that can follow a campaign: further hits, a cause taken out, a known mass added.

Next experiment where drift may look like a law: the first level once more, at the end.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.algorithm import Diagnosis
from diagnosis.effects import PROVEN, load_catalogue
from diagnosis.inference.evidence import Key
from diagnosis.labels import LEVELS
from diagnosis.levels.free_levels import LAW_EFFECTS
from diagnosis.refits.refit import Refit
from diagnosis.settings import DiagnosisSettings
from identification.level_check import group_visits
from identification.words import Campaign, Dof, Input, Real, is_hammer_point
from mbmodel import AddedPart, Change, Machine, Model, Parameter, Part, hammer_parts
from tuning import Parametrisation, parametrise

_ADDED_MASS_NAME = "known_mass"


@dataclass(frozen=True, eq=False)
class Experiment:
    """Measurement that can follow a campaign.

    Args:
        words: instruction.
        inputs: points and directions that are hit.
        parts: returns the Parts that the experiment adds to a machine.
        undone: cause that is taken out of the machine; None for none.
        is_further_hit: whether the machine stays as it is and is hit elsewhere.
    """

    words: str
    inputs: tuple[Input, ...]
    parts: Callable[[Machine], tuple[Part, ...]] = lambda _: ()
    undone: Key | None = None
    is_further_hit: bool = False


def list_experiments(
    campaign: Campaign, rivals: Sequence[Refit], settings: DiagnosisSettings
) -> Iterator[list[Experiment]]:
    """Yield further hits, then causes that can be taken out of the machine, then known masses."""
    machine = rivals[0].session.model.machine
    layout = machine.layout
    hits = []
    for point in layout.points:
        if point not in layout.sensors and not is_hammer_point(point):
            continue
        directions = (Dof.of(point, axis) for axis in range(3))
        inputs = tuple(dof for dof in directions if dof not in campaign.inputs)
        if inputs:
            axes = " and ".join(dof.direction[2:] for dof in inputs)
            along = "" if len(inputs) == 3 else f" along {axes}"
            words = f"hit {point}{along} as well"
            hits.append(Experiment(words, inputs, add_hits(inputs), is_further_hit=True))
    yield hits
    undone = []
    for key in dict.fromkeys(key for rival in rivals for key in rival.keys):
        effect, place, dof = key
        entry = load_catalogue().get(effect) or PROVEN[effect]
        if entry.undoes:
            words = entry.describe(entry.confirm, place, dof)
            undone.append(Experiment(words, campaign.inputs, undone=key))
    yield undone
    share = settings.added_mass_share
    masses = share * np.diag(machine.body_mass)[::6]
    yield [
        Experiment(
            f"add {mass:.2g} kg at {body} and repeat", campaign.inputs, add_known_mass(k, share)
        )
        for k, (mass, body) in enumerate(zip(masses.tolist(), layout.bodies, strict=True))
    ]


def add_hits(inputs: tuple[Dof, ...]) -> Callable[[Machine], tuple[Part, ...]]:
    """Return a function that returns the Parts of further hits of a machine."""
    return lambda machine: hammer_parts(machine, inputs)


def add_known_mass(body: int, share: float) -> Callable[[Machine], tuple[Part, ...]]:
    """Return a function that returns the Part of a known mass at a body's centre of mass.

    Args:
        body: number of the body.
        share: mass as a share of that of the body.
    """

    def parts(machine: Machine) -> tuple[Part, ...]:
        frame = np.zeros((len(machine.body_mass), 3))
        frame[6 * body : 6 * body + 3] = np.eye(3)
        core = np.zeros((1, 3, 3, 3))
        core[0, 2] = share * machine.body_mass[6 * body, 6 * body] * np.eye(3)
        scale = Parameter(_ADDED_MASS_NAME, 1.0, "1", positive=False)
        place = f"body:{machine.layout.bodies[body]}"
        return (AddedPart.linear(place, (scale,), (Change("body", frame, frame, core),)),)

    return parts


@dataclass(frozen=True, eq=False)
class RivalModel:
    """Model of a rival in an experiment.

    Args:
        model: model of the rival, with the Parts of the experiment.
        theta: parameters [SI]; (n_parameter,).
        pinned: names of parameters that cannot vary.
        floor: relative model error.
    """

    model: Model
    theta: Real
    parametrisation: Parametrisation
    pinned: frozenset[str]
    floor: float


def add_experiment(experiment: Experiment, rival: Refit) -> RivalModel:
    """Return the model of a rival in an experiment."""
    session = rival.session
    model = Model(
        session.model.machine, (*session.model.parts, *experiment.parts(session.model.machine))
    )
    theta = np.append(rival.fit.theta, model.drawn[len(rival.fit.theta) :])
    names = [parameter.name for parameter in model.parameters]
    pinned = {_ADDED_MASS_NAME}
    for cause in rival.causes:
        if cause.key == experiment.undone:
            pinned |= set(cause.coordinates)
            theta = np.where(np.isin(names, cause.coordinates), model.drawn, theta)
    varies = session.parametrisation.extend(parametrise(model, session.campaign.tolerance))
    return RivalModel(model, theta, varies, frozenset(pinned), rival.floor)


def propose_return(diagnosis: Diagnosis) -> str | None:
    """Return the experiment that tells a law from a drift between the levels.

    Returns:
        None if the tests return to a level, or if no such cause leads.
    """
    causes = diagnosis.posterior.causes
    if not causes or not _changes_with_level(causes[0][0]):
        return None
    visits = group_visits(diagnosis.session.campaign)
    level, first = visits[0]
    if level is None or len({level for level, _ in visits}) < len(visits):
        return None
    place = causes[0][0][1].partition(":")[2]
    text = first.tests[0].condition.level_text
    return (
        f"repeat the tests at {text} after all others: if the joint of {place} depends on the "
        "level, it is then as before; if it drifts between the levels, it is not"
    )


def _changes_with_level(cause: Key) -> bool:
    effect, _, dof = cause
    return effect in LAW_EFFECTS or dof == LEVELS
