"""A machine with more coordinates, and with bodies that belong to no drawing."""

from dataclasses import replace

import numpy as np

from identification.words import Real
from mbmodel.linearisation.motors import Drive
from mbmodel.linearisation.springs import Spring
from mbmodel.machine import Machine


def widened(machine: Machine, names: tuple[str, ...], columns: Real) -> Machine:
    """The machine with further coordinates after its own; nothing holds them.

    Args:
        machine: as drawn.
        names: of the coordinates.
        columns: of T; (6 n_body, n).
    """
    more, nv = len(names), len(machine.coordinates)
    order = _padded(machine.order, more)
    order[:, nv:] = np.triu(np.ones((nv + more, more)), 1 - nv)
    return replace(
        machine,
        coordinates=(*machine.coordinates, *names),
        jacobian=np.column_stack([machine.jacobian, columns]),
        armature=_padded(machine.armature, more),
        remaining_stiffness=_padded(machine.remaining_stiffness, more),
        remaining_damping=_padded(machine.remaining_damping, more),
        order=order,
        springs=tuple(_wider(spring, more) for spring in machine.springs),
        motors={
            name: Drive(np.pad(drive.joint, (0, more)), drive.body)
            for name, drive in machine.motors.items()
        },
    )


def with_body(machine: Machine, name: str, centre: Real, motion: Real, mass: Real) -> Machine:
    """The machine with a body after its own, of which the drawing knows nothing.

    It has no weight, and no floor carries it.

    Args:
        machine: as drawn.
        name: of the body.
        centre: where it is [m]; (3,).
        motion: its rows of T; (6, nv).
        mass: its block of Mb; (6, 6).
    """
    layout = machine.layout
    total = np.pad(machine.body_mass, (0, 6))
    total[-6:, -6:] = mass
    return replace(
        machine,
        layout=replace(
            layout, bodies=(*layout.bodies, name), centres=np.vstack([layout.centres, centre])
        ),
        jacobian=np.vstack([machine.jacobian, motion]),
        body_mass=total,
        weighed=np.pad(machine.weighed, (0, 6)),
        springs=tuple(
            spring
            if spring.at_bodies is None
            else replace(spring, at_bodies=np.pad(spring.at_bodies, (0, 6)))
            for spring in machine.springs
        ),
        motors={
            name: Drive(drive.joint, np.pad(drive.body, (0, 6)))
            for name, drive in machine.motors.items()
        },
    )


def _padded(matrix: Real, more: int) -> Real:
    wider: Real = np.pad(matrix, ((0, more), (0, more)))
    return wider


def _wider(spring: Spring, more: int) -> Spring:
    geometric = None if spring.geometric is None else _padded(spring.geometric, more)
    return replace(spring, direction=np.pad(spring.direction, (0, more)), geometric=geometric)
