"""Poles and shapes of an equation of motion with laws, (Z(s) + share F(s)) phi = 0, by Newton.

Newton's method for nonlinear eigenproblems (Ruhe 1973) refines a pole and its shape together, in
the equation bordered by a row that fixes the size of the shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices

_MAX_NEWTON_ROUNDS = 12
_MAX_RELATIVE_CHANGE = 1e-12  # of a pole: Newton's method has converged
_MAX_EXCURSION = 3.0  # of a pole from its start, relative: farther away it is lost
_RELATIVE_STEP_OF_POLE = 1e-6  # for the derivative of a law


@dataclass(frozen=True, eq=False)
class LawProblem:
    """The equation (Z(s) + L(s) + share F(s)) phi = 0.

    Args:
        matrices: M, C, K of Z.
        terms: laws of F.
        loops: closed control loops L, which always act in full.
    """

    matrices: Matrices
    terms: Sequence[FrequencyDependentTerm]
    loops: Sequence[FrequencyDependentTerm] = ()

    def law(self, pole: complex, share: float) -> Complex:
        """Return L(s) + share F(s); (nv, nv)."""
        s, size = np.array([pole]), len(self.matrices.mass)
        total: Complex = np.zeros((size, size), np.complex128)
        for terms, factor in ((self.terms, share), (self.loops, 1.0)):
            for term in terms:
                total += factor * (term.left @ term.at(s)[0] @ term.right.T)
        return total

    def stiffness_and_slope(self, poles: Complex) -> tuple[Complex, Complex]:
        """Return Z(s) + L(s) and its derivative by s at each s; (n, nv, nv) each.

        Args:
            poles: s [rad/s]; (n,).
        """
        matrices = self.matrices
        s = poles[:, None, None]
        dynamic = s**2 * matrices.mass + s * matrices.damping + matrices.stiffness
        slope = 2 * s * matrices.mass + matrices.damping
        for k, pole in enumerate(poles.tolist() if self.loops else ()):
            dynamic[k] += self.law(pole, 0.0)
            slope[k] = slope[k] + self.law_slope(pole, 0.0)
        return dynamic, slope

    def law_slope(self, pole: complex, share: float) -> Complex:
        """Return the derivative of L(s) + share F(s) by s; (nv, nv)."""
        step = _RELATIVE_STEP_OF_POLE * abs(pole)
        slope: Complex = (self.law(pole + step, share) - self.law(pole - step, share)) / (2 * step)
        return slope


def solve_pole(
    problem: LawProblem, share: float, pole: complex, shape: Complex
) -> tuple[complex, Complex] | None:
    """Return pole and shape with a share of the laws by Newton's method; None if it fails.

    Args:
        problem: with the laws.
        share: of the laws.
        pole: near the one that is sought.
        shape: near its shape; (nv,).
    """
    matrices, size, start = problem.matrices, len(shape), pole
    fixed = shape.conj() / np.vdot(shape, shape)
    bordered = np.zeros((size + 1, size + 1), complex)
    bordered[size, :size] = fixed
    for _ in range(_MAX_NEWTON_ROUNDS):
        stiffness = matrices.dynamic_stiffness(pole) + problem.law(pole, share)
        slope = 2 * pole * matrices.mass + matrices.damping
        bordered[:size, :size] = stiffness
        bordered[:size, size] = (slope + problem.law_slope(pole, share)) @ shape
        residual = np.append(stiffness @ shape, fixed @ shape - 1)
        scale = np.append(1 / np.maximum(np.abs(np.diag(stiffness)), 1e-300), 1.0)
        try:
            change = np.linalg.solve(scale[:, None] * bordered, -scale * residual)
        except np.linalg.LinAlgError:
            return None
        shape, pole = shape + change[:size], pole + complex(change[size])
        has_left = not abs(pole - start) <= _MAX_EXCURSION * abs(start)  # not a number counts
        if has_left or pole == 0:
            return None
        if abs(change[size]) <= _MAX_RELATIVE_CHANGE * abs(pole):
            return pole, shape
    return None


def normalise_shape(shape: Complex, mass: Real) -> Complex:
    """Return a shape of unit modal mass |phi^H M phi|, in the phase that makes phi' M phi real."""
    scaled = shape / np.sqrt(abs(np.vdot(shape, mass @ shape)))
    turned: Complex = scaled * np.exp(-0.5j * np.angle(scaled @ mass @ scaled))
    return turned
