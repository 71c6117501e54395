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
import scipy.optimize

from identification.words import Complex, Mask, Real


def keep_positive_frequencies(dynamics: Complex, gain: Complex) -> tuple[Real, Real]:
    """Return A and B of the real system.

    Args:
        dynamics: A, complex; (n, n).
        gain: B; (n, n_in).
    """
    a, (units, _) = scipy.linalg.matrix_balance(dynamics, permute=False, separate=True)
    b = gain / units[:, None]
    poles = np.linalg.eigvals(a)
    positive, real = _find_kinds(poles)
    upper, form, drive = _subspace(a, b, poles, positive)
    level, real_form, real_drive = _real_subspace(a, b, poles, real)
    inner = np.block([[form.real, -form.imag], [form.imag, form.real]])
    states = np.hstack([2 * upper.real, -2 * upper.imag, level])
    whole = scipy.linalg.block_diag(inner, real_form)
    kept = states @ np.vstack([drive.real, drive.imag, real_drive])
    real_dynamics = np.linalg.solve(states.T, (states @ whole).T).T
    return real_dynamics * units[:, None] / units, kept * units[:, None]


def _find_kinds(poles: Complex) -> tuple[Mask, Mask]:
    """Return which poles are of positive frequency, and which are real but for the losses; (n,).

    A pole of positive frequency has a partner whose conjugate is nearer than the real axis. Losses
    turn real poles off the axis, which have none. Both poles of a mode with a damping ratio above
    0.7 act on the whole band, and count as real ones.
    """
    above, below = np.flatnonzero(poles.imag > 0), np.flatnonzero(poles.imag < 0)
    distances = np.abs(poles[above][:, None] - poles[below].conj())
    rows, columns = scipy.optimize.linear_sum_assignment(distances)
    size = poles[above[rows]].imag
    is_pair = (distances[rows, columns] < size) & (np.abs(poles[above[rows]].real) < size)
    positive, real = np.zeros(len(poles), bool), np.ones(len(poles), bool)
    positive[above[rows[is_pair]]] = True
    real[above[rows[is_pair]]] = real[below[columns[is_pair]]] = False
    return positive, real


def _subspace(
    a: Complex, b: Complex, poles: Complex, chosen: Mask
) -> tuple[Complex, Complex, Complex]:
    """Return an invariant subspace V of A, T with A V = V T, and W B of the projector V W.

    Args:
        a: A; (n, n).
        b: B; (n, n_in).
        poles: of A; (n,).
        chosen: those of the subspace; (n,).
    """

    def is_inside(pole: complex) -> bool:
        return bool(chosen[np.abs(poles - pole).argmin()])

    form, right, count = scipy.linalg.schur(a, output="complex", sort=is_inside)
    _, left, _ = scipy.linalg.schur(
        a.conj().T, output="complex", sort=lambda pole: is_inside(pole.conjugate())
    )
    right, left = right[:, :count], left[:, :count].conj().T
    return right, form[:count, :count], np.linalg.solve(left @ right, left @ b)


def _real_subspace(a: Complex, b: Complex, poles: Complex, chosen: Mask) -> tuple[Real, Real, Real]:
    """Return the real subspace nearest to that of the real poles, with its A and B."""
    basis, form, projector = _subspace(a, np.eye(len(a), dtype=complex), poles, chosen)
    plane = (basis @ projector).real
    level = np.linalg.svd(plane)[0][:, : basis.shape[1]]
    return level, level.T @ (basis @ form @ projector).real @ level, level.T @ plane @ b.real
