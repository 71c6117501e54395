"""Outputs of the machine in time: which probes are needed, and how readings follow from them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Real
from mbmodel.machine import Machine
from mbmodel.simulation.drives import JointDof
from mbmodel.simulation.time_model import PROBE_CHANNELS, Probe


@dataclass(frozen=True, eq=False)
class Readings:
    """Probes and encoders that some outputs need, and the outputs per channel.

    Args:
        probes: a probe for each point or body.
        encoders: names of joints.
        readout: outputs per channel of the integration; (n_out, n_channel).
    """

    probes: tuple[Probe, ...]
    encoders: tuple[str, ...]
    readout: Real


def find_readings(machine: Machine, outputs: Sequence[Dof | JointDof]) -> Readings:
    """Return what some outputs need.

    Args:
        machine: with its layout.
        outputs: points, bodies (centres of mass, world axes) or joints.

    Raises:
        UsageError: the machine has no such point or body.
    """
    layout = machine.layout
    points = list(dict.fromkeys(dof.point for dof in outputs if isinstance(dof, Dof)))
    joints = list(dict.fromkeys(dof.joint for dof in outputs if isinstance(dof, JointDof)))
    probes = tuple(Probe(layout.body_name(point), _place(machine, point)) for point in points)
    readout = np.zeros((len(outputs), PROBE_CHANNELS * len(points) + len(joints)))
    for row, dof in zip(readout, outputs, strict=True):
        if isinstance(dof, JointDof):
            row[PROBE_CHANNELS * len(points) + joints.index(dof.joint)] = 1.0
        else:
            start = PROBE_CHANNELS * points.index(dof.point) + 3 * dof.is_rotation
            row[start : start + 3] = dof.sign * _axes(machine, dof.point)[:, dof.axis % 3]
    return Readings(probes, tuple(joints), readout)


def _place(machine: Machine, point: str) -> Real:
    """Return the place of a point or of a body's centre of mass [m]; (3,)."""
    layout = machine.layout
    if point in layout.points:
        place: Real = layout.positions[layout.points.index(point)]
    else:
        place = layout.centres[layout.bodies.index(point)]
    return place


def _axes(machine: Machine, point: str) -> Real:
    """Return the axes of a point in columns; world axes for a body; (3, 3)."""
    layout = machine.layout
    axes: Real = layout.axes[layout.points.index(point)] if point in layout.points else np.eye(3)
    return axes
