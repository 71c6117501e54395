r"""A body that bends: one mode of its own, beside its rigid motion.

With the coordinate b of the mode, the modal mass the body's mass m, the points of the body move by

    u(p) = rigid motion + shape(p) b,    m (b'' + 2 zeta w0 b' + w0^2 b) = what pushes b.

The rigid motion is that of the joint below. Nothing is known of the shape, so all that is felt of
it is a parameter: its value along each channel and each direction hit, the motion of the joints
above (six numbers for each, for all that stands on it moves along), and the rigid motion d that
carries as much momentum as the bending body does. With T_b the column of b in the kinematics,

    T_b = d on the body, transport(joint) gamma above,    L += shape' b,    P' += shape' at the hit,

shape' = shape less d at the point. Forces follow by T' and P': where a hit has the shape that a
sensor there reads, the answer is reciprocal. A hit has a parameter of its own, whatever a sensor
beside it reads. w0 is the frequency with the momentum of the body held, as of the free body.

The coordinate b moves a body of its own, after all others, of mass m, along x alone. That is
component mode synthesis (Craig and Kurdila 2006, ch. 17) with one mode, whose shape is fitted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from identification.words import Real
from mbmodel.compliance.extended_machine import widened, with_body
from mbmodel.machine import Axle, Machine, parents_of
from mbmodel.parts import AddedPart, Change, Parameter

_STEPS = 0.05, 0.5  # of the logarithms of frequency and damping per unit of theirs
_SHAPE = 0.1  # per unit of the shape's parameters; of rotations for each metre of the body
_DAMPING = 0.01
_AXES = ("x", "y", "z", "rx", "ry", "rz")


def with_bending(machine: Machine, body: str) -> Machine:
    """The machine with a coordinate in which a body bends, at the end; nothing pushes it yet."""
    number = machine.layout.bodies.index(body)
    name, mass = _named(body), np.zeros((6, 6))
    motion = np.zeros((6, len(machine.coordinates) + 1))
    motion[0, -1], mass[0, 0] = 1.0, machine.body_mass[6 * number, 6 * number]
    wider = widened(machine, (name,), np.zeros((len(machine.body_mass), 1)))
    return with_body(wider, name, machine.layout.centres[number], motion, mass)


def _stage(axle: Axle) -> str:
    return axle.stage


def _named(body: str) -> str:
    return f"{body}.bending"


@dataclass(frozen=True, eq=False)
class Bending:
    """The Part of a bending body, in a machine that has the coordinate for it.

    Args:
        machine: of ``with_bending``.
        body: its name.
        frequency: where that of the mode begins [Hz].
        read: sensors on the body, by site.
        hit: points on the body that are hit, by site.
    """

    machine: Machine
    body: str
    frequency: float
    read: tuple[str, ...]
    hit: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Frequency, damping, shape at sensors and hits, momentum, joints above."""
        name = _named(self.body)
        hits = (f"hammer({site})" for site in self.hit)
        points = [f"{site}_{axis}" for site in (*self.read, *hits) for axis in _AXES[:3]]
        frames = [f"{what}_{axis}" for what in ("momentum", *self.above) for axis in _AXES]
        return tuple(f"{name}_{what}" for what in ("frequency", "damping", *points, *frames))

    @property
    def above(self) -> dict[str, Axle]:
        """First axle of each joint that joins another stage to the body, by stage."""
        parents = parents_of(self.machine)
        first = {stage: next(axles) for stage, axles in groupby(self.machine.axles, _stage)}
        return {stage: axle for stage, axle in first.items() if parents[stage] == self.body}

    def part(self) -> AddedPart:
        """As a Part."""
        units = ["5 %", "50 %", *[f"{_SHAPE:g}"] * (len(self.names) - 2)]
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, units, strict=True)
        )
        return AddedPart(f"body:{self.body}", parameters, self.finite, self.derivatives)

    def at(self, theta: Real) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio."""
        frequency, damping = np.exp(theta[:2] * _STEPS).tolist()
        return self.frequency * frequency, _DAMPING * damping

    def begin(self, shape: Mapping[str, float]) -> dict[str, float]:
        """Parameters of a shape, by site and axis such as ``acc4_x``."""
        name = _named(self.body)
        return {f"{name}_{what}": value / _SHAPE for what, value in shape.items()}

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """The mode's own stiffness and damping, then what else moves with it."""
        frequency, zeta = self.at(theta)
        omega = 2 * np.pi * frequency
        core = np.array([omega**2, 2 * zeta * omega, 0.0]) * self._mass
        changes = [self._own(core[:, None, None])]
        for one in self._linear:
            changes.append(replace(one, core=np.tensordot(theta, one.core, 1)))
        return tuple(changes)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By every parameter."""
        frequency, zeta = self.at(theta)
        omega = 2 * np.pi * frequency
        core = np.zeros((len(theta), 3, 1, 1))
        core[0, :2, 0, 0] = _STEPS[0] * self._mass * np.array([2 * omega**2, 2 * zeta * omega])
        core[1, 1] = _STEPS[1] * self._mass * 2 * zeta * omega
        return (self._own(core), *self._linear)

    @cached_property
    def _place(self) -> int:
        """First row of the body that stands for the mode."""
        return 6 * self.machine.layout.bodies.index(_named(self.body))

    @property
    def _mass(self) -> float:
        return float(self.machine.body_mass[self._place, self._place])

    @cached_property
    def _along(self) -> Real:
        """The mode's own coordinate; (nv, 1)."""
        along = np.zeros((len(self.machine.coordinates), 1))
        along[self.machine.coordinates.index(_named(self.body))] = 1.0
        return along

    def _own(self, core: Real) -> Change:
        return Change("joint", self._along, self._along, core)

    @cached_property
    def _linear(self) -> tuple[Change, ...]:
        """Of each parameter but the first two, the change per unit."""
        count, size = len(self.names), len(self.machine.body_mass)
        number = self.machine.layout.bodies.index(self.body)
        mode = np.zeros((size, 1))
        mode[self._place] = 1.0
        place, found = 2, []
        for slot, sites in (("sensor", self.read), ("hammer", self.hit)):
            for site in sites:
                core = np.zeros((count, 3, 3, 1))
                core[place : place + 3, 0, :, 0] = _SHAPE * np.eye(3)
                found.append(Change(slot, np.eye(6, 3), mode, core, site))  # type: ignore[arg-type]
                place += 3
        frame = np.zeros((size, 6))
        frame[6 * number : 6 * number + 6] = np.eye(6)
        axles = self.above.values()
        for left in (frame, *(self.machine.reach(axle, axle.anchor) for axle in axles)):
            core = np.zeros((count, 3, 6, 1))
            core[place : place + 6, 0, :, 0] = _SHAPE * np.diag([1.0] * 3 + [1 / self.reach] * 3)
            found.append(Change("path", left, self._along, core))
            place += 6
        return tuple(found)

    @property
    def reach(self) -> float:
        """How far its sensors are from its centre [m]."""
        layout = self.machine.layout
        number = layout.bodies.index(self.body)
        arms = layout.positions[layout.body_of == number] - layout.centres[number]
        return float(np.sqrt((arms**2).sum(axis=1).mean())) if arms.any() else 1.0
