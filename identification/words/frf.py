"""Frequency response functions, and what a test knows about them beside their values."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from identification.words._arrays import Complex, Mask, Real, frozen
from identification.words.dof import Dof
from identification.words.errors import UsageError
from identification.words.motor import Input

Quantity = Literal["receptance", "mobility", "accelerance"]
VarianceSource = Literal["coherence", "differences"]
ORDER: dict[Quantity, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}


@dataclass(frozen=True, eq=False)
class Frf:
    """Labelled frequency response functions: motion per force, time convention exp(+i w t).

    Args:
        freq_hz: frequencies [Hz], strictly increasing, not negative; (n_freq,).
        values: H [m/N, m/(N s) or m/(N s^2), rad for rotations]; (n_freq, n_out, n_in).
        outputs: where and along what the motion is read, each once; n_out.
        inputs: where and along what the force acts, or which motor drives, each once; n_in.
        quantity: receptance, mobility or accelerance.

    Raises:
        ValueError: shapes, order, labels or values that contradict this.
    """

    freq_hz: Real
    values: Complex
    outputs: tuple[Dof, ...]
    inputs: tuple[Input, ...]
    quantity: Quantity

    def __post_init__(self) -> None:
        """Validate and freeze."""
        freq = frozen(self.freq_hz, np.float64, (None,), "freq_hz")
        if freq.size == 0 or freq[0] < 0 or not (np.diff(freq) > 0).all():
            raise ValueError("freq_hz must be non-empty, not negative and strictly increasing")
        shape = (freq.size, len(self.outputs), len(self.inputs))
        values = frozen(self.values, np.complex128, shape, "values")
        sides: tuple[tuple[str, Sequence[Input]], ...] = (
            ("output", self.outputs),
            ("input", self.inputs),
        )
        for side, dofs in sides:
            if len({dof.positive for dof in dofs}) < len(dofs):
                raise ValueError(f"an {side} appears twice: {', '.join(map(str, dofs))}")
        if self.quantity not in ORDER:
            raise ValueError(f"{self.quantity!r} is none of {', '.join(ORDER)}")
        object.__setattr__(self, "freq_hz", freq)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "inputs", tuple(self.inputs))

    def select(self, outputs: Sequence[Dof], inputs: Sequence[Input]) -> Self:
        """Take these outputs and inputs by label, in this order, turning signs as needed.

        Raises:
            UsageError: a label that is not there.
        """
        rows, row_signs = _find(self.outputs, outputs, "outputs")
        columns, column_signs = _find(self.inputs, inputs, "inputs")
        values = self.values[:, rows][:, :, columns] * np.outer(row_signs, column_signs)
        return replace(self, values=values, outputs=tuple(outputs), inputs=tuple(inputs))

    def lines(self, chosen: Mask | slice) -> Self:
        """Keep these frequency lines."""
        return replace(self, freq_hz=self.freq_hz[chosen], values=self.values[chosen])

    def as_quantity(self, quantity: Quantity) -> Self:
        """Convert by powers of i w: mobility = i w receptance, accelerance = i w mobility.

        Raises:
            UsageError: integration at 0 Hz, which has no value.
        """
        steps = ORDER[quantity] - ORDER[self.quantity]
        if steps < 0 and self.freq_hz[0] == 0:
            raise UsageError(f"{self.quantity} at 0 Hz has no {quantity}: drop the line at 0 Hz")
        factor = (2j * np.pi * self.freq_hz[:, None, None]) ** steps
        return replace(self, values=self.values * factor, quantity=quantity)


def _find(have: Sequence[Input], want: Sequence[Input], side: str) -> tuple[list[int], list[int]]:
    index = {dof.positive: i for i, dof in enumerate(have)}
    missing = [str(dof) for dof in want if dof.positive not in index]
    if missing:
        raise UsageError(f"{', '.join(missing)} is not among the {len(have)} {side}")
    rows = [index[dof.positive] for dof in want]
    return rows, [dof.sign * have[row].sign for dof, row in zip(want, rows, strict=True)]


@dataclass(frozen=True, eq=False)
class FrfEstimate:
    """An FRF estimated from a test, with how well each of its values is known.

    Cells of the (out, in) table that were not measured hold zeros and are masked.

    Args:
        frf: the estimate; unmeasured cells zero.
        variance: E|error|^2, real plus imaginary part [unit of frf squared];
            (n_freq, n_out, n_in).
        variance_source: ``coherence``, or ``differences`` along frequency.
        measured: which cells were measured; (n_out, n_in).
        coherence: ordinary coherence 0..1, or None if the test does not have it.
        averages: hits per estimate, or None if unknown.
        window_tau: time constant of an exponential window that the data still carry [s];
            0 for none.

    Raises:
        ValueError: shapes or ranges that contradict this.
    """

    frf: Frf
    variance: Real
    variance_source: VarianceSource
    measured: Mask
    coherence: Real | None = None
    averages: int | None = None
    window_tau: float = 0.0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        shape = self.frf.values.shape
        variance = frozen(self.variance, np.float64, shape, "variance")
        if (variance < 0).any():
            raise ValueError("variance is negative")
        object.__setattr__(self, "variance", variance)
        measured = frozen(self.measured, np.bool_, shape[1:], "measured")
        object.__setattr__(self, "measured", measured)
        if self.coherence is not None:
            coherence = frozen(self.coherence, np.float64, shape, "coherence")
            if (coherence < 0).any() or (coherence > 1).any():
                raise ValueError("coherence is outside 0..1")
            object.__setattr__(self, "coherence", coherence)
        if self.averages is not None and self.averages < 1:
            raise ValueError(f"averages is {self.averages}, expected at least 1")
        if not 0 <= self.window_tau < np.inf:
            raise ValueError(f"window_tau is {self.window_tau} s, expected 0 or more")

    def lines(self, chosen: Mask | slice) -> Self:
        """Keep these frequency lines."""
        return replace(
            self,
            frf=self.frf.lines(chosen),
            variance=self.variance[chosen],
            coherence=None if self.coherence is None else self.coherence[chosen],
        )
