"""Springs that follow another law than k: losses, delays and relaxation, as factors of s.

    loss factor   k (1 + i eta sign(w))                 ConstantLoss, eta times it
    delay         k exp(-s tau)                         LateForce, the change from k
    relaxation    k (1 + r s tau / (1 + s tau))         Relaxation, r times it (a Maxwell branch)

Conventions: exp(+i w t), a loss factor dissipates if it is positive (Ewins 2000, sec. 2.4).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.words import Complex, Real
from mbmodel.linearisation.springs import Spring
from mbmodel.parts.added import AddedPart
from mbmodel.parts.part import Change, Parameter


@dataclass(frozen=True)
class ConstantLoss:
    """The law i sign(w) of a loss that does not grow with frequency."""

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(1j * np.sign(laplace.imag), complex)


@dataclass(frozen=True)
class LateForce:
    """The law exp(-s tau) - 1 of a force that acts late.

    Args:
        delay_s: tau [s].
    """

    delay_s: float

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(np.expm1(-laplace * self.delay_s), complex)


@dataclass(frozen=True)
class Relaxation:
    """The law s tau / (1 + s tau) of a spring in series with a damper.

    Args:
        time_s: tau [s].
    """

    time_s: float

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        return np.asarray(laplace * self.time_s / (1 + laplace * self.time_s), complex)


ShapeOfLaw = Callable[[Complex], Complex]


def spring_law_part(spring: Spring, name: str, size: float, shape: ShapeOfLaw) -> AddedPart:
    """Return a Part that adds size k f(s) to a spring, k its nominal stiffness.

    Args:
        spring: of the machine.
        name: of the law, such as ``loss_factor``; the parameter is ``<spring>.<name>``.
        size: nominal value of the parameter, such as the loss factor.
        shape: f(s).
    """
    parameter = Parameter(f"{spring.name}.{name}", size, "1", positive=False)
    finite = partial(_change_of_spring, spring, shape)

    def derivatives(theta: Real) -> tuple[Change, ...]:
        del theta
        (change,) = finite(np.ones(1))
        return (Change("joint", change.left, change.right, change.core[None], shape=shape),)

    return AddedPart(spring.location, (parameter,), finite, derivatives)


def _change_of_spring(spring: Spring, shape: ShapeOfLaw, theta: Real) -> tuple[Change, ...]:
    """Return the change size k f(s) along a spring."""
    core = np.zeros((3, 1, 1))
    core[0] = float(theta[0]) * spring.stiffness
    direction = spring.direction[:, None]
    return (Change("joint", direction, direction, core, shape=shape),)
