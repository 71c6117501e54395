"""Outputs of the machine in time: which probes are needed, and how readings follow from them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Real, Signal
from mbmodel.machine import Machine
from mbmodel.ports.signal_rows import point_rows
from mbmodel.simulation.drives import JointDof, Reading, SensorValue
from mbmodel.simulation.time_model import PROBE_CHANNELS, Probe


@dataclass(frozen=True, eq=False)
class Readings:
    """Probes and encoders that some outputs need, and the outputs per channel.

    Args:
        probes: a probe for each point or body.
        encoders: names of joints.
        sensors: numbers of MuJoCo sensors.
        readout: outputs per channel of the integration; (n_out, n_channel).
    """

    probes: tuple[Probe, ...]
    encoders: tuple[str, ...]
    sensors: tuple[SensorValue, ...]
    readout: Real

    @property
    def world_axes(self) -> Real:
        """Reading of each output per translation of the whole machine; (n_out, 3)."""
        probes = self.readout[:, : PROBE_CHANNELS * len(self.probes)]
        return probes.reshape(len(self.readout), len(self.probes), PROBE_CHANNELS)[..., :3].sum(
            axis=1
        )


def find_readings(machine: Machine, outputs: Sequence[Reading]) -> Readings:
    """Return what some outputs need.

    Args:
        machine: with its layout.
        outputs: points, bodies (centres of mass, world axes), joints or MuJoCo sensors.

    Raises:
        UsageError: the machine has no such point or body.
    """
    layout = machine.layout
    rows = [
        point_rows(layout, dof).reshape(-1, PROBE_CHANNELS) if isinstance(dof, Signal) else None
        for dof in outputs
    ]
    moving = [
        layout.bodies[k] for row in rows if row is not None for k in np.flatnonzero(row.any(1))
    ]
    drawn = [dof.point for dof in outputs if isinstance(dof, Dof)]
    points = list(dict.fromkeys([*drawn, *moving]))
    joints = list(dict.fromkeys(dof.joint for dof in outputs if isinstance(dof, JointDof)))
    sensors = list(dict.fromkeys(dof for dof in outputs if isinstance(dof, SensorValue)))
    probes = tuple(Probe(layout.body_name(point), _place(machine, point)) for point in points)
    first_joint = PROBE_CHANNELS * len(points)
    first_sensor = first_joint + len(joints)
    readout = np.zeros((len(outputs), first_sensor + len(sensors)))
    for row, dof, of_bodies in zip(readout, outputs, rows, strict=True):
        if of_bodies is not None:
            for number in np.flatnonzero(of_bodies.any(axis=1)):
                start = PROBE_CHANNELS * points.index(layout.bodies[number])
                row[start : start + PROBE_CHANNELS] += of_bodies[number]
        elif isinstance(dof, JointDof):
            row[first_joint + joints.index(dof.joint)] = 1.0
        elif isinstance(dof, SensorValue):
            row[first_sensor + sensors.index(dof)] = 1.0
        elif isinstance(dof, Dof):
            start = PROBE_CHANNELS * points.index(dof.point) + 3 * dof.is_rotation
            row[start : start + 3] = dof.sign * _axes(machine, dof.point)[:, dof.axis % 3]
    return Readings(probes, tuple(joints), tuple(sensors), readout)


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
    return layout.axes[layout.points.index(point)] if point in layout.points else np.eye(3)
