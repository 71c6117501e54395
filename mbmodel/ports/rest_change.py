"""The measured rest of a machine as a change of its equation of motion (``measured_rest``)."""

import numpy as np

from mbmodel.machine import Machine
from mbmodel.parts import Change
from mbmodel.ports.ports import find_ports

REST = "rest of the state before"  # owner of the change, for statements


def rest_changes(machine: Machine) -> tuple[Change, ...]:
    """Return F E L at the bodies; none for a machine without a measured rest.

    Args:
        machine: bodies that it has beyond those of the rest stand at the end of its rows.
    """
    rest = machine.rest
    if rest is None:
        return ()
    ports = find_ports(machine, rest.outputs, rest.inputs)
    force, readout = ports.force.copy(), ports.readout.copy()
    force[: len(rest.force_shift)] += rest.force_shift
    readout[:, : rest.readout_shift.shape[1]] += rest.readout_shift
    core = np.zeros((3, len(rest.inputs), len(rest.outputs)))
    core[0] = 1.0
    return (Change("body", force, readout.T, core, shape=rest.at, owner=REST),)
