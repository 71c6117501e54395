"""A body that bends: one mode beside its rigid motion.

With the coordinate b of the mode, the modal mass equal to the body's mass m, its points move by

    u(p) = rigid motion + shape(p) b,    m (b'' + 2 zeta w0 b' + w0^2 b) = modal force.

The rigid motion is that of the joint below. The shape is not known, so all its effects are
parameters. They are its value along each channel and each direction hit, and the motion of the
joints above (six numbers each, for all that stands on them). Further parameters are the rigid
motion d with the momentum of the bending body. With T_b the column of b in the kinematics,

    T_b = d on the body, transport(joint) gamma above,    L += shape' b,    P' += shape' at the hit,

shape' = shape minus d at the point. Forces follow by T' and P': where a hit has the shape that a
sensor there reads, the response is reciprocal. A hit has its own parameter, whatever a sensor
beside it reads. w0 is the frequency at constant momentum of the body, as of the free body.

The coordinate b moves an additional body of mass m along x alone, after all others. This is
component mode synthesis (Craig and Kurdila 2006, ch. 17) with one mode, whose shape is fitted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from identification.words import Real
from mbmodel.compliance.extended_machine import add_body, add_coordinates
from mbmodel.machine import Axle, Machine, parent_bodies
from mbmodel.parts import AddedPart, Change, Parameter

_LOG_STEPS = 0.05, 0.5  # change of ln(frequency) and ln(damping) per unit of their parameters
_SHAPE_UNIT = 0.1  # of a shape's value per unit of its parameter; rotations times the body's radius
_START_DAMPING_RATIO = 0.01  # of the mode where its damping parameter is zero
_FRAME_AXES = ("x", "y", "z", "rx", "ry", "rz")


def add_bending_mode(machine: Machine, body: str) -> Machine:
    """Return the machine with a coordinate in which a body bends, after all others.

    No force acts on the coordinate until a Part of ``BendingMode`` is added.

    Args:
        machine: as drawn, or with further modes.
    """
    number = machine.layout.bodies.index(body)
    name, mass = _mode_name(body), np.zeros((6, 6))
    motion = np.zeros((6, len(machine.coordinates) + 1))
    motion[0, -1], mass[0, 0] = 1.0, machine.body_mass[6 * number, 6 * number]
    extended = add_coordinates(machine, (name,), np.zeros((len(machine.body_mass), 1)))
    bent = add_body(extended, name, machine.layout.centres[number], motion, mass)
    variants = {key: add_bending_mode(variant, body) for key, variant in machine.variants.items()}
    return replace(bent, variants=variants)


def has_bending_mode(machine: Machine, body: str) -> bool:
    """Return whether a machine has a coordinate in which a body bends."""
    return _mode_name(body) in machine.layout.bodies


def _stage_of(axle: Axle) -> str:
    """Return the stage of an axle, as a key to group by."""
    return axle.stage


def _mode_name(body: str) -> str:
    """Return the name of the coordinate, and of the body that it moves."""
    return f"{body}.bending"


@dataclass(frozen=True, eq=False)
class BendingMode:
    """The bending mode of a body, in a machine that has the coordinate for it.

    Args:
        machine: returned by ``add_bending_mode``.
        body: its name.
        frequency: of the mode where its parameter is zero [Hz].
        sensors: sites of the sensors on the body.
        hit_points: sites on the body that are hit.
    """

    machine: Machine
    body: str
    frequency: float
    sensors: tuple[str, ...]
    hit_points: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of parameters: frequency, damping, shape at points, momentum, joints above."""
        name = _mode_name(self.body)
        hits = (f"hammer({site})" for site in self.hit_points)
        points = [f"{site}_{axis}" for site in (*self.sensors, *hits) for axis in _FRAME_AXES[:3]]
        frames = [
            f"{what}_{axis}" for what in ("momentum", *self.joints_above) for axis in _FRAME_AXES
        ]
        return tuple(f"{name}_{what}" for what in ("frequency", "damping", *points, *frames))

    @property
    def joints_above(self) -> dict[str, Axle]:
        """First axle of each joint that connects a stage above to the body, by that stage."""
        parents = parent_bodies(self.machine)
        first = {stage: next(axles) for stage, axles in groupby(self.machine.axles, _stage_of)}
        return {
            stage: axle
            for stage, axle in first.items()
            if parents[stage] == self.body and axle.chain_row is None
        }

    def part(self) -> AddedPart:
        """Return the mode as a Part."""
        units = ["5 %", "50 %", *[f"{_SHAPE_UNIT:g}"] * (len(self.names) - 2)]
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, units, strict=True)
        )
        return AddedPart(f"body:{self.body}", parameters, self.finite, self.derivatives)

    def frequency_and_damping(self, theta: Real) -> tuple[float, float]:
        """Return frequency [Hz] and damping ratio at theta."""
        frequency, damping = np.exp(theta[:2] * _LOG_STEPS).tolist()
        return self.frequency * frequency, _START_DAMPING_RATIO * damping

    def start_values(self, shape: Mapping[str, float]) -> dict[str, float]:
        """Return parameters for a shape.

        Args:
            shape: values by site and axis, such as ``acc4_x``.

        Returns:
            Values by the name of the parameter.
        """
        name = _mode_name(self.body)
        return {f"{name}_{what}": value / _SHAPE_UNIT for what, value in shape.items()}

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Return the change at theta: the mode's stiffness and damping, then what moves with it."""
        frequency, zeta = self.frequency_and_damping(theta)
        omega = 2 * np.pi * frequency
        core = np.array([omega**2, 2 * zeta * omega, 0.0]) * self._mass
        changes = [self._oscillator_change(core[:, None, None])]
        for change in self._linear:
            changes.append(replace(change, core=np.tensordot(theta, change.core, 1)))
        return tuple(changes)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """Return the derivatives of the change by every parameter."""
        frequency, zeta = self.frequency_and_damping(theta)
        omega = 2 * np.pi * frequency
        core = np.zeros((len(theta), 3, 1, 1))
        core[0, :2, 0, 0] = _LOG_STEPS[0] * self._mass * np.array([2 * omega**2, 2 * zeta * omega])
        core[1, 1] = _LOG_STEPS[1] * self._mass * 2 * zeta * omega
        return (self._oscillator_change(core), *self._linear)

    @cached_property
    def _mode_row(self) -> int:
        """First row of the body that stands for the mode."""
        return 6 * self.machine.layout.bodies.index(_mode_name(self.body))

    @property
    def _mass(self) -> float:
        """Mass of the body, which is the modal mass [kg]."""
        return float(self.machine.body_mass[self._mode_row, self._mode_row])

    @cached_property
    def _mode_coordinate(self) -> Real:
        """Unit vector of the mode's coordinate; (nv, 1)."""
        column = np.zeros((len(self.machine.coordinates), 1))
        column[self.machine.coordinates.index(_mode_name(self.body))] = 1.0
        return column

    def _oscillator_change(self, core: Real) -> Change:
        """Return the change of the mode's own oscillator."""
        return Change("joint", self._mode_coordinate, self._mode_coordinate, core)

    @cached_property
    def _linear(self) -> tuple[Change, ...]:
        """Changes per unit of each parameter; those of frequency and damping are zero."""
        count, size = len(self.names), len(self.machine.body_mass)
        number = self.machine.layout.bodies.index(self.body)
        mode = np.zeros((size, 1))
        mode[self._mode_row] = 1.0
        start, changes = 2, []
        for slot, sites in (("sensor", self.sensors), ("hammer", self.hit_points)):
            for site in sites:
                core = np.zeros((count, 3, 3, 1))
                core[start : start + 3, 0, :, 0] = _SHAPE_UNIT * np.eye(3)
                changes.append(Change(slot, np.eye(6, 3), mode, core, site))  # type: ignore[arg-type]
                start += 3
        frame = np.zeros((size, 6))
        frame[6 * number : 6 * number + 6] = np.eye(6)
        axles = self.joints_above.values()
        for left in (frame, *(self.machine.motion_per_twist(axle, axle.anchor) for axle in axles)):
            core = np.zeros((count, 3, 6, 1))
            core[start : start + 6, 0, :, 0] = _SHAPE_UNIT * np.diag(
                [1.0] * 3 + [1 / self.shape_radius] * 3
            )
            changes.append(Change("path", left, self._mode_coordinate, core))
            start += 6
        return tuple(changes)

    @property
    def shape_radius(self) -> float:
        """Root mean square distance of the body's sensors from its centre [m]; 1 if it has none."""
        layout = self.machine.layout
        number = layout.bodies.index(self.body)
        arms = layout.positions[layout.body_of == number] - layout.centres[number]
        return float(np.sqrt((arms**2).sum(axis=1).mean())) if arms.any() else 1.0
