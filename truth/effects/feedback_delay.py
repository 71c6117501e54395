r"""A joint direction held by a control loop that acts late.

How much of a feedback a machine bears before one of its poles reaches the imaginary axis.

A force z(s) a on the stretch b x moves the poles to the zeros of 1 + z(s) Y(s), Y = b^T Z^-1 a. A
machine that is stable without it stays so until, as z grows, that vanishes at some s = i omega:
the first such z is exact, whatever the damping. A modal estimate is not: on stages whose dampers
are far from modal it was up to five times too large.

As the pole goes to the axis about in proportion, four fifths of the way leave a fifth of its
damping.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg

from truth.effects.effect import Scene
from truth.effects.places import AtDirection, draw_direction
from truth.machine.rig import FrequencyLaw, Occasion, Prepared, Rig, build, null_basis, receptance
from truth.machine.station import Complex, Joint, Real

SHARE = (0.2, 0.7)  # of the longest delay
SMALLEST = 1e-4  # of the longest delay
LONGEST = 0.02  # s


@dataclass(frozen=True)
class FeedbackDelay(AtDirection):
    r"""One spring becomes k exp(-s tau): the dynamic stiffness gains z(s) = k (exp(-s tau) - 1).

    To first order that is a damper of -k tau, and up to tau = c/k it takes no more than the joint's
    own damper gives. How much longer it may be depends on the machine: four fifths of what makes a
    mode unstable (``longest_delay``).

    Args:
        size: tau [s].
        longest: delay that leaves the machine stable [s].
    """

    longest: float
    effect = "feedback_delay"

    @property
    def limits(self) -> tuple[float, float]:
        """Return smallest and largest delay [s]."""
        return SMALLEST * self.longest, self.longest

    def parameters(self) -> dict[str, float]:
        """Return the delay [s]."""
        return {"delay": self.size}

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the late spring."""
        row = self.direction.stretch(rig, tested)
        stiffness = self.direction.joint(tested.station).stiffness
        law = FrequencyLaw(row, row, partial(_late, stiffness, self.size))
        return replace(rig, laws=(*rig.laws, law))


def _late(stiffness: float, delay: float, s: Complex) -> Complex:
    return np.asarray(stiffness * np.expm1(-s * delay))


def draw_feedback_delay(
    random: np.random.Generator, scene: Scene, place: str | None
) -> FeedbackDelay | None:
    """Draw a direction whose modes are damped, and a delay that they bear."""

    def loop(joint: Joint) -> bool:
        return joint.stiffness > 0 and joint.damping > 0

    direction = draw_direction(random, scene.station, place, loop)
    if direction is None:
        return None
    tested = Prepared(scene.station, ())
    rig = build(tested)
    row = direction.stretch(rig, tested)
    stiffness = direction.joint(scene.station).stiffness
    longest = min(longest_delay(rig, row, stiffness), LONGEST)
    return FeedbackDelay(
        direction=direction, longest=longest, size=longest * random.uniform(*SHARE)
    )


KEPT = 0.2  # of the damping of the pole that would be the first to go
_AROUND = np.sinh(np.linspace(-6, 6, 61))  # lines about each pole, in units of its decay
_LIGHT = 1e-4  # damping ratio below which lines about a pole come no closer


def longest_delay(rig: Rig, row: Real, stiffness: float) -> float:
    r"""Return four fifths of the delay tau [s] at which k exp(-s tau) makes the machine unstable.

    z = k (exp(-s tau) - 1), so exp(-i omega tau) = w = 1 - 1/(k Y): wherever |w| = 1 a delay of
    -arg(w) / omega puts a pole on the axis. Infinite if there is no such line.

    Args:
        rig: the machine, stable.
        row: of the joint direction; (n,).
        stiffness: k of its spring.
    """
    omega = _lines(rig)
    turned = 1 - 1 / (stiffness * _response(rig, row, row, omega))
    line, value = _crossings(omega, turned, np.abs(turned) ** 2 - 1)
    delays = np.mod(-np.angle(value), 2 * np.pi) / line
    return float((1 - KEPT) * np.min(delays, initial=np.inf))


def largest_coupling(rig: Rig, row: Real, column: Real) -> float:
    r"""Return four fifths of the d at which C + d a b^T makes the machine unstable, d positive.

    z = s d, so d = -1 / (s Y) wherever s Y is real and negative. Infinite if it is nowhere.

    Args:
        rig: the machine, stable.
        row: b; (n,).
        column: a, its sign that of the coupling; (n,).
    """
    omega = _lines(rig)
    mobility = 1j * omega * _response(rig, row, column, omega)
    _, value = _crossings(omega, mobility, mobility.imag)
    couplings = -1 / value.real[value.real < 0]
    return float((1 - KEPT) * np.min(couplings, initial=np.inf))


def poles(rig: Rig) -> Complex:
    """Return the poles of a rig without laws [rad/s]; (2 m,)."""
    basis, equations = null_basis(rig.equations), rig.equations
    mass, damping, stiffness = (
        basis.T @ matrix @ basis
        for matrix in (equations.mass, equations.damping, equations.stiffness)
    )
    falling = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    upper = np.eye(len(mass), 2 * len(mass), k=len(mass))
    return np.asarray(scipy.linalg.eigvals(np.vstack([upper, falling])), dtype=np.complex128)


def _lines(rig: Rig) -> Real:
    """Return omega [rad/s], positive and rising, close about every pole; (n_line,)."""
    upper = poles(rig)
    upper = upper[upper.imag > 0]
    decay = np.maximum(-upper.real, _LIGHT * np.abs(upper))
    lines = np.unique(upper.imag[:, None] + decay[:, None] * _AROUND)
    return np.asarray(lines[lines > 0], dtype=np.float64)


def _response(rig: Rig, row: Real, column: Real, omega: Real) -> Complex:
    return np.asarray(receptance(rig, omega / (2 * np.pi), column[:, None])[:, :, 0] @ row)


def _crossings(omega: Real, values: Complex, test: Real) -> tuple[Real, Complex]:
    """Return the lines where a test changes its sign, and the values there."""
    before = np.flatnonzero(np.diff(np.sign(test)))
    part = test[before] / (test[before] - test[before + 1])
    line = omega[before] + part * np.diff(omega)[before]
    return line, values[before] + part * np.diff(values)[before]
