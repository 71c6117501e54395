"""The law K(s) exp(-s tau) of a control loop, and its states with Pade's fraction of the delay.

A sampled controller has the law K(z) h(s) exp(-s tau), h its zero-order hold. The images of a
sampled signal at other frequencies are left out: they change the plant as the loop sees it by a
part of the order (f T)^2. In states the controller is the continuous one of Tustin's rule,
s = (2 / T) (z - 1) / (z + 1), and the hold a delay of T / 2.

Pade's fraction of a delay, as a ladder of springs and masses: exact integers, no zeros needed.

exp(-x) = (1 - z) / (1 + z) with z = tanh(x / 2), whose continued fraction (Gauss)

    z = 1 / (1/y + 1 / (3/y + 1 / (5/y + ...))),   y = x / 2

cut after n terms gives the fraction of order n in numerator and denominator (Baker and
Graves-Morris 1996, ch. 4). It is the impedance of a ladder without loss, so that the fraction has
magnitude one at every frequency. Poles and residues of it lose all digits beyond order 10, the
ladder none.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, Controller, Real, UsageError
from mbmodel.linearisation.motors import Activation


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
        return -2 * above / (above + below)

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


# A controller that integrates has no value at s = 0; there it is taken at this real s [rad/s], far
# below the bandwidth of any loop.
_LOWEST_RATE_RAD_S = 1e-6
# Of exp(-s tau) far left in the plane, where searches of poles may pass: no pole lies beyond.
_MAX_EXPONENT = 300.0
# Of A + 1 of a sampled controller: beyond it a pole lies at z = -1.
_MAX_RAISED_CONDITION = 1e12


@dataclass(frozen=True, eq=False)
class LoopLaw:
    """The law K(s) exp(-s tau).

    Args:
        controller: K.
        delay_s: tau [s].
        activation: of the actuator, which the law then contains; None if it has no state.
    """

    controller: Controller
    delay_s: float
    activation: Activation | None = None

    def __call__(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        is_static = laplace == 0
        rates = np.where(is_static, _LOWEST_RATE_RAD_S, laplace) if is_static.any() else laplace
        rates = np.asarray(rates, np.complex128)
        gain = self.controller.response(rates)
        gain = gain if self.activation is None else gain * self.activation(rates)
        exponent = -laplace * self.delay_s
        growth = np.minimum(exponent.real, _MAX_EXPONENT) + 1j * exponent.imag
        return np.asarray(gain * np.exp(growth), np.complex128)

    @property
    def states_delay_s(self) -> float:
        """Delay of the states, with that of the hold [s]."""
        return self.delay_s + self.controller.period_s / 2


def continuous_equivalent(controller: Controller) -> Controller:
    """Return the continuous controller that Tustin's rule makes of a sampled one.

    With z = (1 + x) / (1 - x), x = s T / 2, and M = (A + 1)^-1 (A - 1),

        C (z - A)^-1 B + D = D - C (A + 1)^-1 B + 2 C (A + 1)^-2 (x - M)^-1 B

    Raises:
        UsageError: a pole at z = -1, which has no continuous counterpart.
    """
    if not controller.period_s:
        return controller
    raised = controller.dynamics + np.eye(len(controller.dynamics))
    if len(raised) and np.linalg.cond(raised) > _MAX_RAISED_CONDITION:
        raise UsageError(
            "the sampled controller has a pole at z = -1, which has no continuous counterpart: "
            "filter it below half of the sampling rate"
        )
    rate, unit = 2 / controller.period_s, np.eye(len(raised))
    inverse: Real = np.asarray(np.linalg.inv(raised), np.float64)
    entry: Real = inverse @ controller.input_matrix
    return Controller(
        rate * inverse @ (controller.dynamics - unit),
        entry,
        2 * rate * controller.output_matrix @ inverse,
        controller.feedthrough - controller.output_matrix @ entry,
    )


@dataclass(frozen=True, eq=False)
class LoopFraction:
    """A loop's law with Pade's fraction in place of its delay, in states: it ``HasStates``.

    The controller x' = A x + B y, v = C x + D y is followed by the fraction 1 + f(s). It is the
    continuous equivalent of a sampled one.

    Args:
        law: of the loop.
        delay_order: of Pade's fraction; 0 without a delay.
    """

    law: LoopLaw
    delay_order: int

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self._controller.dynamics) + self.delay_order

    @property
    def constant(self) -> float:
        """Value at infinite frequency."""
        through = float(self._controller.feedthrough[0, 0])
        return through * (1.0 + self._delay.constant) if self.delay_order else through

    @property
    def slope(self) -> float:
        """Coefficient of s: none."""
        return 0.0

    def at(self, laplace: Complex) -> Complex:
        """Return it at each s; (n_freq,)."""
        gain = self._controller.response(laplace)
        return gain * (1.0 + self._delay.at(laplace)) if self.delay_order else gain

    def states(self) -> tuple[Real, Real, Real]:
        """Return A, b, c with K (1 + f) - constant = c (s - A)^-1 b.

        Returns:
            (order, order), (order,), (order,).
        """
        controller = self._controller
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
        return DelayFraction(self.law.states_delay_s, self.delay_order)

    @cached_property
    def _controller(self) -> Controller:
        """The controller in continuous time, with the state of the actuator behind it."""
        controller, activation = continuous_equivalent(self.law.controller), self.law.activation
        if activation is None:
            return controller
        count, drive = len(controller.dynamics), activation.drive
        return Controller(
            np.block(
                [
                    [controller.dynamics, np.zeros((count, 1))],
                    [drive * controller.output_matrix, np.array([[-activation.rate]])],
                ]
            ),
            np.vstack([controller.input_matrix, drive * controller.feedthrough]),
            np.eye(1, count + 1, count),
            np.zeros((1, 1)),
        )
