"""Modes of a machine with control loops: states of the controllers, then Newton's method.

The poles of the state space with the controllers and Pade's fractions of their delays are refined
on the exact equation (Z(s) + L(s)) phi = 0, L the loops with their delays. A pole of Pade's
fraction that is none of the exact equation is left out.
"""

from collections.abc import Sequence

import numpy as np

from identification.words import Complex, Real
from mbmodel.assembly import Assembly, FrequencyDependentTerm
from mbmodel.export.branch_states import branch_states
from mbmodel.export.state_space import first_order_form
from mbmodel.modes.matrix_modes import (
    Modes,
    modes_of_matrices,
    normalise_shapes,
    rest_motions,
)
from mbmodel.modes.nonlinear_eigenproblem import LawProblem, solve_pole

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

    Args:
        assembly: the equation of motion at theta.

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
    """Return the modes of M, C and K with control loops closed; other laws are left out.

    Args:
        assembly: the equation of motion at theta.
    """
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
