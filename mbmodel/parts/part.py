"""Interface of a Part: a named, parametrised, low-rank change of the equation of motion.

    H(s) = s^q L T Z(s)^-1 T' P,   Z(s) = T' Zb(s) T + Zj(s),   s = i w, convention exp(+i w t)

Everything that can be tuned, tolerated or added to a machine is a Part. It adds
left core(s) right' in one of seven slots:

    slot     adds to                 left x right                     powers of s
    body     Zb, bodies              6 n_body x 6 n_body              0, 1, 2
    joint    Zj, joints              nv x nv                          0, 1, 2
    path     T, kinematics           6 n_body x nv                    0
    sensor   L, rows of a point      6 directions of it x 6 n_body    0
    hammer   P', rows of a point     6 directions of it x 6 n_body    0
    input    factor of H, from 1     1 x 1, all inputs of a test      0, 1, 2
    output   log of the factor of    6 directions of a point x 1      0, 1, 2
             the point's readings

An eighth slot, ``bodies_and_joints``, is that of known control loops: its rows are those of the
bodies and then those of the joints, (6 n_body + nv) x (6 n_body + nv), and it reads the motion of
the bodies with the floor.

Factors of several Parts multiply. A delay tau of a reading, exp(-s tau), adds -s tau in ``output``.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from identification.words import Complex, Condition, Real
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf

AXIS_NAMES = "xyz"  # ends of parameter names

Slot = Literal["body", "joint", "path", "sensor", "hammer", "input", "output", "bodies_and_joints"]

# How well the nominal model (the drawing) knows a number: not at all (``free``), exactly, but for a
# gain that a campaign calls unknown, damping that it leaves out, or within one of the tolerances of
# campaigns.
ToleranceKind = Literal[
    "free",
    "exactly",
    "unknown_gain",
    "stiffness",
    "damping",
    "undrawn_damping",
    "mass",
    "inertia",
    "com",
    "joint_position",
    "sensor_gain",
    "sensor_angle",
    "sensor_position",
    "sensor_delay",
    "sensor_cross",
    "hammer_angle",
    "hammer_position",
    "hammer_gain",
    "hammer_delay",
]


@dataclass(frozen=True)
class Parameter:
    """A number of a Part.

    Args:
        name: unique in a model, such as ``tilt_tz.stiffness``.
        drawn: value in the nominal model.
        unit: SI unit.
        positive: whether it is a size, tuned by its logarithm.
        known: kind of its prior: ``free`` for none, ``exactly`` for a fixed value,
            ``unknown_gain`` for a wide one, ``undrawn_damping`` for a half-normal one, else the
            name of the campaign's tolerance that is its standard deviation.
        usual: size of undrawn damping that is usual: the scale of its half-normal prior.
    """

    name: str
    drawn: float
    unit: str
    positive: bool = True
    known: ToleranceKind = "free"
    usual: float = field(default=0.0, compare=False)


@dataclass(frozen=True, eq=False)
class Change:
    """A low-rank term in a slot: ``f(s) left (core_0 + s core_1 + s^2 core_2) right'``.

    Args:
        slot: which factor of the equation changes.
        left: (n, r).
        right: (m, t).
        core: coefficients of s^0, s^1, s^2; (..., 3, r, t). In a slope, the first axis runs over
            the Part's parameters.
        point: the sensor or hammer point, in the slots sensor, hammer and output.
        shape: f(s), a factor that is no polynomial, with ``f(conj s) = conj f(s)``; (n_freq,), or
            a factor of each entry of the core, (n_freq, r, t). Only finite changes of bodies,
            joints, inputs and outputs may have one, and loops have one.
        owner: what has the shape, for statements; the Part's first parameter if empty.
    """

    slot: Slot
    left: Real
    right: Real
    core: Real
    point: str = ""
    shape: Callable[[Complex], Complex] | None = None
    owner: str = ""


@dataclass(frozen=True, eq=False)
class PartContext:
    """Machine and test for which a Part computes its change.

    Args:
        machine: machine whose equation changes.
        condition: condition of the test; None for the machine apart from any test.
    """

    machine: Machine
    condition: Condition | None = None


class Part(Protocol):
    """A named, parametrised change; ``theta`` holds the values of its own parameters in SI."""

    @property
    def location(self) -> str:
        """Place in the machine: ``joint:<child body>``, ``body:<name>``, ``sensor:<site>`` ..."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters in the order of theta."""

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the finite change at theta."""

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivative of the change by each parameter; cores (n_parameter, 3, r, t)."""

    def write(self, theta: Real) -> tuple[Edit | Addition | NotInMjcf, ...]:
        """Return what to write into the MJCF at theta, and what the MJCF cannot hold."""

    def select_held(self, theta: Real) -> Real:
        """Return the values that the MJCF holds once theta is written."""


def drawn_values(part: Part, theta: Real) -> Real:
    """Return the nominal values of a Part's parameters, in the shape of its theta."""
    values = np.array([parameter.drawn for parameter in part.parameters], np.float64)
    return values.reshape(theta.shape)


@runtime_checkable
class ConditionalPart(Protocol):
    """A Part that acts in some tests only, and changes nothing in the others."""

    def acts(self, condition: Condition | None) -> float:
        """Return the fraction of the Part that acts in a test, 0 to 1."""
