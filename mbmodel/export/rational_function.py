"""Rational functions of s with real coefficients, as poles and residues, and their states."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.words import Complex, Real


class HasStates(Protocol):
    """A stable function r(s) = constant + slope s + c (s - A)^-1 b with real coefficients."""

    @property
    def order(self) -> int:
        """Number of states."""

    @property
    def constant(self) -> float:
        """Value without states and slope."""

    @property
    def slope(self) -> float:
        """Coefficient of s [s]."""

    def at(self, laplace: Complex) -> Complex:
        """Return r(s) at each s; (n_freq,)."""

    def states(self) -> tuple[Real, Real, Real]:
        """Return A, b, c; (order, order), (order,), (order,)."""


@dataclass(frozen=True, eq=False)
class RationalFunction:
    """The function r(s) = constant + slope s + sum residue / (s - pole).

    Args:
        poles: real ones and, of each conjugate pair, the one above the real axis [rad/s];
            (n_pole,). The other one of a pair is implied.
        residues: of these poles; (n_pole,).
        constant: value without the fractions.
        slope: coefficient of s [s].
    """

    poles: Complex
    residues: Complex
    constant: float = 0.0
    slope: float = 0.0

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.poles) + int((self.poles.imag > 0).sum())

    def at(self, laplace: Complex) -> Complex:
        """Return r(s) at each s; (n_freq,)."""
        total = np.full(laplace.shape, self.constant, complex) + self.slope * laplace
        for pole, residue in zip(self.poles, self.residues, strict=True):
            total += residue / (laplace - pole)
            if pole.imag > 0:
                total += residue.conjugate() / (laplace - pole.conjugate())
        return total

    def states(self) -> tuple[Real, Real, Real]:
        """Return real A, b, c with sum residue / (s - pole) = c (s - A)^-1 b.

        A pair sigma +- i w with the residue a + i b is the block [[sigma, w], [-w, sigma]] with
        the input (2, 0) and the output (a, b).

        Returns:
            (order, order), (order,), (order,).
        """
        dynamics, drive, reading = np.zeros((self.order,) * 2), *np.zeros((2, self.order))
        place = 0
        for pole, residue in zip(self.poles, self.residues, strict=True):
            if pole.imag > 0:
                block = slice(place, place + 2)
                dynamics[block, block] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
                drive[place] = 2.0
                reading[block] = residue.real, residue.imag
                place += 2
            else:
                dynamics[place, place] = pole.real
                drive[place], reading[place] = 1.0, residue.real
                place += 1
        return dynamics, drive, reading
