"""FRFs of bodies to universal files: units (164), nodes (15), and one dataset 58 for each FRF.

Dataset 58 is written as ASCII text in double precision, as all modal software reads it. Function
type 4 is an FRF; directions 1 to 3 are translations along x, y, z and 4 to 6 rotations about them.
Frequencies have the six digits of E13.5.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identification.readers.uff_modes import dataset, units
from identification.words import (
    Complex,
    Frf,
    FrfEstimate,
    Input,
    Quantity,
    Real,
    Signal,
    node_number,
)

_DOUBLE_COMPLEX, _FRF_FUNCTION, _FREQUENCY_KIND, _FORCE_KIND = 6, 4, 18, 13
_MOTIONS: dict[Quantity, tuple[int, str, str]] = {  # kind, label and rate of the ordinate
    "receptance": (8, "Displacement", ""),
    "mobility": (11, "Velocity", "/s"),
    "accelerance": (12, "Acceleration", "/s^2"),
}
_MAX_UNEVENNESS = 1e-6  # of the spacing: rounding of what a file states
_BODY_NUMBER_STEP = (
    1000  # bodies get the next thousand above all sensors, so that nodes stay distinct
)


def number_bodies(bodies: tuple[str, ...], points: tuple[str, ...]) -> dict[str, int]:
    """Return a node number for each body, above the numbers of all sensors.

    Args:
        bodies: names of the bodies.
        points: names of the points, which end in their node numbers.
    """
    largest = max((node_number(point) or 0 for point in points), default=0)
    first = (largest // _BODY_NUMBER_STEP + 1) * _BODY_NUMBER_STEP
    return {body: first + number for number, body in enumerate(bodies, start=1)}


def write_uff_frfs(
    path: Path, estimate: FrfEstimate, nodes: Mapping[str, int], centres: Mapping[str, Real]
) -> None:
    """Write the measured FRFs as an ASCII universal file.

    Args:
        path: path of the file, which is replaced if it exists.
        estimate: FRFs of bodies.
        nodes: node number of each body.
        centres: position of each body [m]; (3,).
    """
    frf = estimate.frf
    positions = [
        f"{number:10d}{0:10d}{0:10d}{0:10d}" + "".join(f"{v:13.5E}" for v in centres[body])
        for body, number in nodes.items()
    ]
    parts = [units(), dataset(15, positions)]
    for column, source in enumerate(frf.inputs):
        for row in np.flatnonzero(estimate.measured[:, column]):
            parts.append(_function(frf, int(row), nodes, source, frf.values[:, row, column]))
    path.write_text("".join(parts), encoding="ascii", errors="replace")


def _function(frf: Frf, row: int, nodes: Mapping[str, int], source: Input, values: Complex) -> str:
    """Return one FRF as dataset 58."""
    output, freq = frf.outputs[row], frf.freq_hz
    kind, label, rate = _MOTIONS[frf.quantity]
    spacing = float(freq[-1] - freq[0]) / max(len(freq) - 1, 1)
    is_even = len(freq) > 1 and float(np.ptp(np.diff(freq))) <= _MAX_UNEVENNESS * spacing
    motion_unit = f"{'rad' if output.is_rotation else 'm'}{rate}"
    reference, direction, force_unit = _reference(source)
    lines = [
        f"{output} / {source}"[:80],
        *["NONE"] * 4,
        f"{_FRF_FUNCTION:5d}{0:10d}{1:5d}{0:10d} {output.point[:10]:10}{nodes[output.point]:10d}"
        f"{output.sign * (output.axis + 1):4d} {str(source).split(':')[0][:10]:10}"
        f"{reference:10d}{direction:4d}",
        f"{_DOUBLE_COMPLEX:10d}{len(freq):10d}{int(is_even):10d}{freq[0]:13.5E}"
        f"{spacing if is_even else 0.0:13.5E}{0.0:13.5E}",
        _axis(_FREQUENCY_KIND, "Frequency", "Hz"),
        _axis(kind, label, motion_unit),
        _axis(_FORCE_KIND, "Excitation force", force_unit),
        _axis(0, "NONE", "NONE"),
        *_data(freq, values, is_even=is_even),
    ]
    return dataset(58, lines)


def _reference(source: Input) -> tuple[int, int, str]:
    """Return node, direction and unit of an input; a motor has neither node nor direction."""
    if isinstance(source, Signal):
        return 0, 0, "NONE"
    unit = "N m" if source.is_rotation else "N"
    return node_number(source.point) or 0, source.sign * (source.axis + 1), unit


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:20} {unit:20}"


def _data(freq: Real, values: Complex, *, is_even: bool) -> list[str]:
    """Return the lines of the values: two an even line, else one with its frequency."""
    if not is_even:
        rows = zip(freq.tolist(), values.tolist(), strict=True)
        return [f"{f:13.5E}{v.real:20.12E}{v.imag:20.12E}" for f, v in rows]
    texts = [f"{v.real:20.12E}{v.imag:20.12E}" for v in values.tolist()]
    return ["".join(texts[k : k + 2]) for k in range(0, len(texts), 2)]
