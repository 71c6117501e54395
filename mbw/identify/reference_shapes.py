"""Shapes to compare the measured ones with: those of the model as drawn, or of a file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.modal import mac, paired, signed_comac
from identification.readers.uff_modes_read import read_uff_modes
from identification.words import Complex, Dof, InputError, Layout, Mask, Real
from mbmodel import Machine, as_drawn, model_modes, shapes_at

_ABOVE = 1.3  # times the highest line, up to which a model's modes are compared
_LEAST = 0.3  # MAC of a pair that is worth naming


@dataclass(frozen=True, eq=False)
class Other:
    """Modes of another origin at the measured channels.

    Args:
        name: where they come from.
        freq_hz: [Hz]; (n_other,).
        damping: ratios; (n_other,).
        shapes: (n_out, n_other).
        there: channels at which it has shapes; (n_out,).
    """

    name: str
    freq_hz: Real
    damping: Real
    shapes: Complex
    there: Mask


@dataclass(frozen=True, eq=False)
class Compared:
    """Measured shapes beside others.

    Args:
        other: the others.
        mac: of every measured shape with every other; (n_mode, n_other).
        pairs: numbers of measured and other modes that belong together.
        comac: signed, over the pairs, zero where a side has no shape; (n_out,).
    """

    other: Other
    mac: Real
    pairs: tuple[tuple[int, int], ...]
    comac: Real


def compared(shapes: Complex, seen: Mask, other: Other) -> Compared:
    """Put measured shapes beside others.

    Args:
        shapes: measured; (n_out, n_mode).
        seen: channels that were measured; (n_out,).
        other: what to compare with.
    """
    rows = np.flatnonzero(other.there & seen)
    criterion = mac(shapes[rows], other.shapes[rows])
    pairs = tuple(paired(criterion, _LEAST)) if criterion.size else ()
    comac = np.zeros(len(shapes))
    if pairs:
        own, theirs = (list(side) for side in zip(*pairs, strict=True))
        comac[rows] = signed_comac(shapes[rows][:, own], other.shapes[rows][:, theirs])
    return Compared(other, criterion, pairs, comac)


def nothing(outputs: tuple[Dof, ...]) -> Other:
    """No other shapes."""
    none = np.zeros(0)
    return Other("", none, none, np.zeros((len(outputs), 0), complex), np.zeros(len(outputs), bool))


def drawn_model(machine: Machine, outputs: tuple[Dof, ...], highest_hz: float) -> Other:
    """Modes of a machine as drawn, without its motions at rest and overdamped poles.

    Args:
        machine: with the campaign's layout.
        outputs: measured channels.
        highest_hz: of the band.
    """
    model = as_drawn(machine)
    found = model_modes(model, model.drawn)
    kept = (found.poles.imag > 0) & (found.freq_hz <= _ABOVE * highest_hz)
    shapes = shapes_at(model, model.drawn, found, outputs)[:, kept]
    return Other(
        f"{machine.name} as drawn",
        found.freq_hz[kept],
        found.damping[kept],
        shapes,
        np.ones(len(outputs), bool),
    )


def of_file(path: Path, outputs: tuple[Dof, ...], layout: Layout) -> Other:
    """Modes of a universal file at the measured channels, found by their nodes' numbers.

    Raises:
        InputError: no mode, or no node of the measurement.
    """
    modes = read_uff_modes(path)
    shapes, there = modes.at(outputs, layout)
    if not there.any():
        nodes = ", ".join(str(node) for node in modes.nodes[:5])
        raise InputError(
            f"{path} has shapes at nodes {nodes}.., none of which was measured: give sensors and "
            "nodes the same numbers"
        )
    return Other(path.name, modes.freq_hz, modes.damping, shapes, there)
