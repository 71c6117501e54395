"""A request for FRFs: frequency lines, outputs, inputs and quantity."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import DERIVATIVE_ORDER, Complex, Dof, Input, Quantity, Real


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
    """

    freq_hz: Real
    outputs: tuple[Dof, ...]
    inputs: tuple[Input, ...]
    quantity: Quantity = "accelerance"
    window_tau: float = 0.0

    @cached_property
    def laplace(self) -> Complex:
        """The s = i w + 1 / tau of every line [rad/s]; (n_freq,)."""
        decay = 1.0 / self.window_tau if self.window_tau else 0.0
        return np.asarray(decay + 2j * np.pi * np.asarray(self.freq_hz), np.complex128)

    @property
    def order(self) -> int:
        """Number of differentiations q: 0, 1, 2 for receptance, mobility, accelerance."""
        return DERIVATIVE_ORDER[self.quantity]

    @cached_property
    def factor(self) -> Complex:
        """The s^q of every line; (n_freq,)."""
        factor: Complex = self.laplace**self.order
        return factor
