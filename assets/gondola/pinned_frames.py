"""Three frames of the gondola: the panels of the outer one, two rigid ones inside, joined by pins.

The seed document models the outer frame alone and asks for this as a next step: "flexible
connections between the frames using pin connections", which leave one rotation free. A pin is a
spring in all three directions at one point; two on one axis are a hinge about it. A drive holds the
angle by a spring beside the axis, so that a frame turns at some hertz and not at zero.

The document gives 800 kg for the gondola and 250 kg for the outer frame. Sizes, the shares of the
inner frames and all stiffnesses are chosen. Inner frames are rigid: they are smaller than the outer
one and closed.
"""

from dataclasses import dataclass

import numpy as np
from panels import Panels

PITCH_AXIS = 0.8, 1.2  # m: x and z of the pins between outer and middle frame, along y
PIN_STIFFNESS = 2e7  # N/m, of one pin with its insert in the honeycomb, in each direction
DRIVE_HZ = 3.0  # at which a frame turns on its drive, were the frame outside it at rest
DRIVE_ARM = 0.2  # m: of the drive's spring from the axis


@dataclass(frozen=True)
class RigidFrame:
    """A rigid frame as eight masses at the corners of a box around the pins' axes.

    Args:
        mass: [kg].
        half: half of its length, width and height [m].
    """

    mass: float
    half: tuple[float, float, float]

    @property
    def corners(self) -> np.ndarray:
        """The masses' places [m]; (8, 3)."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        return np.array([PITCH_AXIS[0], 0.0, PITCH_AXIS[1]]) + signs * np.array(self.half)

    def turning_inertia(self, axis: int) -> float:
        """The inertia about an axis through its middle [kg m2]."""
        return self.mass * (sum(size**2 for size in self.half) - self.half[axis] ** 2)


@dataclass(frozen=True)
class Spring:
    """Springs between a point of one frame and the same point of another.

    Args:
        inside: number of the inner one of both frames, from 1; the other one is the next outer.
        place: [m].
        stiffness: along x, y, z [N/m].
    """

    inside: int
    place: tuple[float, float, float]
    stiffness: tuple[float, float, float]


MIDDLE = RigidFrame(136.0, (0.4, 0.65, 0.2))
INNER = RigidFrame(400.0, (0.3, 0.45, 0.4))


def springs(
    frames: tuple[RigidFrame, ...] = (MIDDLE, INNER), pin: float = PIN_STIFFNESS
) -> list[Spring]:
    """Pins and drives: the middle frame pitches about y in the outer, the inner rolls about x."""
    x, z = PITCH_AXIS
    all_ways = (pin, pin, pin)
    middle, inner = frames
    turning = middle.turning_inertia(1) + inner.turning_inertia(1), inner.turning_inertia(0)
    drives = [(2 * np.pi * DRIVE_HZ / DRIVE_ARM) ** 2 * inertia for inertia in turning]
    return [
        Spring(1, (x, -0.8, z), all_ways),
        Spring(1, (x, 0.8, z), all_ways),
        Spring(1, (x + DRIVE_ARM, 0.8, z), (0.0, 0.0, drives[0])),
        Spring(2, (x - 0.4, 0.0, z), all_ways),
        Spring(2, (x + 0.4, 0.0, z), all_ways),
        Spring(2, (x + 0.4, DRIVE_ARM, z), (0.0, 0.0, drives[1])),
    ]


def deck(panels: Panels, frames: tuple[RigidFrame, ...], joints: list[Spring]) -> list[str]:
    """Lines of a CalculiX deck: rigid bodies with masses, and springs between frames."""
    lines: list[str] = []
    node, element = len(panels.points), len(panels.elements)
    members: list[list[int]] = [[] for _ in frames]

    def new_node(place: np.ndarray | tuple[float, float, float]) -> int:
        nonlocal node
        node += 1
        lines.extend(["*NODE", f"{node}, " + ", ".join(f"{x:.9g}" for x in place)])
        return node

    for number, frame in enumerate(frames):
        for corner in frame.corners:
            element += 1
            members[number].append(new_node(corner))
            lines += [f"*ELEMENT, TYPE=MASS, ELSET=C{element}", f"{element}, {node}"]
            lines += [f"*MASS, ELSET=C{element}", f"{frame.mass / 8:.9e}"]
    for joint in joints:
        inside = new_node(joint.place)
        members[joint.inside - 1].append(inside)
        if joint.inside == 1:
            outside = int(np.linalg.norm(panels.points - joint.place, axis=1).argmin()) + 1
        else:
            outside = new_node(joint.place)
            members[joint.inside - 2].append(outside)
        for axis, stiffness in enumerate(joint.stiffness, start=1):
            if stiffness:
                element += 1
                lines += [f"*ELEMENT, TYPE=SPRING2, ELSET=S{element}"]
                lines += [f"{element}, {inside}, {outside}"]
                lines += [f"*SPRING, ELSET=S{element}", f"{axis}, {axis}", f"{stiffness:.9e}"]
    for number, (frame, nodes) in enumerate(zip(frames, members, strict=True)):
        middle = frame.corners.mean(axis=0)
        reference, turning = new_node(middle), new_node(middle)
        lines += [f"*NSET, NSET=R{number}", *(f"{node}," for node in nodes)]
        lines.append(f"*RIGID BODY, NSET=R{number}, REF NODE={reference}, ROT NODE={turning}")
    return lines
