"""Paths, labels, frequencies and quantities as users write them."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from identification.words import DERIVATIVE_ORDER, Dof, Input, Quantity, Real, UsageError
from mbmodel import Machine, parse_input

AnyPath = str | PathLike[str]
AnyLabel = str | Input


def as_path(path: AnyPath) -> Path:
    """Return a path that may be given as text, with ``~`` for the home folder."""
    return Path(path).expanduser()


def parse_outputs(labels: AnyLabel | Sequence[AnyLabel]) -> tuple[Dof, ...]:
    """Return outputs as degrees of freedom.

    Args:
        labels: one label or several, such as ``acc11:+tx``.

    Raises:
        UsageError: a text is no label.
    """
    return tuple(
        label if isinstance(label, Dof) else Dof.parse(str(label)) for label in _as_tuple(labels)
    )


def parse_inputs(machine: Machine, labels: AnyLabel | Sequence[AnyLabel]) -> tuple[Input, ...]:
    """Return inputs as degrees of freedom or motors.

    Args:
        machine: its motors may be named.
        labels: one label or several: ``acc11:+tx``, ``floor:+tx``, or the name of a motor.

    Raises:
        UsageError: a text is neither a label nor a motor.
    """
    return tuple(
        parse_input(machine, label) if isinstance(label, str) else label
        for label in _as_tuple(labels)
    )


def check_frequencies(freq_hz: Sequence[float] | Real) -> Real:
    """Return frequency lines as an array after checking them.

    Args:
        freq_hz: frequencies [Hz]; (n_freq,).

    Raises:
        UsageError: a frequency is NaN, infinite or negative, or they do not increase.
    """
    lines = np.asarray(freq_hz, np.float64)
    if lines.ndim != 1 or not lines.size or not np.isfinite(lines).all():
        raise UsageError("freq_hz: give finite frequencies [Hz] in one dimension, at least one")
    if lines[0] < 0 or not (np.diff(lines) > 0).all():
        raise UsageError("freq_hz: frequencies [Hz] must be not negative and strictly increasing")
    return lines


def check_quantity(quantity: str) -> Quantity:
    """Return the name of a quantity after checking it.

    Raises:
        UsageError: it is none of receptance, mobility and accelerance.
    """
    for name in DERIVATIVE_ORDER:
        if name == quantity:
            return name
    raise UsageError(f"{quantity!r} is no quantity: write one of {', '.join(DERIVATIVE_ORDER)}")


def _as_tuple(labels: AnyLabel | Sequence[AnyLabel]) -> tuple[AnyLabel, ...]:
    if isinstance(labels, str) or not isinstance(labels, Sequence):
        return (labels,)
    return tuple(labels)
