"""The hexapod of ``closed_machines`` once more, in exudyn: rigid bodies and ideal joints.

Bodies have absolute coordinates. Feet, struts and heads are exudyn's own constraints, whose null
space exudyn finds. Nothing of ours is used but the places of the legs' ends.
"""

import exudyn
import numpy as np
from closed_machines import platform_points
from exudyn.itemInterface import (
    MarkerBodyRigid,
    NodeRigidBodyRxyz,
    ObjectConnectorRigidBodySpringDamper,
    ObjectGround,
    ObjectJointGeneric,
    ObjectRigidBody,
)
from exudyn.solver import ComputeODE2Eigenvalues


def exudyn_hexapod_hz(
    *, leg_mass: float = 0.5, stiffness: float = 2e7, foot_stiffness: float = 40.0
) -> np.ndarray:
    """Return the natural frequencies of the hexapod without gravity [Hz]; (6,)."""
    system = exudyn.SystemContainer().AddSystem()
    ground = system.AddObject(ObjectGround())

    def add_body(mass, inertia, centre):
        node = system.AddNode(NodeRigidBodyRxyz(referenceCoordinates=[*centre, 0, 0, 0]))
        entries = [*np.diag(inertia), inertia[1, 2], inertia[0, 2], inertia[0, 1]]
        body = ObjectRigidBody(mass=mass, inertia=entries, nodeNumber=node)
        return system.AddObject(body), np.asarray(centre)

    def join(first, second, place, axes, constrained, springs):
        ends = [
            system.AddMarker(
                MarkerBodyRigid(
                    bodyNumber=body, localHT=exudyn.HT(rotation=axes, translation=place - centre)
                )
            )
            for body, centre in (first, second)
        ]
        system.AddObject(ObjectJointGeneric(markerNumbers=ends, constrainedAxes=constrained))
        if any(springs):
            system.AddObject(
                ObjectConnectorRigidBodySpringDamper(
                    markerNumbers=ends, stiffness=np.diag(springs), damping=np.zeros((6, 6))
                )
            )

    world = ground, np.zeros(3)
    platform = add_body(15, np.diag([0.12, 0.13, 0.2]), [0, 0, 0.2])
    for low, high in zip(*platform_points(), strict=True):
        length = float(np.linalg.norm(high - low))
        z = (high - low) / length
        x = np.cross([0.0, 1.0, 0.0], z) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], z))
        axes = np.column_stack([x, np.cross(z, x), z])
        inertia = axes @ np.diag([0.002, 0.002, 0.0002]) @ axes.T * leg_mass
        lower = add_body(leg_mass, inertia, low + length / 4 * z)
        upper = add_body(leg_mass, inertia, low + 3 * length / 4 * z)
        join(
            world,
            lower,
            low,
            axes,
            [1, 1, 1, 0, 0, 1],
            [0, 0, 0, foot_stiffness, foot_stiffness, 0],
        )
        join(
            lower, upper, low + length / 2 * z, axes, [1, 1, 0, 1, 1, 1], [0, 0, stiffness, 0, 0, 0]
        )
        join(upper, platform, high, axes, [1, 1, 1, 0, 0, 0], [0] * 6)
    system.Assemble()
    values = ComputeODE2Eigenvalues(system, exudyn.SimulationSettings())[0]
    return np.sqrt(np.sort(values)) / (2 * np.pi)
