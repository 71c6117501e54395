"""The law K(s) exp(-s tau) of a control loop, and its states with Pade's fraction of the delay."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Controller, Real
from mbmodel.export.delay_fraction import DelayFraction

# A controller that integrates has no value at s = 0; there it is taken at this real s [rad/s], far
# below the bandwidth of any loop.
_LOWEST_RATE_RAD_S = 1e-6
# Of exp(-s tau) far left in the plane, where searches of poles may pass: no pole lies beyond.
_MAX_EXPONENT = 300.0


@dataclass(frozen=True, eq=False)
class LoopLaw:
    """The law K(s) exp(-s tau).

    Args:
        controller: K.
        delay_s: tau [s].
    """

    controller: Controller
    delay_s: float

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        is_static = laplace == 0
        rates = np.where(is_static, _LOWEST_RATE_RAD_S, laplace) if is_static.any() else laplace
        gain = self.controller.response(np.asarray(rates, np.complex128))
        exponent = -laplace * self.delay_s
        growth = np.minimum(exponent.real, _MAX_EXPONENT) + 1j * exponent.imag
        return np.asarray(gain * np.exp(growth), np.complex128)


@dataclass(frozen=True, eq=False)
class LoopFraction:
    """A loop's law with Pade's fraction in place of its delay, in states: it ``HasStates``.

    The controller x' = A x + B y, v = C x + D y is followed by the fraction 1 + f(s).

    Args:
        law: of the loop.
        delay_order: of Pade's fraction; 0 without a delay.
    """

    law: LoopLaw
    delay_order: int

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.law.controller.dynamics) + self.delay_order

    @property
    def constant(self) -> float:
        """Value at infinite frequency."""
        through = float(self.law.controller.feedthrough[0, 0])
        return through * (1.0 + self._delay.constant) if self.delay_order else through

    @property
    def slope(self) -> float:
        """Coefficient of s: none."""
        return 0.0

    def at(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        gain = self.law.controller.response(laplace)
        return gain * (1.0 + self._delay.at(laplace)) if self.delay_order else gain

    def states(self) -> tuple[Real, Real, Real]:
        """Return A, b, c with K (1 + f) - constant = c (s - A)^-1 b.

        Returns:
            (order, order), (order,), (order,).
        """
        controller = self.law.controller
        matrices = controller.dynamics, controller.input_matrix, controller.output_matrix
        a, b, c = matrices[0], matrices[1][:, 0], matrices[2][0]
        if not self.delay_order:
            return a, b, c
        through = float(controller.feedthrough[0, 0])
        dynamics, drive, reading = self._delay.states()
        zero = np.zeros((len(a), len(dynamics)))
        return (
            np.block([[a, zero], [np.outer(drive, c), dynamics]]),
            np.concatenate([b, through * drive]),
            np.concatenate([(1.0 + self._delay.constant) * c, reading]),
        )

    @property
    def _delay(self) -> DelayFraction:
        """Pade's fraction, minus 1."""
        return DelayFraction(self.law.delay_s, self.delay_order)
