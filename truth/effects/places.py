"""Draws of effects, and where they act: numbers, directions, places, rows of a rig there.

A place is a location drawn, or named by the user as in the answer, ``joint:ty``. Effects that came
before may have coordinates of their own at the end of the rig's; rows here are as wide as the rig,
zero there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np

from truth.effects.effect import Answer, Parameter, Sized
from truth.errors import NoPlaceError, TruthError
from truth.machine.dynamics import joint_rows, motion_at
from truth.machine.rig import Prepared, Rig
from truth.machine.station import AXES, GROUND, Joint, Real, Station

DIRECTIONS = tuple(kind + axis for kind in "tr" for axis in AXES)
_N_LISTED = 12  # locations in a sentence


def draw_stage(
    random: np.random.Generator,
    station: Station,
    place: str | None,
    kind: str,
    choices: Sequence[int],
) -> int | None:
    """Draw the index of a stage among those that can have an effect; None if there is none.

    The stage is drawn even when one is named, so that naming it leaves the other draws alone.

    Args:
        random: random numbers of the effect.
        station: the true machine.
        place: a location such as ``body:ty``, or None.
        kind: ``body`` or ``joint``.
        choices: stages that can have the effect.

    Raises:
        TruthError: the named place is none, or cannot have the effect.
    """
    if not choices:
        return None
    drawn = choices[int(random.integers(len(choices)))]
    if place is None:
        return drawn
    named, _, name = place.rpartition(":")
    if named not in ("", kind):
        raise TruthError(f"{place!r}: this effect sits at {kind}:<name>")
    index = station.index(name)
    if index not in choices:
        possible = ", ".join(f"{kind}:{station.stages[i].name}" for i in choices)
        raise NoPlaceError(f"{place!r} cannot have this effect; these can: {possible}")
    return index


def draw_location(
    random: np.random.Generator, place: str | None, locations: Sequence[str]
) -> int | None:
    """Draw the number of a location among those that can have an effect; None if there is none.

    It is drawn even when one is named, as in ``draw_stage``.

    Raises:
        TruthError: the named place is not among the locations.
    """
    if not locations:
        return None
    drawn = choose(random, range(len(locations)))
    if place is None:
        return drawn
    for number, location in enumerate(locations):
        if place in (location, location.partition(":")[2]):
            return number
    possible = ", ".join(locations[:_N_LISTED]) + (" ..." if len(locations) > _N_LISTED else "")
    raise NoPlaceError(f"{place!r} cannot have this effect; these can: {possible}")


def direction_of(joint: Joint) -> str:
    """Return tx ... rz of a joint: as its name ends, else by the largest part of its axis."""
    ending = joint.name.rpartition("_")[2]
    if ending in DIRECTIONS:
        return ending
    return ("t" if joint.kind == "slide" else "r") + AXES[int(np.abs(joint.axis).argmax())]


@dataclass(frozen=True)
class StageDirection:
    """One direction of a stage's joint.

    Args:
        stage: name of the child body.
        number: of the joint among the stage's.
        dof: such as ``ty``.
    """

    stage: str
    number: int
    dof: str

    @property
    def location(self) -> str:
        """As in an answer."""
        return f"joint:{self.stage}"

    def joint(self, station: Station) -> Joint:
        """Return the joint in a station."""
        return station.stages[station.index(self.stage)].joints[self.number]

    def stretch(self, rig: Rig, tested: Prepared) -> Real:
        """Return how far the joint moves, in all coordinates of the rig; (n,)."""
        return joint_stretch(rig, tested, tested.station.index(self.stage))[self.number]


@dataclass(frozen=True)
class AtDirection(Sized):
    """An effect on one direction of a joint.

    Attributes:
        effect: name in the catalogue, ``unexplained`` outside of it.
        kind: name outside the catalogue.
    """

    direction: StageDirection
    effect: ClassVar[str]
    kind: ClassVar[str] = ""

    def parameters(self) -> Mapping[str, Parameter]:
        """Return what describes it, by name, in SI units."""
        raise NotImplementedError

    def answer(self) -> Answer:
        """Return what is to be found."""
        place = self.direction
        return Answer(self.effect, place.location, place.dof, self.parameters(), self.kind)


def has_spring(joint: Joint) -> bool:
    """Tell whether a joint has a spring."""
    return joint.stiffness > 0


def draw_direction(
    random: np.random.Generator,
    station: Station,
    place: str | None,
    usable: Callable[[Joint], bool] = has_spring,
) -> StageDirection | None:
    """Draw one direction of the joint of a stage, at ``joint:<stage>``; None if there is none."""
    choices = [i for i, stage in enumerate(station.stages) if any(map(usable, stage.joints))]
    index = draw_stage(random, station, place, "joint", choices)
    if index is None:
        return None
    stage = station.stages[index]
    number = choose(random, [i for i, joint in enumerate(stage.joints) if usable(joint)])
    return StageDirection(stage.name, number, direction_of(stage.joints[number]))


def draw_spring_stage(
    random: np.random.Generator, station: Station, place: str | None
) -> str | None:
    """Draw the name of a stage whose joint has a spring, at ``joint:<stage>``."""
    choices = [i for i, stage in enumerate(station.stages) if any(map(has_spring, stage.joints))]
    index = draw_stage(random, station, place, "joint", choices)
    return None if index is None else station.stages[index].name


def hammer_site(station: Station, node: int) -> str:
    """Return the site that the hammer hits at a node: its own, else the accelerometer's."""
    hits = {hit.node for stage in station.stages for hit in stage.hit_points}
    return f"hit{node}" if node in hits else f"acc{node}"


_T = TypeVar("_T")


def choose(random: np.random.Generator, among: Sequence[_T]) -> _T:
    """Draw one of several with a single random number, however many there are.

    So the draws that follow do not depend on the place that is chosen from.
    """
    return among[int(random.random() * len(among))]


def log_uniform(random: np.random.Generator, limits: tuple[float, float]) -> float:
    """Draw a number whose logarithm is uniform between the limits."""
    low, high = np.log(limits)
    return float(np.exp(random.uniform(low, high)))


def sign(random: np.random.Generator) -> int:
    """Draw +1 or -1."""
    return choose(random, (1, -1))


def unit_vector(random: np.random.Generator, span: Real | None = None) -> tuple[float, ...]:
    """Draw a direction, uniform on the sphere of a space.

    Args:
        random: random numbers of the effect.
        span: vectors that span the space, one a row, (n, 3); all three axes if none.
    """
    vector = random.standard_normal(3)
    if span is not None:
        _, strengths, rows = np.linalg.svd(span)
        basis = rows[: int(np.sum(strengths > 1e-9 * strengths[0]))]
        vector = basis.T @ (basis @ vector)
    return tuple(float(part) for part in vector / np.linalg.norm(vector))


def body_motion(rig: Rig, tested: Prepared, index: int, point: Real) -> Real:
    """Return translation of a stage's point and its rotation there, world axes; (6, n)."""
    return _as_wide(motion_at(tested.station, index, point, tested.flexes), rig)


def relative_motion(rig: Rig, tested: Prepared, index: int, point: Real) -> Real:
    """Return the motion at a point of a stage against its parent, world axes; (6, n)."""
    motion = body_motion(rig, tested, index, point)
    parent = tested.station.stages[index].parent
    return motion if parent == GROUND else motion - body_motion(rig, tested, parent, point)


def joint_stretch(rig: Rig, tested: Prepared, index: int) -> Real:
    """Return how far each joint of a stage moves; (n_joint, n)."""
    return _as_wide(joint_rows(tested.station, index, tested.flexes)[0], rig)


def springs(rows: Real, stiffness: Real | list[float]) -> Real:
    """Return the stiffness matrix of springs on rows, sum of k g g^T; (n, n)."""
    return (rows.T * stiffness) @ rows


def _as_wide(rows: Real, rig: Rig) -> Real:
    return np.pad(rows, ((0, 0), (0, len(rig.equations.mass) - rows.shape[1])))
