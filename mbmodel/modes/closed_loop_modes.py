"""Modes of a machine with control loops: states of the controllers, then Newton's method.

The poles of the state space with the controllers and Pade's fractions of their delays are refined
on the exact equation (Z(s) + L(s)) phi = 0, L the loops with their delays. A pole of Pade's
fraction that is none of the exact equation is left out.

Poles and shapes of an equation of motion with laws, (Z(s) + share F(s)) phi = 0, by Newton.

Newton's method for nonlinear eigenproblems (Ruhe 1973) refines a pole and its shape together, in
the equation bordered by a row that fixes the size of the shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from mbmodel.assembly import Assembly, FrequencyDependentTerm, Matrices
from mbmodel.export.branch_states import branch_states
from mbmodel.export.state_space import first_order_form
from mbmodel.modes.matrix_modes import (
    Modes,
    modes_of_matrices,
    normalise_shapes,
    rest_motions,
)

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
        return (self.law(pole + step, share) - self.law(pole - step, share)) / (2 * step)


def solve_pole(
    problem: LawProblem, share: float, pole: complex, shape: Complex
) -> tuple[complex, Complex] | None:
    """Return pole and shape with a share of the laws by Newton's method; None if it fails.

    Args:
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
    return scaled * np.exp(-0.5j * np.angle(scaled @ mass @ scaled))


_LINES = 200  # at which Pade's fractions are measured
# The fractions are right from below the lowest mode to above the highest one by these factors.
_LOWER_REACH, _UPPER_REACH = 1e-2, 1.5
_MAX_CORRECTION = 1e-2  # of a pole by Newton's method, relative: a larger one is another pole
_MAX_IMBALANCE = 1e-6  # of the forces of a mode over the largest: it fulfils the equation
# Relative distance of two poles, and MAC of their shapes: nearer ones are one mode found twice.
_SAME_POLE_DISTANCE, _SAME_SHAPE_MAC = 1e-6, 0.99
_MAX_RESTING = 1e-6  # of a pole over the largest: what rounding leaves of a motion at rest


def closed_loop_dynamics(assembly: Assembly) -> Real:
    """Return A of a machine with its loops, x = [q; q'; controllers]; other laws are left out.

    Returns:
        (n, n).
    """
    loops = _loops(assembly)
    poles = np.abs(modes_of_matrices(assembly.matrices).poles)
    highest = float(poles.max(initial=1.0))
    lowest = float(poles[poles > _MAX_RESTING * highest].min(initial=highest))
    band = _LOWER_REACH * lowest / (2 * np.pi), _UPPER_REACH * highest / (2 * np.pi)
    lines = np.geomspace(*band, _LINES)
    branches = branch_states(assembly.matrices, loops, lines)
    return first_order_form(branches, np.zeros((len(assembly.matrices.mass), 0))).dynamics


def modes_of_assembly(assembly: Assembly) -> Modes:
    """Return the modes of M, C and K with control loops closed; other laws are left out."""
    loops = _loops(assembly)
    if not loops:
        return modes_of_matrices(assembly.matrices)
    mass = assembly.matrices.mass
    candidates, vectors = np.linalg.eig(closed_loop_dynamics(assembly))
    resting = rest_motions(_static_stiffness(assembly), mass)
    count = resting.shape[1]
    smallest = _MAX_RESTING * np.abs(candidates).max() if count else 0.0
    problem = LawProblem(assembly.matrices, (), loops)
    poles: list[complex] = []
    shapes: list[Complex] = []
    for k in np.argsort(np.abs(candidates)):
        pole, shape = complex(candidates[k]), vectors[: len(mass), k].astype(complex)
        if pole.imag < 0 or abs(pole) <= smallest or not shape.any():
            continue
        refined = _refine(problem, pole, shape / np.linalg.norm(shape))
        if refined is not None and not _is_listed(refined, poles, shapes):
            poles.append(refined[0])
            shapes.append(refined[1])
    columns = np.array(shapes, complex).reshape(len(poles), len(mass)).T
    return Modes(
        np.concatenate([np.zeros(count, complex), np.array(poles, complex)]),
        normalise_shapes(np.hstack([resting, columns]), mass),
        tuple(f"at rest {k + 1}" for k in range(count)) + ("",) * len(poles),
    )


def _refine(problem: LawProblem, pole: complex, shape: Complex) -> tuple[complex, Complex] | None:
    """Return pole and shape of the exact equation near those of the state space, None without any.

    At poles that coincide Newton's equation is singular: there those of the state space stay if
    they fulfil the exact equation.
    """
    solution = solve_pole(problem, 1.0, pole, shape)
    if solution is not None and abs(solution[0] - pole) <= _MAX_CORRECTION * abs(pole):
        exact, turned = solution
        return (exact if pole.imag else complex(exact.real)), turned
    matrices, law = problem.matrices, problem.law(pole, 1.0)
    force = np.abs((matrices.dynamic_stiffness(pole) + law) @ shape)
    terms = pole**2 * matrices.mass, pole * matrices.damping, matrices.stiffness, law
    sizes = sum(np.abs(term) for term in terms) @ np.abs(shape)
    is_exact = bool((force <= _MAX_IMBALANCE * sizes.max()).all())
    return (pole, shape) if is_exact else None


def _is_listed(
    mode: tuple[complex, Complex], poles: Sequence[complex], shapes: Sequence[Complex]
) -> bool:
    """Return whether a list of modes holds a mode of equal pole and shape."""
    pole, shape = mode
    return any(
        abs(pole - known) <= _SAME_POLE_DISTANCE * abs(pole)
        and abs(np.vdot(shape, listed)) ** 2
        >= _SAME_SHAPE_MAC * np.vdot(shape, shape).real * np.vdot(listed, listed).real
        for known, listed in zip(poles, shapes, strict=True)
    )


def _loops(assembly: Assembly) -> tuple[FrequencyDependentTerm, ...]:
    """Return the terms of control loops."""
    return tuple(term for term in assembly.frequency_dependent if term.is_loop)


def _static_stiffness(assembly: Assembly) -> Real:
    """Return the stiffness at s = 0 with the loops; (nv, nv)."""
    total = assembly.matrices.stiffness.copy()
    for term in _loops(assembly):
        total += (term.left @ term.at(np.zeros(1, complex))[0] @ term.right.T).real
    return total
