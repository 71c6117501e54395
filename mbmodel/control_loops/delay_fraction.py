"""Pade's fraction of a delay, as a ladder of springs and masses: exact integers, no zeros needed.

exp(-x) = (1 - z) / (1 + z) with z = tanh(x / 2), whose continued fraction (Gauss)

    z = 1 / (1/y + 1 / (3/y + 1 / (5/y + ...))),   y = x / 2

cut after n terms gives the fraction of order n in numerator and denominator (Baker and
Graves-Morris 1996, ch. 4). It is the impedance of a ladder without loss, so that the fraction has
magnitude one at every frequency. Poles and residues of it lose all digits beyond order 10, the
ladder none.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real


@dataclass(frozen=True)
class DelayFraction:
    """Pade's fraction of exp(-s tau), minus 1.

    Args:
        delay_s: tau [s].
        order: n.
    """

    delay_s: float
    order: int

    @property
    def constant(self) -> float:
        """Value at infinite frequency."""
        return (-1.0) ** self.order - 1.0

    @property
    def slope(self) -> float:
        """Coefficient of s: none."""
        return 0.0

    def at(self, laplace: Complex) -> Complex:
        """Return it at each s, by the continued fraction from its end; (n_freq,)."""
        y = laplace * self.delay_s / 2
        above, below = np.zeros_like(y), np.ones_like(y)  # of z
        for term in range(2 * self.order - 1, 0, -2):
            above, below = y * below, term * below + y * above
            size = np.maximum(np.abs(above), np.abs(below))
            above, below = above / size, below / size
        fraction: Complex = -2 * above / (above + below)
        return fraction

    def states(self) -> tuple[Real, Real, Real]:
        """Return real A, b, c with fraction - constant = c (s - A)^-1 b.

        Link k of the ladder has the state x_k and the rate 2 k - 1 per y. With q the sum of the
        states of links of the parity of n, and p = 2 u - q, the fraction is (-1)^n (u - q). Links
        of that parity are driven by p, the others by q, less all states of the kind of their drive
        before them.

        Returns:
            (order, order), (order,), (order,).
        """
        n = self.order
        dynamics, drive = np.zeros((n, n)), np.zeros(n)
        is_last_kind = (np.arange(1, n + 1) % 2) == n % 2
        for k in range(1, n + 1):
            rate = 2 * k - 1
            before = np.arange(1, n + 1) < k
            if k % 2 == n % 2:
                dynamics[k - 1] = -rate * (is_last_kind | (~is_last_kind & before))
                drive[k - 1] = 2.0 * rate
            else:
                dynamics[k - 1] = rate * (is_last_kind & ~before)
        unit = 2 / self.delay_s
        return unit * dynamics, unit * drive, -((-1.0) ** n) * is_last_kind
