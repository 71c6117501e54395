r"""The plant of a machine: FRFs between joints, points and pairs of points, as a controller has it.

A port is a row d of the coordinates: the motion d x of an output, and by virtual work the
generalised force d^T of a unit force at an input,

    G(s) = D_out N [N^T (K + s C + s^2 M + ...) N]^-1 N^T D_in^T.

Sensors and hammers have no part in it.
"""

from collections.abc import Sequence

import numpy as np

from truth.errors import TruthError
from truth.machine.dynamics import joint_rows, motion_row
from truth.machine.rig import Prepared, Rig, receptance
from truth.machine.station import Complex, Real


def joint_row(tested: Prepared, name: str) -> Real:
    """Return the row of a joint's coordinate, which a motor along the joint moves; (n,).

    Raises:
        TruthError: no stage has the joint.
    """
    for index, stage in enumerate(tested.station.stages):
        names = [joint.name for joint in stage.joints]
        if name in names:
            moving, _ = joint_rows(tested.station, index, tested.flexes)
            row: Real = moving[names.index(name)]
            return row
    raise TruthError(f"{name!r}: no stage has this joint")


def point_row(tested: Prepared, stage: str, position: Real, axis: int) -> Real:
    """Return the row of a point of a stage along a world axis; (n,).

    Args:
        tested: the machine.
        position: of the point, at rest, in world axes [m]; (3,).
        axis: 0, 1, 2 for x, y, z.
    """
    station = tested.station
    return motion_row(station, station.index(stage), position, np.eye(3)[axis], tested.flexes)


def plant_receptance(
    rig: Rig, outputs: Sequence[Real], inputs: Sequence[Real], freq_hz: Real
) -> Complex:
    """Return the motion of outputs per unit force of inputs; (n_freq, n_out, n_in).

    Args:
        rig: the machine's equations, with coordinates of effects behind those of the ports.
        outputs: rows; n_out.
        inputs: rows; n_in.
        freq_hz: frequencies above zero [Hz]; (n_freq,).
    """
    size = len(rig.equations.mass)
    rows, columns = (
        np.array([np.pad(row, (0, size - len(row))) for row in ports])
        for ports in (outputs, inputs)
    )
    return np.asarray(rows @ receptance(rig, freq_hz, columns.T))
