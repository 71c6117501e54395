"""A machine with additional coordinates, and with bodies that the drawing lacks."""

from dataclasses import replace

import numpy as np

from identification.words import Real
from mbmodel.linearisation.springs import Spring
from mbmodel.machine import Machine


def add_coordinates(machine: Machine, names: tuple[str, ...], columns: Real) -> Machine:
    """Return the machine with additional coordinates at the end, without any stiffness.

    Args:
        machine: as drawn.
        names: of the coordinates.
        columns: of T; (6 n_body, n).
    """
    count, nv = len(names), len(machine.coordinates)
    precedence = _pad_with_zeros(machine.precedence, count)
    precedence[:, nv:] = np.triu(np.ones((nv + count, count)), 1 - nv)
    return replace(
        machine,
        coordinates=(*machine.coordinates, *names),
        jacobian=np.column_stack([machine.jacobian, columns]),
        armature=_pad_with_zeros(machine.armature, count),
        remaining_stiffness=_pad_with_zeros(machine.remaining_stiffness, count),
        remaining_damping=_pad_with_zeros(machine.remaining_damping, count),
        precedence=precedence,
        curvature=_pad_curvature(machine.curvature, (0, count)),
        springs=tuple(_extend_spring(spring, count) for spring in machine.springs),
        motors={
            name: replace(drive, joint=np.pad(drive.joint, (0, count)))
            for name, drive in machine.motors.items()
        },
        sensors=machine.sensors.extend(coordinates=count),
    )


def add_body(machine: Machine, name: str, centre: Real, motion: Real, mass: Real) -> Machine:
    """Return the machine with an additional body at the end, which the drawing lacks.

    The body has no weight and does not move with the floor.

    Args:
        machine: as drawn.
        name: of the body.
        centre: its centre of mass [m]; (3,).
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
        weight_fraction=np.pad(machine.weight_fraction, (0, 6)),
        curvature=_pad_curvature(machine.curvature, (6, 0)),
        springs=tuple(
            spring
            if spring.at_bodies is None
            else replace(spring, at_bodies=np.pad(spring.at_bodies, (0, 6)))
            for spring in machine.springs
        ),
        motors={
            name: replace(drive, body=np.pad(drive.body, (0, 6)))
            for name, drive in machine.motors.items()
        },
        sensors=machine.sensors.extend(bodies=1),
    )


def _pad_with_zeros(matrix: Real, count: int) -> Real:
    """Return a square matrix with additional rows and columns of zeros."""
    return np.pad(matrix, ((0, count), (0, count)))


def _pad_curvature(curvature: Real | None, added: tuple[int, int]) -> Real | None:
    """Return the curvature of paths for more rows and coordinates, whose paths are straight."""
    rows, count = added
    return None if curvature is None else np.pad(curvature, ((0, rows), (0, count), (0, count)))


def _extend_spring(spring: Spring, count: int) -> Spring:
    """Return a spring for more coordinates, which it does not resist."""
    geometric = None if spring.geometric is None else _pad_with_zeros(spring.geometric, count)
    return replace(spring, direction=np.pad(spring.direction, (0, count)), geometric=geometric)
