"""Split of a system into its stable part and the rest: rigid, undamped and unstable modes.

An ordered real Schur form puts the stable poles first. A Sylvester equation removes the coupling
(Golub and Van Loan 2013, ch. 7.6):

    [[T11, T12], [0, T22]],   T11 X - X T22 + T12 = 0   ->   diag(T11, T22)

Rigid modes have poles at zero, mostly as chains of two. Their Hankel singular values are infinite,
so that no reduction may touch them.
"""

import numpy as np
import scipy.linalg

from mbmodel.export.system_matrices import SystemMatrices

# Of the largest pole: a pole of smaller size is that of a rigid mode. A double pole at zero comes
# out as the root of the rounding, 1e-8 of the largest pole.
_RIGID_SHARE = 1e-6
_MIN_DECAY_SHARE = 1e-9  # of a pole's size: a smaller decay is rounding, and the mode undamped


def split_stable_part(system: SystemMatrices) -> tuple[SystemMatrices, SystemMatrices]:
    """Return the stable part with the feed-through, and the rest without it; their sum is whole.

    Args:
        system: any linear system.
    """
    balanced = system.balance_units()
    poles = np.linalg.eigvals(balanced.a)
    smallest = _RIGID_SHARE * float(np.abs(poles).max(initial=0.0))

    def is_stable(real: float, imaginary: float = 0.0) -> bool:
        size = float(np.hypot(real, imaginary))
        return size > smallest and real < -_MIN_DECAY_SHARE * size

    form, basis, count = scipy.linalg.schur(balanced.a, output="real", sort=is_stable)
    inner, outer = form[:count, :count], form[count:, count:]
    coupling = scipy.linalg.solve_sylvester(inner, -outer, -form[:count, count:])
    drive, reading = basis.T @ balanced.b, balanced.c @ basis
    stable = SystemMatrices(
        inner, drive[:count] - coupling @ drive[count:], reading[:, :count], balanced.d
    )
    remainder = SystemMatrices(
        outer, drive[count:], reading[:, :count] @ coupling + reading[:, count:], 0 * balanced.d
    )
    return stable, remainder
