"""Modes of a machine with laws that are no polynomials in s: losses, delays, relaxation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.words import Complex, ConvergenceError, Real
from mbmodel.model import FrequencyDependentTerm, Matrices, Model
from mbmodel.modes.model_modes import Modes, model_modes

_CONTINUATION_STEPS = 8  # in which the laws grow to their size, so that each mode is followed
_MAX_NEWTON_ROUNDS = 30
_MAX_RELATIVE_STEP = 1e-12  # of a pole: Newton's method has converged
_RELATIVE_STEP_OF_POLE = 1e-6  # of s, relative, for the derivative of a law


def modes_with_laws(model: Model, theta: Real) -> Modes:
    """Return the modes of Z(s) phi = 0 with all laws.

    Each oscillating mode of M, C and K is followed by Newton's method while the laws grow to their
    size (Ruhe 1973). Poles on the real axis are those of M, C and K, and so are all modes of a
    machine without such laws.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).

    Raises:
        ConvergenceError: a mode that cannot be followed.
    """
    modes, assembly = model_modes(model, theta), model.assemble(theta)
    if not assembly.frequency_dependent:
        return modes
    poles, shapes = modes.poles.copy(), modes.shapes.copy()
    for number in np.flatnonzero(modes.oscillates):
        pole, shape = complex(poles[number]), shapes[:, number]
        for share in np.linspace(0, 1, _CONTINUATION_STEPS + 1)[1:]:
            terms = assembly.frequency_dependent
            pole, shape = _follow(assembly.matrices, terms, float(share), pole, shape)
        poles[number], shapes[:, number] = pole, _normalise_shape(shape, assembly.matrices.mass)
    order = np.argsort(np.abs(poles), kind="stable")
    names = tuple(modes.names[k] for k in order)
    return replace(modes, poles=poles[order], shapes=shapes[:, order], names=names)


def _follow(
    matrices: Matrices,
    terms: Sequence[FrequencyDependentTerm],
    share: float,
    pole: complex,
    shape: Complex,
) -> tuple[complex, Complex]:
    """Return pole and shape with a share of the laws, from those with a smaller share."""
    size = len(shape)
    fixed = shape.conj() / np.vdot(shape, shape)
    for _ in range(_MAX_NEWTON_ROUNDS):
        step = _RELATIVE_STEP_OF_POLE * abs(pole)
        law, above, below = (
            sum(term.left @ term.at(np.array([s]))[0] @ term.right.T for term in terms)
            for s in (pole, pole + step, pole - step)
        )
        stiffness = matrices.dynamic_stiffness(pole) + share * law
        slope = 2 * pole * matrices.mass + matrices.damping + share * (above - below) / (2 * step)
        bordered = np.zeros((size + 1, size + 1), complex)
        bordered[:size, :size], bordered[:size, size] = stiffness, slope @ shape
        bordered[size, :size] = fixed
        residual = np.append(stiffness @ shape, fixed @ shape - 1)
        scale = np.append(1 / np.maximum(np.abs(np.diag(stiffness)), 1e-300), 1.0)
        change = np.linalg.solve(scale[:, None] * bordered, -scale * residual)
        shape, pole = shape + change[:size], pole + complex(change[size])
        if abs(change[size]) <= _MAX_RELATIVE_STEP * abs(pole):
            return pole, shape
    raise ConvergenceError(
        f"the mode near {abs(pole) / (2 * np.pi):.4g} Hz cannot be followed with the loss factors, "
        "delays and Maxwell branches: make them smaller"
    )


def _normalise_shape(shape: Complex, mass: Real) -> Complex:
    """Return a shape of unit modal mass |phi^H M phi|, in the phase that makes phi' M phi real."""
    scaled = shape / np.sqrt(abs(np.vdot(shape, mass @ shape)))
    turned: Complex = scaled * np.exp(-0.5j * np.angle(scaled @ mass @ scaled))
    return turned
