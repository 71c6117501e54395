"""Paths, labels, frequencies and quantities as users write them."""

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from identification.words import (
    Dof,
    Input,
    Output,
    Quantity,
    Real,
    Signal,
    UsageError,
    parse_quantity,
)
from mbmodel import FrfRequest, Machine, parse_input, parse_output, usual_quantity

AnyPath = str | PathLike[str]
AnyLabel = str | Input


def as_path(path: AnyPath) -> Path:
    """Return a path that may be given as text, with ``~`` for the home folder."""
    return Path(path).expanduser()


def parse_outputs(machine: Machine, labels: AnyLabel | Iterable[AnyLabel]) -> tuple[Output, ...]:
    """Return outputs as degrees of freedom or signals.

    Args:
        machine: its joints and MuJoCo sensors may be named.
        labels: one label or several: ``acc11:+tx``, ``joint:ty_tx``, or the name of a sensor.

    Raises:
        UsageError: a text is no output of the machine.
    """
    return tuple(
        parse_output(machine, label) if isinstance(label, str) else label
        for label in as_labels(labels)
    )


def parse_inputs(machine: Machine, labels: AnyLabel | Iterable[AnyLabel]) -> tuple[Input, ...]:
    """Return inputs as degrees of freedom or motors.

    Args:
        machine: its motors may be named.
        labels: one label or several: ``acc11:+tx``, ``floor:+tx``, or the name of a motor.

    Raises:
        UsageError: a text is neither a label nor a motor.
    """
    return tuple(
        parse_input(machine, label) if isinstance(label, str) else label
        for label in as_labels(labels)
    )


def check_frequencies(freq_hz: Sequence[float] | Real) -> Real:
    """Return frequency lines as an array after checking them.

    Args:
        freq_hz: frequencies [Hz]; (n_freq,).

    Raises:
        UsageError: a frequency is NaN, infinite or negative, or they do not increase.
    """
    try:
        lines = np.asarray(freq_hz, np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"freq_hz: {error}; give frequencies [Hz] as numbers") from error
    if lines.ndim != 1 or not lines.size or not np.isfinite(lines).all():
        raise UsageError("freq_hz: give finite frequencies [Hz] in one dimension, at least one")
    if lines[0] < 0 or not (np.diff(lines) > 0).all():
        raise UsageError("freq_hz: frequencies [Hz] must be not negative and strictly increasing")
    return lines


def parse_request(
    machine: Machine,
    outputs: AnyLabel | Iterable[AnyLabel],
    inputs: AnyLabel | Iterable[AnyLabel],
    freq_hz: Sequence[float] | Real,
    quantity: Quantity | None,
) -> FrfRequest:
    """Return a request of FRFs as a user writes it; see ``Model.frf``."""
    lines, readings = check_frequencies(freq_hz), parse_outputs(machine, outputs)
    chosen = usual_quantity(readings) if quantity is None else parse_quantity(quantity)
    return FrfRequest(lines, readings, parse_inputs(machine, inputs), chosen)


def check_band(band: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return a band after checking it.

    Args:
        band: lowest and highest frequency [Hz]; None for the lines with coherence.

    Raises:
        UsageError: it is no pair of numbers, or the lower frequency does not come first.
    """
    if band is None:
        return None
    values = np.asarray(band, np.float64)
    if values.shape != (2,) or not values[0] < values[1]:
        raise UsageError(f"band {band}: give two frequencies [Hz], the lower one first")
    return float(values[0]), float(values[1])


def check_count(name: str, value: int) -> int:
    """Return a number of starts or processes after checking it.

    Raises:
        UsageError: it is below 1.
    """
    if value < 1:
        raise UsageError(f"{name} is {value}: give 1 or more")
    return value


def as_labels(labels: AnyLabel | Iterable[AnyLabel]) -> tuple[AnyLabel, ...]:
    """Return one label or several as a tuple.

    Raises:
        UsageError: there is no label, or one appears twice.
    """
    chosen = (labels,) if isinstance(labels, str | Dof | Signal) else tuple(labels)
    if not chosen:
        raise UsageError("give at least one label, such as acc11:+tx")
    texts = [str(label) for label in chosen]
    if len(set(texts)) < len(texts):
        raise UsageError(f"a label appears twice: {', '.join(texts)}")
    return chosen
