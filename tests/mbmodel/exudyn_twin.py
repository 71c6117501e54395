"""The station once more, built in exudyn straight from the MJCF's text.

Rigid bodies in absolute coordinates, joined by RigidBodySpringDamper connectors; nothing of ours
is used, not even for the sensor rows. Rotations are Tait-Bryan angles (RotationRxyz): at zero they
are the components of the small rotation vector, and their rates the angular velocity, so that M, K
and D are those of translations and small rotations in world axes.
"""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import exudyn
import numpy as np
from exudyn.itemInterface import (
    MarkerBodyRigid,
    NodeRigidBodyRxyz,
    ObjectConnectorRigidBodySpringDamper,
    ObjectGround,
    ObjectRigidBody,
)
from exudyn.solver import ComputeLinearizedSystem

DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class Twin:
    """M, K, D of exudyn in absolute coordinates, and where the sites are."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    bodies: tuple[str, ...]
    centres: np.ndarray
    sites: dict[str, tuple[int, np.ndarray]]

    def row(self, site: str, axis: int) -> np.ndarray:
        """Motion of a site along a world axis per motion of all bodies: v + theta x r."""
        body, position = self.sites[site]
        x, y, z = position - self.centres[body]
        row = np.zeros(6 * len(self.bodies))
        row[6 * body : 6 * body + 3] = np.eye(3)[axis]
        row[6 * body + 3 : 6 * body + 6] = [[0, z, -y], [-z, 0, x], [y, -x, 0]][axis]
        return row

    def accelerance(self, freq_hz, outputs, inputs):
        """H(w) = -w^2 L (K - w^2 M + i w D)^-1 P at (site, axis) pairs; (freq, out, in)."""
        rows = np.array([self.row(*pair) for pair in outputs])
        drive = np.array([self.row(*pair) for pair in inputs]).T
        omega = 2 * np.pi * np.asarray(freq_hz)[:, None, None]
        impedance = self.stiffness - omega**2 * self.mass + 1j * omega * self.damping
        return -(omega**2) * (rows @ np.linalg.solve(impedance, drive))


def _vector(element, name):
    return np.array([float(word) for word in element.get(name, "0 0 0").split()])


def _inertia(element):
    if element.get("fullinertia"):
        xx, yy, zz, xy, xz, yz = _vector(element, "fullinertia")
        return [xx, yy, zz, yz, xz, xy]
    return [*_vector(element, "diaginertia"), 0.0, 0.0, 0.0]


def _springs(element):
    """Place and 6x6 stiffness and damping of a stage's joints: six, through one point."""
    joints = {joint.get("name")[-2:]: joint for joint in element.findall("joint")}
    (place,) = {joint.get("pos") for joint in joints.values()}
    for direction, joint in joints.items():
        axis = "xyz".index(direction[1])
        assert np.array_equal(_vector(joint, "axis"), np.eye(3)[axis])
        assert joint.get("type") == ("slide" if direction[0] == "t" else "hinge")
    k, d = (
        np.diag([float(joints[direction].get(what)) for direction in DIRECTIONS])
        for what in ("stiffness", "damping")
    )
    return np.array([float(word) for word in place.split()]), k, d


def exudyn_twin(path: Path) -> Twin:
    """Build and linearise a station: bodies at the origin, unturned, each on six joints."""
    system = exudyn.SystemContainer().AddSystem()
    ground = system.AddObject(ObjectGround())
    bodies, centres, sites = [], [], {}

    def add(element, parent, parent_centre):
        inertial = element.find("inertial")
        assert element.get("pos") is None
        assert element.get("quat") is None
        centre = _vector(inertial, "pos")
        node = system.AddNode(NodeRigidBodyRxyz(referenceCoordinates=[*centre, 0, 0, 0]))
        body = system.AddObject(
            ObjectRigidBody(
                mass=float(inertial.get("mass")), inertia=_inertia(inertial), nodeNumber=node
            )
        )
        place, k, d = _springs(element)
        ends = [
            system.AddMarker(MarkerBodyRigid(bodyNumber=owner, localPosition=place - origin))
            for owner, origin in ((parent, parent_centre), (body, centre))
        ]
        system.AddObject(
            ObjectConnectorRigidBodySpringDamper(markerNumbers=ends, stiffness=k, damping=d)
        )
        bodies.append(element.get("name"))
        centres.append(centre)
        for site in element.findall("site"):
            sites[site.get("name")] = (len(bodies) - 1, _vector(site, "pos"))
        for child in element.findall("body"):
            add(child, body, centre)

    for element in ElementTree.parse(path).getroot().find("worldbody").findall("body"):
        add(element, ground, np.zeros(3))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    # D comes from one-sided differences at rest, where the force is exactly zero: a tiny step has
    # no rounding error to fear and leaves no truncation (1e-7, the default, leaves 1e-9).
    settings.staticSolver.newton.numericalDifferentiation.relativeEpsilon = 1e-14
    M, K, D = ComputeLinearizedSystem(system, simulationSettings=settings)
    return Twin(M, K, D, tuple(bodies), np.array(centres), sites)
