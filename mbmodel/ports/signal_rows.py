"""Rows of signals: what a motor, joint, MuJoCo sensor, pair or offset point means in the machine.

A label ``<point>:<direction>`` is a row of the layout. A signal is one of

    ty_drive            a motor's control                              input
    encoder, imu.2      a number of a MuJoCo sensor                    output
    joint:ty_tx         position of a slide or hinge; force along it   output, input
    coil-magnet:+tx     motion of coil minus that of magnet along an   output, input
                        axis of coil; force on coil, its opposite on
                        magnet
    ty@0,0,0.2:+tx      point at an offset from a body's centre of     output, input
                        mass, in metres and world axes
"""

import numpy as np

from identification.words import (
    JOINT_PREFIX,
    Dof,
    Layout,
    Port,
    Real,
    Signal,
    UsageError,
    settle_port,
    shorten_names,
)
from identification.words.ports import FLOOR, OFFSET_MARK, PAIR_MARK
from mbmodel.linearisation.sensors import SensorReading
from mbmodel.machine import Axle, Machine
from mbmodel.spatial import cross_matrix


def is_floor(machine: Machine, port: Port) -> bool:
    """Return whether a label means the floor: no body and no point has the name ``floor``."""
    layout = machine.layout
    return port.point == FLOOR and FLOOR not in layout.points + layout.bodies


def point_rows(layout: Layout, port: Port) -> Real:
    """Return the motion at a label, pair or offset point per motion of the bodies; (6 n_body,).

    Transposed, it is the force at the bodies per unit force there; a pair's opposite force acts on
    its second point.

    Args:
        layout: of the machine.
        port: a direction at a point, a pair or an offset point.

    Raises:
        UsageError: the machine does not have one of the points, or a malformed offset.
    """
    names = (*layout.points, *layout.bodies)
    port = settle_port(port, names)
    if isinstance(port, Dof):
        return layout.rows([port])[0]
    if OFFSET_MARK in port.place and (body := port.place.rpartition(OFFSET_MARK)[0]) in names:
        return _offset_row(layout, body, port)
    for first, second in _split_pair(port.place):
        if first in names and second in names:
            return _pair_row(layout, first, second, port)
    raise UsageError(
        f"{port.name!r} is neither a point, a pair of two points nor a body with an offset: there "
        f"are the points {shorten_names(layout.points)} and the bodies "
        f"{shorten_names(layout.bodies)}"
    )


def _split_pair(place: str) -> list[tuple[str, str]]:
    """Return all ways to split a name at a mark of pairs: names may hold the mark themselves."""
    parts = place.split(PAIR_MARK)
    return [(PAIR_MARK.join(parts[:k]), PAIR_MARK.join(parts[k:])) for k in range(1, len(parts))]


def _pair_row(layout: Layout, first: str, second: str, port: Signal) -> Real:
    """Return the row of the first point minus that of the second, along an axis of the first."""
    row = layout.rows([Dof(first, port.direction)])[0]
    axes = layout.axes[layout.points.index(first)] if first in layout.points else np.eye(3)
    along = port.sign * axes[:, port.axis % 3]
    second_rows = layout.rows([Dof.of(second, axis + 3 * port.is_rotation) for axis in range(3)])
    second_axes = layout.axes[layout.points.index(second)] if second in layout.points else np.eye(3)
    return row - (second_axes @ second_rows).T @ along


def _offset_row(layout: Layout, body: str, port: Signal) -> Real:
    """Return the row of a point at an offset from a body's centre of mass, in world axes."""
    if body not in layout.bodies:
        raise UsageError(f"{port.name!r}: {body!r} is a site: give an offset from a body")
    text = port.place.rpartition(OFFSET_MARK)[2]
    try:
        offset = np.array([float(number) for number in text.split(",")])
    except ValueError:
        offset = np.zeros(0)
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise UsageError(
            f"{port.name!r}: {text!r} is no offset: write three numbers in metres, such as "
            f"{body}{OFFSET_MARK}0,0,0.2:+tx"
        )
    rows = layout.rows([Dof.of(body, axis) for axis in range(6)])
    if port.is_rotation:
        return np.asarray(port.sign * rows[port.axis])
    moved = rows[:3] - cross_matrix(offset) @ rows[3:]
    return np.asarray(port.sign * moved[port.axis])


def find_axle(machine: Machine, signal: Signal) -> Axle:
    """Return the slide or hinge that a label ``joint:<name>`` names.

    Raises:
        UsageError: the machine does not have it.
    """
    name = signal.name.removeprefix(JOINT_PREFIX)
    for axle in machine.axles:
        if axle.joint == name:
            return axle
    joints = [axle.joint for axle in machine.axles]
    raise UsageError(
        f"{signal.name!r}: {machine.source} has no slide or hinge of this name: choose one of "
        f"{shorten_names(joints)}"
    )


def find_sensor(machine: Machine, signal: Signal) -> SensorReading:
    """Return the reading of a MuJoCo sensor.

    Raises:
        UsageError: the machine does not have it, or it has no linear model.
    """
    sensors, name = machine.sensors, signal.name
    if name in sensors.readings:
        return sensors.readings[name]
    if name in sensors.refused:
        raise UsageError(f"sensor {name!r} of {machine.source}: {sensors.refused[name]}")
    refuse_point_without_direction(machine, name)
    if name in machine.motors:
        raise UsageError(
            f"{name!r} is a motor of the model, and no sensor: as an output name a sensor, or a "
            f"joint as {JOINT_PREFIX}<name>"
        )
    names = shorten_names([*sensors.readings]) if sensors.readings else "none"
    raise UsageError(
        f"{name!r} is no sensor of the model (there are {names}): name one, or write a label "
        f"<point>:<sign><direction> or {JOINT_PREFIX}<name>"
    )


def refuse_point_without_direction(machine: Machine, name: str) -> None:
    """Raise UsageError for a name that is no signal, but that of a point or body."""
    if name in (*machine.layout.points, *machine.layout.bodies):
        raise UsageError(
            f"{name!r} is not a label, since its direction is missing: write {name}:+tx"
        )


def turns(machine: Machine, port: Port) -> bool:
    """Return whether a label, pair, offset point or joint is a rotation or torque."""
    if isinstance(port, Signal) and port.is_joint:
        return find_axle(machine, port).turns
    return port.is_rotation
