"""A request for FRFs: frequency lines, outputs, inputs and quantity."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Complex,
    Input,
    Output,
    Quantity,
    Real,
    UsageError,
)


@dataclass(frozen=True, eq=False)
class FrfRequest:
    """A request for FRFs of a model.

    An input is a hit at a point or body (``acc11:+tx``, per N or N m), an acceleration of the
    floor (``floor:+tx``, per m/s^2 or rad/s^2; the accelerance is then the transmissibility), or a
    motor (per unit of its control).

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        outputs: labels of the outputs.
        inputs: labels of the inputs.
        quantity: receptance, mobility or accelerance.
        window_tau: time constant of the exponential window in the data [s]; 0 for none.
        orders: derivative that each output reads, as its ports state it; empty if all read the
            quantity; n_out.
        base_order: derivative of the motion that is solved for; by default the quantity's.

    Raises:
        UsageError: a frequency is no finite number.
    """

    freq_hz: Real
    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    quantity: Quantity = "accelerance"
    window_tau: float = 0.0
    orders: tuple[int, ...] = ()
    base_order: int | None = None

    def __post_init__(self) -> None:
        """Check the frequency lines, whose order is free: quadratures join several grids."""
        freq_hz = np.asarray(self.freq_hz)
        if not np.isfinite(freq_hz).all():
            line = int(np.flatnonzero(~np.isfinite(freq_hz))[0])
            raise UsageError(f"frequency line {line} is {freq_hz[line]}: state finite frequencies")

    @cached_property
    def laplace(self) -> Complex:
        """The s = i w + 1 / tau of every line [rad/s]; (n_freq,)."""
        decay = 1.0 / self.window_tau if self.window_tau else 0.0
        return np.asarray(decay + 2j * np.pi * np.asarray(self.freq_hz), np.complex128)

    @property
    def order(self) -> int:
        """Number of differentiations q of the motion: 0, 1, 2 for receptance to accelerance.

        Outputs that read a higher derivative differentiate once or twice more.
        """
        if self.base_order is not None:
            return self.base_order
        return DERIVATIVE_ORDER[self.quantity]

    @property
    def output_orders(self) -> tuple[int, ...]:
        """Derivative that each output reads; n_out."""
        return self.orders or (self.order,) * len(self.outputs)

    @cached_property
    def output_powers(self) -> Complex | None:
        """The s^(k - q) of every output that reads the k-th derivative; (n_out, n_freq).

        None if all outputs read the quantity.
        """
        if not any(order != self.order for order in self.orders):
            return None
        return self.laplace ** (np.array(self.orders)[:, None] - self.order)

    @cached_property
    def factor(self) -> Complex:
        """The s^q of every line; (n_freq,)."""
        return self.laplace**self.order
