"""Discretisation by a zero-order hold, with delays of the inputs held exactly.

Over a sampling period T the input is constant, and it arrives late by tau = l T + f, 0 <= f < T. So
within each period the old value acts for a time f, and the new one for the rest (the modified z
transform; Astrom and Wittenmark 1997, sec. 2.3):

    x[k+1] = Phi x[k] + Gamma_1 u[k-l-1] + Gamma_0 u[k-l],    Phi = exp(A T)
    Gamma_0 = int_0^(T-f) exp(A s) ds B,   Gamma_1 = exp(A (T-f)) int_0^f exp(A s) ds B
    y[k] = C x[k] + D u(k T - tau)

At the instant k T the input that has arrived is u[k-l], or u[k-l-1] with a fraction f. Old values
of the inputs are further states, so that nothing is approximated.

``cont2discrete`` of SciPy, which python-control calls, knows no delays. Without them it agrees to
8e-15 for the micro-station of 78 states, in as much time for one exponential. With inputs a million
times larger it keeps 14 digits where this keeps 16, and its import takes longer than a command.

The four matrices of a linear system, and its response.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import scipy.linalg

from identification.words import Complex, InputError, Real
from mbmodel.linearisation.motors import Activation


@dataclass(frozen=True, eq=False)
class SystemMatrices:
    """A linear system x' = A x + B u, y = C x + D u.

    Args:
        a: (n, n).
        b: (n, n_in).
        c: (n_out, n).
        d: (n_out, n_in).
    """

    a: Real
    b: Real
    c: Real
    d: Real

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def balance_units(self) -> "SystemMatrices":
        """Return the system with units of its states in which the entries of A are of like size."""
        if not self.order:
            return self
        a, (units, _) = scipy.linalg.matrix_balance(self.a, permute=False, separate=True)
        return SystemMatrices(a, self.b / units[:, None], self.c * units, self.d)

    def at(self, laplace: Complex) -> Complex:
        """Return C (s - A)^-1 B + D at each s; (n_freq, n_out, n_in).

        Args:
            laplace: s [rad/s], or z of a system in discrete time; (n_freq,).
        """
        system = self.balance_units()
        values = np.empty((len(laplace), *self.d.shape), complex)
        unit = np.eye(system.order)
        for k, s in enumerate(laplace):
            values[k] = system.c @ np.linalg.solve(s * unit - system.a, system.b) + system.d
        return values

    def behind(self, activations: Sequence[Activation | None]) -> "SystemMatrices":
        """Return the system whose inputs act through actuators with a state, the last ones of x.

        Args:
            activations: of each input; None for one that acts at once; n_in.
        """
        lagged = {k: each for k, each in enumerate(activations) if each is not None}
        if not lagged:
            return self
        places, rates = [*lagged], np.diag([each.rate for each in lagged.values()])
        b, c, d = self.b.copy(), np.hstack([self.c, self.d[:, places]]), self.d.copy()
        b[:, places] = d[:, places] = 0.0
        drives = np.zeros((len(lagged), len(activations)))
        drives[np.arange(len(lagged)), places] = [each.drive for each in lagged.values()]
        below = np.zeros((len(lagged), self.order))
        a = np.block([[self.a, self.b[:, places]], [below, -rates]])
        return SystemMatrices(a, np.vstack([b, drives]), c, d)

    def join(self, parallel: "SystemMatrices") -> "SystemMatrices":
        """Return the sum of two systems, the states of this one first."""
        return SystemMatrices(
            scipy.linalg.block_diag(self.a, parallel.a),
            np.vstack([self.b, parallel.b]),
            np.hstack([self.c, parallel.c]),
            self.d + parallel.d,
        )


_MAX_DELAY_PERIODS = 10_000  # of an input: each period is a state
_WHOLE_PERIOD_SHARE = 1e-9  # of a period: a fraction nearer to a whole period is rounding


@dataclass(frozen=True, eq=False)
class SampledSystem:
    """A system in discrete time.

    Args:
        system: x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k].
        period_s: sampling period [s].
        delay_states: names of the states that hold old inputs, ``(input number, periods ago)``;
            they follow the states of the machine.
    """

    system: SystemMatrices
    period_s: float
    delay_states: tuple[tuple[int, int], ...]


def discretise(system: SystemMatrices, period_s: float, delays_s: Real) -> SampledSystem:
    """Return the zero-order-hold equivalent of a system whose inputs arrive late.

    Args:
        system: in continuous time.
        period_s: T [s].
        delays_s: tau of each input [s]; (n_in,).

    Raises:
        InputError: a delay of more than 10000 periods.
    """
    lateness = [split_delay(float(delay), period_s) for delay in delays_s]
    whole = system.balance_units()
    hold = cache(partial(_hold, whole))  # inputs of one delay share it
    memory = [periods + (fraction > 0) for periods, fraction in lateness]
    first = whole.order + np.cumsum([0, *memory])  # state of each input's last value
    size, order = int(first[-1]), whole.order
    table = np.zeros((size + len(whole.c), size + len(memory)))  # [[A, B], [C, D]]
    table[:order, :order], table[size:, :order] = hold(period_s)[0], whole.c

    def place(number: int, age: int) -> int:
        """Return the column of an input's value of some periods ago."""
        return size + number if age == 0 else int(first[number]) + age - 1

    for number, (periods, fraction) in enumerate(lateness):
        remaining, new = hold(period_s - fraction)
        table[:order, place(number, periods)] += new[:, number]
        if fraction > 0:
            old = remaining @ hold(fraction)[1][:, number]
            table[:order, place(number, periods + 1)] += old
        table[size:, place(number, memory[number])] += whole.d[:, number]
        for age in range(memory[number]):
            table[int(first[number]) + age, place(number, age)] = 1.0
    names = [(number, age + 1) for number, count in enumerate(memory) for age in range(count)]
    held = SystemMatrices(
        table[:size, :size], table[:size, size:], table[size:, :size], table[size:, size:]
    )
    return SampledSystem(held, period_s, tuple(names))


def split_delay(delay: float, period: float) -> tuple[int, float]:
    """Return the whole periods of a delay, and the rest [s].

    Raises:
        InputError: a delay of more than 10000 periods.
    """
    if delay > _MAX_DELAY_PERIODS * period:
        raise InputError(
            f"a delay of {delay:g} s is more than {_MAX_DELAY_PERIODS} sampling periods of "
            f"{period:g} s: give both in s"
        )
    periods = int(np.floor(delay / period + _WHOLE_PERIOD_SHARE))
    fraction = delay - periods * period
    return periods, fraction if fraction > _WHOLE_PERIOD_SHARE * period else 0.0


def _hold(system: SystemMatrices, time: float) -> tuple[Real, Real]:
    """Return exp(A t) and int_0^t exp(A s) ds B by one exponential (Van Loan 1978)."""
    order, n_in = system.b.shape
    # the input per unit of its largest column, so that the norm is that of A
    unit = max(float(np.abs(system.b).max(initial=0.0)), np.finfo(float).tiny)
    extended = np.zeros((order + n_in, order + n_in))
    extended[:order, :order], extended[:order, order:] = system.a, system.b / unit
    power = scipy.linalg.expm(extended * time)
    return power[:order, :order], power[:order, order:] * unit
