r"""How much of a feedback a machine bears before one of its poles reaches the imaginary axis.

A force z(s) a on the stretch b x moves the poles to the zeros of 1 + z(s) Y(s), Y = b^T Z^-1 a. A
machine that is stable without it stays so until, as z grows, that vanishes at some s = i omega:
the first such z is exact, whatever the damping. A modal estimate is not: on stages whose dampers
are far from modal it was up to five times too large.

As the pole goes to the axis about in proportion, four fifths of the way leave a fifth of its
damping.
"""

import numpy as np
import scipy.linalg

from truth.machine.rig import Rig, null_basis, receptance
from truth.machine.station import Complex, Real

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
