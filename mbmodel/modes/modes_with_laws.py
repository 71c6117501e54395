"""Modes of a machine with laws that are no polynomials in s: losses, delays, relaxation."""

from dataclasses import replace

import numpy as np

from identification.words import Complex, ConvergenceError, Integers, Real
from mbmodel.model import Model
from mbmodel.modes.matrix_modes import Modes
from mbmodel.modes.model_modes import model_modes
from mbmodel.modes.nonlinear_eigenproblem import LawProblem, normalise_shape, solve_pole

# Growth of the laws in one step, and the MAC that a mode must keep over it: first coarse, then fine
# where two modes have met.
_STEPS_AND_MACS = ((1 / 8, 0.8), (1 / 64, 0.95), (1 / 512, 0.99))
_MIN_STEP = 2.0**-16  # of the growth: a mode that needs smaller ones ends, such as on the real axis
_MAX_TRAVEL = 0.2  # of a pole in one step, relative
_MIN_DISTANCE = 1e-6  # of two poles, relative: nearer ones are one mode found twice


def modes_with_laws(model: Model, theta: Real) -> Modes:
    """Return the modes of Z(s) phi = 0 with all laws.

    Each oscillating mode of M, C and K, with control loops closed, is followed by Newton's method
    while the laws grow to their size (Ruhe 1973), in steps over which its shape hardly changes.
    Poles on the real axis are those of M, C and K, and so are all modes of a machine without such
    laws. A measured rest is known on its lines alone, and does not count.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: a mode that cannot be followed.
    """
    model = replace(model, machine=replace(model.machine, rest=None))
    modes, assembly = model_modes(model, theta), model.assemble(theta)
    terms = assembly.frequency_dependent
    laws = tuple(term for term in terms if not term.is_loop)
    if not laws:
        return modes
    loops = tuple(term for term in terms if term.is_loop)
    problem = LawProblem(assembly.matrices, laws, loops)
    poles, shapes = modes.poles.copy(), modes.shapes.copy()
    pending = np.flatnonzero(modes.oscillates)
    for step, min_mac in _STEPS_AND_MACS:
        for number in pending:
            poles[number], shapes[:, number] = _follow(
                problem, complex(modes.poles[number]), modes.shapes[:, number], step, min_mac
            )
        pending = _find_doubles(poles, np.flatnonzero(modes.oscillates))
        if not len(pending):
            break
    if len(pending):
        raise ConvergenceError(_sentence(complex(modes.poles[pending[0]])))
    mass = assembly.matrices.mass
    for number in np.flatnonzero(modes.oscillates):
        shapes[:, number] = normalise_shape(shapes[:, number], mass)
    order = np.argsort(np.abs(poles), kind="stable")
    names = tuple(modes.names[k] for k in order)
    return replace(modes, poles=poles[order], shapes=shapes[:, order], names=names)


def _find_doubles(poles: Complex, chosen: Integers) -> Integers:
    """Return the numbers of modes whose pole another one has too."""
    distance = np.abs(poles[chosen, None] - poles[chosen]) + np.diag(np.full(len(chosen), np.inf))
    numbers: Integers = chosen[distance.min(axis=1) < _MIN_DISTANCE * np.abs(poles[chosen])]
    return numbers


def _sentence(pole: complex) -> str:
    return (
        f"the mode near {abs(pole) / (2 * np.pi):.4g} Hz cannot be followed with the loss factors, "
        "delays and Maxwell branches: make them smaller"
    )


def _follow(
    problem: LawProblem, pole: complex, shape: Complex, step: float, min_mac: float
) -> tuple[complex, Complex]:
    """Return pole and shape with the laws, from those without.

    Args:
        problem: with the laws.
        pole: of the mode without laws.
        shape: of it; (nv,).
        step: largest growth of the laws at once.
        min_mac: least MAC of the shape over a step.
    """
    share, start = 0.0, pole
    while share < 1:
        size = min(step, 1 - share)
        solution = solve_pole(problem, share + size, pole, shape)
        if solution is None or not _is_near(problem, (pole, shape), solution, min_mac):
            step = size / 2
            if step < _MIN_STEP:
                raise ConvergenceError(_sentence(start))
            continue
        pole, shape = solution
        share += size
    return pole, shape


def _is_near(
    problem: LawProblem,
    before: tuple[complex, Complex],
    after: tuple[complex, Complex],
    min_mac: float,
) -> bool:
    """Return whether a mode has moved little over a step."""
    mass = problem.matrices.mass
    (pole, shape), (moved, turned) = before, after
    product = abs(np.vdot(shape, mass @ turned)) ** 2
    sizes = abs(np.vdot(shape, mass @ shape)) * abs(np.vdot(turned, mass @ turned))
    is_near = abs(moved - pole) <= _MAX_TRAVEL * abs(pole) and moved.imag > 0
    return bool(is_near and product >= min_mac * sizes)
