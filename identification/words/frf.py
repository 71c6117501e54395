"""Frequency response functions (FRFs), and estimates of them with variance and coherence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self, get_args

import numpy as np

from identification.words._arrays import (
    MAX_FREQUENCY_HZ,
    MAX_INPUT_MAGNITUDE,
    MIN_FREQUENCY_HZ,
    Complex,
    Integers,
    Mask,
    Real,
    frozen_array,
)
from identification.words.errors import UsageError
from identification.words.names import shorten_names
from identification.words.ports import Dof, Input, Output, Signal

Quantity = Literal["receptance", "mobility", "accelerance"]
VarianceSource = Literal["coherence", "differences", "stated"]
# Number of time derivatives of displacement in each quantity.
DERIVATIVE_ORDER: dict[Quantity, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}


def parse_quantity(text: str) -> Quantity:
    """Return the quantity that a text names.

    Raises:
        UsageError: it names none.
    """
    if text not in DERIVATIVE_ORDER:
        raise UsageError(f"{text!r} is no quantity: write one of {', '.join(DERIVATIVE_ORDER)}")
    return text


@dataclass(frozen=True, eq=False)
class Frf:
    """Labelled frequency response functions: motion per force, time convention exp(+i w t).

    Args:
        freq_hz: frequencies [Hz], strictly increasing, not negative; (n_freq,).
        values: H [m/N, m/(N s) or m/(N s^2), rad for rotations]; (n_freq, n_out, n_in).
        outputs: degrees of freedom whose motion is read, each once; n_out.
        inputs: degrees of freedom at which the force acts, or motors, each once; n_in.
        quantity: receptance, mobility or accelerance.

    Raises:
        ValueError: a shape, order, label or value contradicts this description.
    """

    freq_hz: Real
    values: Complex
    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    quantity: Quantity

    def __post_init__(self) -> None:
        """Validate and freeze."""
        freq = frozen_array(self.freq_hz, np.float64, (None,), "freq_hz", MAX_FREQUENCY_HZ)
        if freq.size == 0 or freq[0] < 0 or not (np.diff(freq) > 0).all():
            raise ValueError("freq_hz must be non-empty, not negative and strictly increasing")
        if 0 < freq[-1] < MIN_FREQUENCY_HZ:
            raise ValueError(f"freq_hz ends at {freq[-1]:g} Hz, below {MIN_FREQUENCY_HZ:g} Hz")
        shape = (freq.size, len(self.outputs), len(self.inputs))
        values = frozen_array(self.values, np.complex128, shape, "values", MAX_INPUT_MAGNITUDE)
        sides: tuple[tuple[str, Sequence[Input]], ...] = (
            ("output", self.outputs),
            ("input", self.inputs),
        )
        for side, dofs in sides:
            if wrong := [dof for dof in dofs if not isinstance(dof, Dof | Signal)]:
                raise ValueError(f"an {side} is {wrong[0]!r}, expected a Dof or a Signal")
            if len({dof.positive for dof in dofs}) < len(dofs):
                raise ValueError(f"an {side} appears twice: {', '.join(map(str, dofs))}")
        if self.quantity not in DERIVATIVE_ORDER:
            raise ValueError(f"quantity {self.quantity!r} is none of {', '.join(DERIVATIVE_ORDER)}")
        object.__setattr__(self, "freq_hz", freq)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "inputs", tuple(self.inputs))

    def select(self, outputs: Sequence[Output], inputs: Sequence[Input]) -> Self:
        """Select outputs and inputs by label, in this order, with the signs of these labels.

        Raises:
            UsageError: the FRFs do not have one of the labels.
        """
        rows, row_signs = _find(self.outputs, outputs, "outputs")
        columns, column_signs = _find(self.inputs, inputs, "inputs")
        values = self.values[:, rows][:, :, columns] * np.outer(row_signs, column_signs)
        return replace(self, values=values, outputs=tuple(outputs), inputs=tuple(inputs))

    def __getitem__(self, labels: tuple[str | Input, str | Input]) -> Complex:
        """Return the curve of one output and one input, with the signs of the labels.

        Args:
            labels: output and input, such as ``frf["acc1:+tx", "acc11:+ty"]``.

        Returns:
            H; (n_freq,).

        Raises:
            UsageError: the FRFs do not have one of the labels.
        """
        if not isinstance(labels, tuple) or len(labels) != 2:
            raise UsageError(
                f"{labels!r} does not name one FRF: write frf[output, input], such as "
                'frf["acc1:+tx", "acc11:+ty"]'
            )
        output, source = labels
        row, row_sign = _position(self.outputs, output, "outputs")
        column, column_sign = _position(self.inputs, source, "inputs")
        return row_sign * column_sign * self.values[:, row, column]

    def __repr__(self) -> str:
        """Return quantity, lines and labels in a few lines."""
        return "\n".join(
            (
                f"{self.quantity}, {len(self.freq_hz)} lines "
                f"{self.freq_hz[0]:g}..{self.freq_hz[-1]:g} Hz",
                f"  outputs: {shorten_names(self.outputs)}",
                f"  inputs: {shorten_names(self.inputs)}",
            )
        )

    def select_lines(self, chosen: Mask | slice) -> Self:
        """Return the FRFs on these frequency lines alone.

        Args:
            chosen: mask (n_freq,) or slice of the lines.
        """
        return replace(self, freq_hz=self.freq_hz[chosen], values=self.values[chosen])

    def as_quantity(self, quantity: Quantity) -> Self:
        """Convert to another quantity: mobility = i w receptance, accelerance = i w mobility.

        Raises:
            UsageError: the conversion would integrate at 0 Hz, where no value exists.
        """
        steps = DERIVATIVE_ORDER[quantity] - DERIVATIVE_ORDER[self.quantity]
        if steps < 0 and self.freq_hz[0] == 0:
            raise UsageError(f"{self.quantity} at 0 Hz has no {quantity}: drop the line at 0 Hz")
        factor = (2j * np.pi * self.freq_hz[:, None, None]) ** steps
        return replace(self, values=self.values * factor, quantity=quantity)


def _position(available: Sequence[Input], label: str | Input, side: str) -> tuple[int, int]:
    """Return the position of a label and its sign relative to the available one."""
    if not isinstance(label, str | Dof | Signal):
        raise UsageError(f"{label!r} is not a label: write text such as acc11:+tx, or a Dof")
    if isinstance(label, str):
        names = {str(dof): dof for dof in available}
        label = names[label] if label in names else Dof.parse(label)
    rows, signs = _find(available, [label], side)
    return rows[0], signs[0]


def _find(
    available: Sequence[Input], wanted: Sequence[Input], side: str
) -> tuple[list[int], list[int]]:
    """Return the positions of the wanted labels and their signs relative to the available ones."""
    index = {dof.positive: i for i, dof in enumerate(available)}
    missing = [str(dof) for dof in wanted if dof.positive not in index]
    if missing:
        raise UsageError(f"{', '.join(missing)} is not among the {len(available)} {side}")
    rows = [index[dof.positive] for dof in wanted]
    return rows, [dof.sign * available[row].sign for dof, row in zip(wanted, rows, strict=True)]


@dataclass(frozen=True, eq=False)
class FrfEstimate:
    """FRFs estimated from a test, with the variance of each value.

    Cells of the (out, in) table that were not measured hold zeros; ``measured`` masks them.

    Args:
        frf: estimated FRFs; zero in cells that were not measured.
        variance: E|error|^2, real plus imaginary part [unit of frf squared];
            (n_freq, n_out, n_in).
        variance_source: origin of the variance: ``coherence``, ``differences`` along frequency, or
            ``stated`` by the file, or by the periods of a force that repeats.
        measured: which cells were measured; (n_out, n_in).
        coherence: ordinary coherence 0..1, or None if unknown; (n_freq, n_out, n_in).
        averages: number of averaged hits, or None if unknown.
        window_tau: time constant of the exponential window whose effect the FRFs contain [s];
            0 for no window.
        shared: part 0..1 of the variance that neighbouring lines have in common, or None where
            their errors are independent; (n_freq, n_out, n_in).

    Raises:
        ValueError: a shape or range contradicts this description.
    """

    frf: Frf
    variance: Real
    variance_source: VarianceSource
    measured: Mask
    coherence: Real | None = None
    averages: int | None = None
    window_tau: float = 0.0
    shared: Real | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        shape = self.frf.values.shape
        variance = frozen_array(self.variance, np.float64, shape, "variance")
        if (variance < 0).any():
            raise ValueError("variance is negative")
        object.__setattr__(self, "variance", variance)
        measured = frozen_array(self.measured, np.bool_, shape[1:], "measured")
        object.__setattr__(self, "measured", measured)
        if self.shared is not None:
            shared = frozen_array(self.shared, np.float64, shape, "shared")
            object.__setattr__(self, "shared", shared)
        if self.coherence is not None:
            coherence = frozen_array(self.coherence, np.float64, shape, "coherence")
            if (coherence < 0).any() or (coherence > 1).any():
                raise ValueError("coherence is outside 0..1")
            object.__setattr__(self, "coherence", coherence)
        if self.variance_source not in get_args(VarianceSource):
            raise ValueError(
                f"variance_source is {self.variance_source!r}, expected one of "
                f"{', '.join(get_args(VarianceSource))}"
            )
        if self.averages is not None and not (
            isinstance(self.averages, int | np.integer) and self.averages >= 1
        ):
            raise ValueError(f"averages is {self.averages!r}, expected a whole number from 1")
        if not 0 <= self.window_tau < np.inf:
            raise ValueError(f"window_tau is {self.window_tau} s, expected 0 or more")

    def __repr__(self) -> str:
        """Return the FRFs' summary and the origin of their variance in a few lines."""
        hits = "" if self.averages is None else f", {self.averages} averages"
        return f"{self.frf!r}\n  variance from {self.variance_source}{hits}"

    @property
    def reads_zero(self) -> Mask:
        """Which cells hold zero at every line: not measured, or a dead channel; (n_out, n_in)."""
        return np.asarray(~self.frf.values.any(axis=0))

    def select_lines(self, chosen: Mask | slice) -> Self:
        """Return the estimate on these frequency lines alone.

        Args:
            chosen: mask (n_freq,) or slice of the lines.
        """
        return replace(
            self,
            frf=self.frf.select_lines(chosen),
            variance=self.variance[chosen],
            coherence=None if self.coherence is None else self.coherence[chosen],
            shared=None if self.shared is None else self.shared[chosen],
        )

    def select_outputs(self, rows: Sequence[int] | Integers) -> Self:
        """Return the estimate of these outputs alone, in this order.

        Args:
            rows: numbers of the outputs.
        """
        frf, coherence = self.frf, self.coherence
        if list(rows) == list(range(len(frf.outputs))):
            return self
        outputs = tuple(frf.outputs[row] for row in rows)
        return replace(
            self,
            frf=replace(frf, values=frf.values[:, rows], outputs=outputs),
            variance=self.variance[:, rows],
            measured=self.measured[rows],
            coherence=None if coherence is None else coherence[:, rows],
            shared=None if self.shared is None else self.shared[:, rows],
        )
