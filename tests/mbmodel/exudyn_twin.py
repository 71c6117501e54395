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
    sites: dict[str, tuple[int, np.ndarray, np.ndarray]]

    def row(self, site: str, axis: int) -> np.ndarray:
        """Motion of a site along its axis per motion of all bodies: a.(v + theta x r)."""
        body, position, axes = self.sites[site]
        row = np.zeros(6 * len(self.bodies))
        row[6 * body : 6 * body + 3] = axes[:, axis]
        row[6 * body + 3 : 6 * body + 6] = np.cross(position - self.centres[body], axes[:, axis])
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


def _turn(element):
    """Rotation matrix of an element's quaternion, w x y z."""
    if element.get("quat") is None:
        return np.eye(3)
    w, x, y, z = _vector(element, "quat") / np.linalg.norm(_vector(element, "quat"))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _inertia(element, turn):
    """Inertia in world axes, in exudyn's order xx yy zz yz xz xy."""
    if element.get("fullinertia"):
        xx, yy, zz, xy, xz, yz = _vector(element, "fullinertia")
    else:
        (xx, yy, zz), xy, xz, yz = _vector(element, "diaginertia"), 0, 0, 0
    world = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    return [*np.diag(world), world[1, 2], world[0, 2], world[0, 1]]


def _springs(element, turn):
    """Place in the body, 6x6 stiffness and damping in world axes of six joints at one point."""
    joints = {joint.get("name")[-2:]: joint for joint in element.findall("joint")}
    (place,) = {joint.get("pos") for joint in joints.values()}
    axes = turn @ np.array([_vector(joints[f"t{way}"], "axis") for way in "xyz"]).T
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    for direction, joint in joints.items():
        axis = turn @ _vector(joint, "axis")
        assert np.allclose(axis, axes[:, "xyz".index(direction[1])], atol=1e-15)
        assert joint.get("type") == ("slide" if direction[0] == "t" else "hinge")
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = axes
    k, d = (
        both @ np.diag([float(joints[direction].get(what)) for direction in DIRECTIONS]) @ both.T
        for what in ("stiffness", "damping")
    )
    return np.array([float(word) for word in place.split()]), k, d


def exudyn_twin(path: Path) -> Twin:
    """Build and linearise a tree of bodies, each on six joints at one point."""
    system = exudyn.SystemContainer().AddSystem()
    ground = system.AddObject(ObjectGround())
    bodies, centres, sites = [], [], {}

    def add(element, parent, parent_centre, origin, turn):
        inertial = element.find("inertial")
        origin, turn = origin + turn @ _vector(element, "pos"), turn @ _turn(element)
        centre = origin + turn @ _vector(inertial, "pos")
        node = system.AddNode(NodeRigidBodyRxyz(referenceCoordinates=[*centre, 0, 0, 0]))
        body = system.AddObject(
            ObjectRigidBody(
                mass=float(inertial.get("mass")), inertia=_inertia(inertial, turn), nodeNumber=node
            )
        )
        place, k, d = _springs(element, turn)
        place = origin + turn @ place
        ends = [
            system.AddMarker(MarkerBodyRigid(bodyNumber=owner, localPosition=place - middle))
            for owner, middle in ((parent, parent_centre), (body, centre))
        ]
        system.AddObject(
            ObjectConnectorRigidBodySpringDamper(markerNumbers=ends, stiffness=k, damping=d)
        )
        bodies.append(element.get("name"))
        centres.append(centre)
        for site in element.findall("site"):
            position = origin + turn @ _vector(site, "pos")
            sites[site.get("name")] = (len(bodies) - 1, position, turn @ _turn(site))
        for child in element.findall("body"):
            add(child, body, centre, origin, turn)

    for element in ElementTree.parse(path).getroot().find("worldbody").findall("body"):
        add(element, ground, np.zeros(3), np.zeros(3), np.eye(3))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    # D comes from one-sided differences at rest, where the force is exactly zero: a tiny step has
    # no rounding error to fear and leaves no truncation (1e-7, the default, leaves 1e-9).
    settings.staticSolver.newton.numericalDifferentiation.relativeEpsilon = 1e-14
    M, K, D = ComputeLinearizedSystem(system, simulationSettings=settings)
    return Twin(M, K, D, tuple(bodies), np.array(centres), sites)
