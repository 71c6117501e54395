"""State space of an identified modal model, for control."""

import numpy as np
import scipy.linalg

from identification.words import ModalModel, Real

_RANK_SHARE = 1e-12  # of the largest singular value of the residual of lower modes


def modal_state_space(model: ModalModel) -> tuple[Real, Real, Real, Real]:
    r"""Return the receptance of a modal model as a real state space.

    A mode z' = s_r z + l_r' u adds 2 Re(phi_r z) to y. With z = p + i q its two real states are

        p' = Re(s) p - Im(s) q + Re(l)' u,   q' = Im(s) p + Re(s) q + Im(l)' u,

    and y has 2 Re(phi) p - 2 Im(phi) q. The residual of upper modes is D. That of lower modes,
    v / s^2, is a double integrator for each of its singular values. Velocity and acceleration are
    derivatives of y: their residual of upper modes is proper in no state space.

    Args:
        model: poles, shapes, participation and residuals of receptance.

    Returns:
        A (n_state, n_state), B (n_state, n_in), C (n_out, n_state) and D (n_out, n_in) of
        x' = A x + B u, y = C x + D u, with forces u and displacements y.
    """
    blocks = [np.array([[s.real, -s.imag], [s.imag, s.real]]) for s in model.poles]
    of_inputs = [np.vstack([row.real, row.imag]) for row in model.participation.T]
    of_outputs = [np.column_stack([2 * row.real, -2 * row.imag]) for row in model.shapes.T]
    left, sizes, right = np.linalg.svd(model.lower)
    for k in range(int((sizes > _RANK_SHARE * sizes.max(initial=0.0)).sum())):
        blocks.append(np.array([[0.0, 1.0], [0.0, 0.0]]))
        of_inputs.append(np.vstack([np.zeros(len(model.inputs)), right[k]]))
        of_outputs.append(np.column_stack([sizes[k] * left[:, k], np.zeros(len(model.outputs))]))
    if not blocks:
        empty = np.zeros((0, 0))
        none = np.zeros((0, len(model.inputs))), np.zeros((len(model.outputs), 0))
        return empty, *none, np.asarray(model.upper)
    return (
        scipy.linalg.block_diag(*blocks),
        np.vstack(of_inputs),
        np.hstack(of_outputs),
        np.asarray(model.upper),
    )
