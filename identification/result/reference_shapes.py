"""Reference shapes for the measured modes, such as those of a file, and their comparison."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.modal import mac, pair_shapes, signed_comac
from identification.readers.uff_modes_read import read_uff_modes
from identification.words import Complex, InputError, Layout, Mask, Output, Real

_MIN_PAIR_MAC = 0.3  # lowest MAC of a measured and a reference mode that count as a pair


@dataclass(frozen=True, eq=False)
class ReferenceModes:
    """Modes of a model or of a file at the measured channels.

    Args:
        name: name of the model or file.
        freq_hz: natural frequencies [Hz]; (n_reference,).
        damping: damping ratios; (n_reference,).
        shapes: mode shapes; (n_out, n_reference).
        has_shape: channels at which the shapes are known; (n_out,).
        remarks: sentences on the file, such as axes that it turns.
    """

    name: str
    freq_hz: Real
    damping: Real
    shapes: Complex
    has_shape: Mask
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ShapeComparison:
    """Comparison of measured shapes with reference shapes.

    Args:
        reference: reference modes.
        mac: MAC of every measured with every reference shape; (n_mode, n_reference).
        pairs: indices of measured and reference modes that belong together.
        comac: signed COMAC over the pairs; zero where either side has no shape; (n_out,).
    """

    reference: ReferenceModes
    mac: Real
    pairs: tuple[tuple[int, int], ...]
    comac: Real


def compare_shapes(
    shapes: Complex, is_measured: Mask, reference: ReferenceModes
) -> ShapeComparison:
    """Compare measured shapes with reference shapes by MAC and signed COMAC.

    Args:
        shapes: measured shapes; (n_out, n_mode).
        is_measured: channels that were measured; (n_out,).
    """
    rows = np.flatnonzero(reference.has_shape & is_measured)
    criterion = mac(shapes[rows], reference.shapes[rows])
    pairs = tuple(pair_shapes(criterion, _MIN_PAIR_MAC)) if criterion.size else ()
    comac = np.zeros(len(shapes))
    if pairs:
        modes, partners = (list(side) for side in zip(*pairs, strict=True))
        comac[rows] = signed_comac(shapes[rows][:, modes], reference.shapes[rows][:, partners])
    return ShapeComparison(reference, criterion, pairs, comac)


def no_reference_modes(outputs: tuple[Output, ...]) -> ReferenceModes:
    """Return an empty set of reference modes."""
    n_out, empty = len(outputs), np.zeros(0)
    return ReferenceModes("", empty, empty, np.zeros((n_out, 0), complex), np.zeros(n_out, bool))


def read_reference_modes(path: Path, outputs: tuple[Output, ...], layout: Layout) -> ReferenceModes:
    """Read the modes of a universal file at the measured channels, matched by node numbers.

    Raises:
        InputError: the file holds no mode, or no node of the measurement.
    """
    modes = read_uff_modes(path)
    shapes, has_shape = modes.at_channels(outputs, layout)
    if not has_shape.any():
        nodes = ", ".join(str(node) for node in modes.nodes[:5])
        raise InputError(
            f"{path} has shapes at nodes {nodes}.., none of which was measured: give sensors and "
            "nodes the same numbers"
        )
    return ReferenceModes(path.name, modes.freq_hz, modes.damping, shapes, has_shape, modes.remarks)
