r"""Model discrepancy: errors of FRFs by what a model lacks, anywhere in the machine.

Every force of elasticity and inertia may be off by a relative error e, coupled at random. In the
undamped modes r of the machine, with a_r = |w_r^2| + w^2 and unit modal masses,

    dZ_rs = e sqrt(a_r a_s) X_rs,    X_rs independent, of mean zero and E|X_rs|^2 = 1, X_rr = 0.

This is the nonparametric model of random uncertainties (Soize 2000, Probabilistic Engineering
Mechanics 15, 277-294) without its diagonal: frequencies and damping of modes are what a tuning
fits, and their error is that of the parameters. With x_i the motion by a unit force at input i, and
x_o that by one at output o in the transposed machine, dH = -x_o' dZ x_i to first order, so that

    E|dH_oi|^2 = e^2 (E_o E_i - sum_r E_or E_ir),    E_p = sum_r E_pr,    E_pr = a_r |x_pr|^2.

E_pr is twice the sum of the peak elastic and kinetic energies of mode r. So a small cross motion
has an error that comes from the large motions beside it.
"""

import numpy as np
import scipy.linalg

from identification.words import Complex, Real
from mbmodel import Linearised


def discrepancy_motion(
    lines: Linearised, left: Complex | None = None, right: Complex | None = None
) -> Real:
    """Return the standard deviation of each FRF per unit of e, real plus imaginary part.

    Args:
        lines: the model at its parameters; its FRFs' quantity is that of the deviations.
        left: sums of outputs whose deviations are wanted; by default the outputs themselves;
            (n_freq, n_sum, n_out).
        right: sums of inputs, likewise; (n_freq, n_in, n_sum).

    Returns:
        (n_freq, n_out, n_in), or as many as there are sums.
    """
    answers = lines.solver.solve(lines.readout.T[:, :, None], transposed=True)
    of_inputs, of_outputs = _modal_amplitudes(lines, lines.motion, answers)
    if lines.output_factor is not None:
        of_outputs = of_outputs * lines.output_factor
    if right is not None:
        of_inputs = np.einsum("rif,fis->rsf", of_inputs, right, optimize=True)
    if left is not None:
        of_outputs = np.einsum("fso,rof->rsf", left, of_outputs, optimize=True)
    outputs, inputs = np.abs(of_outputs) ** 2, np.abs(of_inputs) ** 2
    whole = outputs.sum(axis=0).T[:, :, None] * inputs.sum(axis=0).T[:, None, :]
    diagonal = np.einsum("rof,rif->foi", outputs, inputs, optimize=True)
    return np.sqrt(np.maximum(whole - diagonal, 0.0))


def _modal_amplitudes(lines: Linearised, *motions: Complex) -> tuple[Complex, ...]:
    """Return sqrt(a_r) x_r of each mode in motions (nv, m, n_freq); (n_mode, m, n_freq) each."""
    matrices = lines.assembly.matrices
    mass = (matrices.mass + matrices.mass.T) / 2
    stiffness = (matrices.stiffness + matrices.stiffness.T) / 2
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    size = np.sqrt(np.abs(squares)[:, None] + np.abs(lines.request.laplace) ** 2)[:, None, :]
    return tuple(
        size * np.einsum("vr,vmf->rmf", mass @ shapes, motion, optimize=True) for motion in motions
    )
