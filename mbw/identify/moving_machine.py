"""Motion of a machine's bodies in its measured modes, for pictures."""

import numpy as np

from identification.words import Complex, Dof
from mbmodel import MachineGeometry
from mbmodel.geometry.surfaces import TendonLine
from mbw.results.identified_files import IdentificationResult


def body_motion(result: IdentificationResult) -> Complex:
    """Return the motion of each centre of mass; (n_mode, 6 n_body).

    It is zero for a body that lacks a direction.
    """
    layout, summary = result.layout, result.summary
    motion = np.zeros((6 * len(layout.bodies), len(summary.modes)), complex)
    for label, shape in zip(summary.body_directions, result.arrays["body_shapes"], strict=True):
        dof = Dof.parse(label)
        if dof.point not in summary.undetermined_bodies:
            motion[6 * layout.bodies.index(dof.point) + dof.axis] = shape
    return motion.T


def sensor_spokes(result: IdentificationResult) -> MachineGeometry:
    """Return lines from each centre of mass to its sensors, for a machine without surfaces."""
    layout = result.layout
    channels = [layout.parse(label) for label in result.summary.outputs]
    points = list(dict.fromkeys(dof.point for dof in channels if dof.point in layout.points))
    lines = []
    for body, name in enumerate(layout.bodies):
        places = [
            layout.positions[layout.points.index(point)]
            for point in points
            if layout.body_name(point) == name
        ]
        path = [part for place in places for part in (layout.centres[body], place)]
        if path:
            lines.append(TendonLine(name, np.array(path), (name,) * len(path), None))
    return MachineGeometry((), tuple(lines), ())
