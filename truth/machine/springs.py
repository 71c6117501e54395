"""Joints and tendons of a station, and what acts between joints beside them.

Arrays of the virtual machine, and checks of their values.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truth.errors import TruthError

Real: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Integer: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]

AXES = ("x", "y", "z")
GROUND = -1


def frozen(values: ArrayLike, shape: tuple[int, ...], what: str) -> Real:
    """Return a finite, read-only copy of the values in this shape, or refuse them by name."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise TruthError(f"{what}: expected finite numbers of shape {shape}, got {values!r}")
    array.setflags(write=False)
    return array


def is_inertia(inertia: Real) -> bool:
    """Tell whether a body can have this inertia: its moments positive, none above the others' sum.

    Both hold exactly when every eigenvalue of ``trace(I)/2 - I`` is non-negative, these being the
    principal second moments of the mass, and when I itself is positive definite.
    """
    moments = np.linalg.eigvalsh(inertia)
    rounding = 1e-9 * float(moments.sum())
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1] + rounding)


@dataclass(frozen=True, eq=False)
class Joint:
    """One direction in which a stage moves against its parent, with a spring and a damper.

    Args:
        name: such as ``ty_rz``.
        kind: ``slide`` along the axis, or ``hinge`` about it.
        axis: unit vector; (3,).
        position: where the joint sits [m]; (3,).
        stiffness: [N/m] or [N m/rad], not negative.
        damping: [N s/m] or [N m s/rad], not negative.
    """

    name: str
    kind: Literal["slide", "hinge"]
    axis: Real
    position: Real
    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        """Check the values and make the axis a unit vector."""
        axis = frozen(self.axis, (3,), f"joint {self.name}, axis")
        if not np.linalg.norm(axis) > 0:
            raise TruthError(f"joint {self.name}: its axis has no length; give a direction")
        unit = frozen(axis / np.linalg.norm(axis), (3,), self.name)
        object.__setattr__(self, "axis", unit)
        position = frozen(self.position, (3,), f"joint {self.name}, pos")
        object.__setattr__(self, "position", position)
        for quantity in ("stiffness", "damping"):
            value = getattr(self, quantity)
            if not 0 <= value < np.inf:
                raise TruthError(f"joint {self.name}: {quantity} {value} is negative or no number")


@dataclass(frozen=True)
class Tendon:
    """A spring and a damper over several joints.

    Args:
        name: of the tendon.
        along: names of joints, and the tendon's stretch per unit of each [1 or m/rad].
        stiffness: [N/m].
        damping: [N s/m].
    """

    name: str
    along: tuple[tuple[str, float], ...]
    stiffness: float
    damping: float

    def row(self, joints: Sequence[str]) -> Real:
        """Return the stretch per unit of each of these joints; (n_joint,)."""
        known = dict(self.along)
        return np.array([known.get(name, 0.0) for name in joints])


@dataclass(frozen=True)
class Motor:
    """A motor that acts on joints.

    Args:
        name: of the actuator.
        along: names of joints, and the generalised force at each per unit of the control.
    """

    name: str
    along: tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A controller that reads a joint and drives a motor: control = -z(s) joint coordinate.

    Args:
        motor: name of the motor.
        joint: name of the joint.
        stiffness: z of s, controller, delay and derivatives of the reading together.
        table: its table in campaign.toml.
        files: content of files that the table names, by their names.
    """

    motor: str
    joint: str
    stiffness: Callable[[Complex], Complex]
    table: str
    files: Mapping[str, bytes]


@dataclass(frozen=True, eq=False)
class Remaining:
    """Linear forces between joint coordinates that no spring, tendon or weight makes.

    They are those of actuators, polynomial springs and tensions; the mass is that of armatures.

    Args:
        joints: names of the joints, in the order of the matrices.
        mass, damping, stiffness: (n_joint, n_joint).
    """

    joints: tuple[str, ...]
    mass: Real
    damping: Real
    stiffness: Real
