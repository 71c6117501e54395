"""Masses, springs, struts, appendages and delays that a state adds to the machine.

Each edit is written into a copy of the machine's MJCF, which is then read like any other. So
statics, modes, ports, plant and saved files follow it without a rule of their own.

    mass        a point mass m, welded to its body
    spring      a tendon of stiffness k and damping c, along an axis through a point of two bodies
    strut       such a spring between a point of each of two bodies, along the line of both
    appendage   a point mass m on three slides, each with k = m w0^2 and c = 2 zeta w0 m
    delay       exp(-s tau) behind the controller of a loop

Points count from the centre of mass of the body along the axes of the world [m]. Sizes are in SI.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from identification.words import ConvergenceError, InputError, Loop, Real, UsageError
from mbmodel import (
    WORLD,
    Addition,
    Element,
    Machine,
    link_elements,
    load_machine,
    point_mass_element,
    write_mjcf,
)
from mbmodel.mounting.place import find_pose

_Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[_Coordinate, _Coordinate, _Coordinate]
_MAX_SIZE_CHANGE = 1e-6  # of a mass or stiffness that is read back, relative to what was asked for
_Size = Annotated[float, Field(gt=0, le=1e15, allow_inf_nan=False)]
EDITED_MJCF = "model.xml"


class _Named(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(pattern=r"^[a-z]+[0-9]{1,4}$")]


class _AtBody(_Named):
    """An edit at a point of a body."""

    body: str
    point: Triple = (0.0, 0.0, 0.0)

    def list_additions(self, machine: Machine) -> tuple[Addition, ...]:
        """Return what it adds to the machine's MJCF."""
        raise NotImplementedError


class AddedMass(_AtBody):
    """A point mass [kg] welded to a body; the joints below carry its weight as the body's."""

    kind: Literal["mass"] = "mass"
    mass: _Size

    def list_additions(self, machine: Machine) -> tuple[Addition, ...]:
        """Return a body without a joint."""
        pose = find_pose(machine, self.body, self.point)
        gravcomp = 1.0 - pose.weight_fraction
        element = point_mass_element(self.name, pose.position, self.mass, gravcomp)
        return (Addition(self.name, self.body, element),)


class _AlongLine(_AtBody):
    """A spring [N/m] and damper [N s/m] from another body, or the ground, to a body."""

    to: str = WORLD
    stiffness: _Size
    damping: Annotated[float, Field(ge=0, le=1e15, allow_inf_nan=False)] = 0.0

    def list_additions(self, machine: Machine) -> tuple[Addition, ...]:
        """Return a tendon between two sites along the line."""
        if self.to not in (WORLD, *machine.layout.bodies) or self.to == self.body:
            raise UsageError(f"{self.name}: {self.to} is no other body: choose another end")
        middle, line = self._find_line(machine, _find_place(machine, self.body, self.point))
        length = float(np.linalg.norm(line))
        if not length > 0:
            raise UsageError(f"{self.name}: {self._no_direction}")
        sizes, ends = np.array([self.stiffness, self.damping]), (self.to, self.body)
        return link_elements(self.name, machine, ends, (middle, line / length), sizes, length)

    _no_direction: ClassVar[str]

    def _find_line(self, machine: Machine, point: Real) -> tuple[Real, Real]:
        """Return the middle of the line from a point, and the line [m], in world axes; (3,)."""
        raise NotImplementedError


class AddedSpring(_AlongLine):
    """A spring along an axis through a point that two bodies share."""

    kind: Literal["spring"] = "spring"
    axis: Triple

    _no_direction: ClassVar[str] = "give the axis a direction, such as 0, 0, 1"

    def _find_line(self, machine: Machine, point: Real) -> tuple[Real, Real]:
        del machine
        return point, np.array(self.axis) / max(float(np.linalg.norm(self.axis)), 1e-300)


class AddedStrut(_AlongLine):
    """A strut without preload between a point of a body and one of another, or of the ground.

    The end on the ground counts from the origin of the world.
    """

    kind: Literal["strut"] = "strut"
    end: Triple

    _no_direction: ClassVar[str] = "its two ends are one point: move one of them"

    def _find_line(self, machine: Machine, point: Real) -> tuple[Real, Real]:
        is_ground = self.to == WORLD
        end = np.array(self.end) if is_ground else _find_place(machine, self.to, self.end)
        return (point + end) / 2, point - end


def _find_place(machine: Machine, body: str, offset: Triple) -> Real:
    """Return a point of a body in the world's axes [m]; (3,)."""
    pose = find_pose(machine, body, offset)  # refuses a body that is not there
    drawn = machine.drawing.bodies[body]
    return drawn.origin + drawn.frame @ pose.position


class AddedAppendage(_AtBody):
    """A mass [kg] on springs along all axes, of one natural frequency [Hz] and damping ratio."""

    kind: Literal["appendage"] = "appendage"
    mass: _Size
    frequency: _Size
    damping: Annotated[float, Field(gt=0, lt=1)] = 0.03

    def list_additions(self, machine: Machine) -> tuple[Addition, ...]:
        """Return a body on three slides, which holds its own weight."""
        omega = 2 * np.pi * self.frequency
        slides = tuple(
            Element(
                "joint",
                {
                    "name": f"{self.name}_{axis}",
                    "type": "slide",
                    "axis": direction,
                    "stiffness": self.mass * omega**2,
                    "damping": 2 * self.damping * omega * self.mass,
                    **dict.fromkeys(("armature", "frictionloss", "springref"), "0"),
                    "springdamper": "0 0",
                    "limited": "false",
                },
            )
            for axis, direction in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
        )
        position = find_pose(machine, self.body, self.point).position
        element = point_mass_element(self.name, position, self.mass, 1.0, slides)
        return (Addition(self.name, self.body, element),)


class AddedDelay(_Named):
    """A delay [s] in series with the controller of a loop."""

    kind: Literal["delay"] = "delay"
    loop: str
    delay: _Size


MachineEdit = Annotated[
    AddedMass | AddedSpring | AddedStrut | AddedAppendage | AddedDelay, Field(discriminator="kind")
]


def edit_machine(machine: Machine, edits: Sequence[MachineEdit], folder: Path) -> Machine:
    """Write the edits into a copy of the machine's MJCF, and load the machine from it.

    Args:
        machine: as its MJCF describes it.
        edits: what is added; delays do not concern it.
        folder: of the copy; it exists as long as the machine is used.

    Raises:
        InputError: a body that the machine does not have, or a file that cannot be read.
        ConvergenceError: the machine has no static equilibrium.
        UsageError: an end or an axis of a spring or strut that cannot be.
    """
    changes = [
        addition
        for edit in edits
        if not isinstance(edit, AddedDelay)
        for addition in edit.list_additions(machine)
    ]
    if not changes:
        return machine
    path = folder / EDITED_MJCF
    if write_mjcf(machine.source, path, changes):  # a body of an included file
        write_mjcf(machine.source, path, changes, expanded=True)
    try:
        edited = load_machine(path, key=machine.keyframe, reading=machine.reading)
    except (InputError, ConvergenceError) as error:
        text = str(error).replace(str(path), f"{machine.source.name} with what was added")
        raise type(error)(text) from error
    _check_sizes(machine, edited, edits)
    return edited


def _check_sizes(machine: Machine, edited: Machine, edits: Sequence[MachineEdit]) -> None:
    """Refuse an MJCF whose settings give additions other sizes, or change what was there.

    Raises:
        InputError: the sentence names the settings.
    """
    asked = sum(edit.mass for edit in edits if isinstance(edit, AddedMass | AddedAppendage))
    before, after = (np.diag(each.body_mass)[::6].sum() for each in (machine, edited))
    stiffness = {spring.name: spring.stiffness for spring in edited.springs}
    wanted = {edit.name: edit.stiffness for edit in edits if isinstance(edit, _AlongLine)} | {
        f"{edit.name}_x": edit.mass * (2 * np.pi * edit.frequency) ** 2
        for edit in edits
        if isinstance(edit, AddedAppendage)
    }
    if abs(after - before - asked) > _MAX_SIZE_CHANGE * after or any(
        abs(stiffness.get(name, 0.0) - size) > _MAX_SIZE_CHANGE * size
        for name, size in wanted.items()
    ):
        raise InputError(
            f"{machine.source.name} gives what is added other masses or springs: take "
            "settotalmass, boundmass, boundinertia or springdamper out of its compiler and classes"
        )


def added_delays(edits: Sequence[MachineEdit]) -> dict[str, float]:
    """Return the delays that edits add to loops [s], by the loop's name."""
    added: dict[str, float] = {}
    for edit in edits:
        if isinstance(edit, AddedDelay):
            added[edit.loop] = added.get(edit.loop, 0.0) + edit.delay
    return added


def check_delays(loops: Sequence[Loop], edits: Sequence[MachineEdit]) -> None:
    """Refuse delays of loops that are not there.

    Raises:
        UsageError: the sentence names the loop.
    """
    for name in added_delays(edits).keys() - {loop.name for loop in loops}:
        raise UsageError(f"{name} is no control loop of this machine or of its budget")


def delay_loops(loops: Sequence[Loop], edits: Sequence[MachineEdit]) -> tuple[Loop, ...]:
    """Return loops with the delays that edits add."""
    added = added_delays(edits)
    return tuple(replace(loop, delay=loop.delay + added.get(loop.name, 0.0)) for loop in loops)
