"""Modes of a machine with laws that are no polynomials in s: losses, delays, relaxation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, ConvergenceError, Integers, Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.model import Model
from mbmodel.modes.model_modes import Modes, model_modes

# Growth of the laws in one step, and the MAC that a mode must keep over it: first coarse, then fine
# where two modes have met.
_STEPS_AND_MACS = ((1 / 8, 0.8), (1 / 64, 0.95), (1 / 512, 0.99))
_MIN_STEP = 2.0**-16  # of the growth: a mode that needs smaller ones ends, such as on the real axis
_MAX_NEWTON_ROUNDS = 12
_MAX_RELATIVE_CHANGE = 1e-12  # of a pole: Newton's method has converged
_MAX_TRAVEL = 0.2  # of a pole in one step, relative
_MIN_DISTANCE = 1e-6  # of two poles, relative: nearer ones are one mode found twice
_RELATIVE_STEP_OF_POLE = 1e-6  # for the derivative of a law


@dataclass(frozen=True, eq=False)
class _Problem:
    """The equation (Z(s) + share F(s)) phi = 0.

    Args:
        matrices: M, C, K of Z.
        terms: laws of F.
    """

    matrices: Matrices
    terms: Sequence[FrequencyDependentTerm]

    def law(self, pole: complex) -> Complex:
        """Return F(s); (nv, nv)."""
        s = np.array([pole])
        total: Complex = sum(term.left @ term.at(s)[0] @ term.right.T for term in self.terms)
        return total


def modes_with_laws(model: Model, theta: Real) -> Modes:
    """Return the modes of Z(s) phi = 0 with all laws.

    Each oscillating mode of M, C and K is followed by Newton's method while the laws grow to their
    size (Ruhe 1973), in steps over which its shape hardly changes. Poles on the real axis are those
    of M, C and K, and so are all modes of a machine without such laws.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: a mode that cannot be followed.
    """
    modes, assembly = model_modes(model, theta), model.assemble(theta)
    if not assembly.frequency_dependent:
        return modes
    problem = _Problem(assembly.matrices, assembly.frequency_dependent)
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
        shapes[:, number] = _normalise_shape(shapes[:, number], mass)
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
    problem: _Problem, pole: complex, shape: Complex, step: float, min_mac: float
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
        solution = _solve(problem, share + size, pole, shape)
        if solution is None or not _is_near(problem, (pole, shape), solution, min_mac):
            step = size / 2
            if step < _MIN_STEP:
                raise ConvergenceError(_sentence(start))
            continue
        pole, shape = solution
        share += size
    return pole, shape


def _is_near(
    problem: _Problem,
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


def _solve(
    problem: _Problem, share: float, pole: complex, shape: Complex
) -> tuple[complex, Complex] | None:
    """Return pole and shape with a share of the laws by Newton's method; None if it fails."""
    matrices, size = problem.matrices, len(shape)
    fixed = shape.conj() / np.vdot(shape, shape)
    bordered = np.zeros((size + 1, size + 1), complex)
    bordered[size, :size] = fixed
    for _ in range(_MAX_NEWTON_ROUNDS):
        step = _RELATIVE_STEP_OF_POLE * abs(pole)
        stiffness = matrices.dynamic_stiffness(pole) + share * problem.law(pole)
        slope = 2 * pole * matrices.mass + matrices.damping
        rise = problem.law(pole + step) - problem.law(pole - step)
        bordered[:size, :size] = stiffness
        bordered[:size, size] = slope @ shape + share / (2 * step) * (rise @ shape)
        residual = np.append(stiffness @ shape, fixed @ shape - 1)
        scale = np.append(1 / np.maximum(np.abs(np.diag(stiffness)), 1e-300), 1.0)
        try:
            change = np.linalg.solve(scale[:, None] * bordered, -scale * residual)
        except np.linalg.LinAlgError:
            return None
        shape, pole = shape + change[:size], pole + complex(change[size])
        if not np.isfinite(pole) or pole == 0:
            return None
        if abs(change[size]) <= _MAX_RELATIVE_CHANGE * abs(pole):
            return pole, shape
    return None


def _normalise_shape(shape: Complex, mass: Real) -> Complex:
    """Return a shape of unit modal mass |phi^H M phi|, in the phase that makes phi' M phi real."""
    scaled = shape / np.sqrt(abs(np.vdot(shape, mass @ shape)))
    turned: Complex = scaled * np.exp(-0.5j * np.angle(scaled @ mass @ scaled))
    return turned
