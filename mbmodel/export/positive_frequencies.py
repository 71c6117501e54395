r"""The real system nearest to one whose losses are constant at all frequencies.

A loss factor makes the stiffness complex at positive frequencies, K + i H, and with it

    x' = A x + B f,    FRF(w) = C (i w - A)^-1 B,    w > 0

is exact. In time it is no system: the poles have no conjugates, and those of negative frequency
grow. The modes as they are measured are the poles with Im p > 0. With the projector P onto their
invariant subspace, the system

    C P (s - A)^-1 B  +  its conjugate at the conjugate s

is real and stable, and has their poles and residues. It lacks what the poles of negative frequency
differ from these conjugates: smooth over the band, of the order eta^2 of a peak. By the relations
of Kramers and Kronig no causal system has constant losses (Crandall 1970): one that is nearer in
the band is far off outside. Poles on or near the real axis, such as those of rigid modes, keep
their real part.

The states are those of A: positions, velocities and what laws add, so that names stay. An impulse
moves positions at once by a part of the order eta, which vanishes without losses.
"""

import numpy as np
import scipy.linalg

from identification.words import Complex, InputError, Real

# Of a pole's size: an imaginary part below is that of a real pole. The first that leaves as many
# poles of positive as of negative frequency counts: a loss turns real poles off the axis.
_REAL_POLE_SHARES = (1e-6, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 0.6)


def keep_positive_frequencies(dynamics: Complex, gain: Complex) -> tuple[Real, Real]:
    """Return A and B of the real system.

    Args:
        dynamics: A, complex; (n, n).
        gain: B; (n, n_in).

    Raises:
        InputError: poles of positive and negative frequency differ in number.
    """
    a, (units, _) = scipy.linalg.matrix_balance(dynamics, permute=False, separate=True)
    b = gain / units[:, None]
    turns = np.linalg.eigvals(a)
    turns = turns.imag / np.maximum(np.abs(turns), np.finfo(float).tiny)
    for share in _REAL_POLE_SHARES:
        if (turns > share).sum() == (turns < -share).sum():
            break
    else:
        raise InputError(
            "the loss factors turn strongly damped modes into single poles, which no state space "
            "has: make dampers or loss factors smaller"
        )
    upper, form, drive = _subspace(a, b, share, 1)
    level, real_form, real_drive = _real_subspace(a, b, share)
    inner = np.block([[form.real, -form.imag], [form.imag, form.real]])
    states = np.hstack([2 * upper.real, -2 * upper.imag, level]) * 1.0
    whole = scipy.linalg.block_diag(inner, real_form)
    kept = states @ np.vstack([drive.real, drive.imag, real_drive])
    real = np.linalg.solve(states.T, (states @ whole).T).T
    return real * units[:, None] / units, kept * units[:, None]


def _subspace(a: Complex, b: Complex, share: float, side: int) -> tuple[Complex, Complex, Complex]:
    """Return an invariant subspace V of A, T with A V = V T, and W B of the projector V W.

    Args:
        a: A; (n, n).
        b: B; (n, n_in).
        share: imaginary part of a real pole, of its size.
        side: 1 for the poles of positive frequency, 0 for real ones.
    """

    def is_inside(pole: complex) -> bool:
        return (pole.imag > share * abs(pole)) if side else (abs(pole.imag) <= share * abs(pole))

    form, right, count = scipy.linalg.schur(a, output="complex", sort=is_inside)
    _, left, _ = scipy.linalg.schur(
        a.conj().T, output="complex", sort=lambda pole: is_inside(pole.conjugate())
    )
    right, left = right[:, :count], left[:, :count].conj().T
    return right, form[:count, :count], np.linalg.solve(left @ right, left @ b)


def _real_subspace(a: Complex, b: Complex, share: float) -> tuple[Real, Real, Real]:
    """Return the real subspace nearest to that of the real poles, with its A and B."""
    basis, form, projector = _subspace(a, np.eye(len(a), dtype=complex), share, 0)
    plane = (basis @ projector).real
    level = np.linalg.svd(plane)[0][:, : basis.shape[1]]
    return level, level.T @ (basis @ form @ projector).real @ level, level.T @ plane @ b.real
