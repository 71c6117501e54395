"""Rows of a model's modes with their energy shares: as JSON, and as a table of text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.words import Real
from mbw.predict.schema import PredictedModeRow, PredictedModesFile, Shares
from mbw.prediction import Prediction

_MIN_LISTED_SHARE = 0.001  # share of energy; smaller ones are left out of the JSON
_MAX_NAME_LENGTH = 26  # characters of a name in the table


def modes_file(prediction: Prediction) -> PredictedModesFile:
    """Return the content of the JSON file."""
    machine = prediction.machine
    return PredictedModesFile(
        model=machine.name,
        remarks=prediction.remarks,
        bodies=list(machine.layout.bodies),
        coordinates=list(machine.coordinates),
        shape_labels=[str(label) for label in prediction.labels],
        modes=[_row(prediction, number) for number in range(len(prediction.modes.poles))],
    )


def _row(prediction: Prediction, number: int) -> PredictedModeRow:
    shares, shape = prediction.energy, prediction.shapes[:, number]
    return PredictedModeRow(
        **pole_fields(prediction, number),
        strain=_shares(shares.springs, shares.strain[:, number]),
        strain_by_stage=_by_owner(shares.by_stage(shares.strain), number),
        dissipation=_shares(shares.springs, shares.dissipation[:, number]),
        dissipation_by_stage=_by_owner(shares.by_stage(shares.dissipation), number),
        kinetic=_shares(shares.motions, shares.kinetic[:, number]),
        kinetic_by_body=_by_owner(shares.by_body(), number),
        shape_real=shape.real.tolist(),
        shape_imaginary=shape.imag.tolist(),
    )


def pole_fields(prediction: Prediction, number: int) -> dict[str, Any]:
    """Return the fields of ``ModeRow``."""
    modes, pole = prediction.modes, complex(prediction.modes.poles[number])
    return {
        "frequency": float(modes.freq_hz[number]),
        "damping": None if prediction.is_at_rest(number) else float(modes.damping[number]),
        "real": pole.real,
        "imaginary": pole.imag,
        "name": modes.names[number] or None,
    }


def _shares(names: Sequence[str], values: Real) -> Shares:
    """Return the shares above the least one, the largest first."""
    order = np.argsort(-np.abs(values), kind="stable")
    return {names[k]: float(values[k]) for k in order if abs(float(values[k])) >= _MIN_LISTED_SHARE}


def _by_owner(table: Mapping[str, Real], number: int) -> Shares:
    return _shares(list(table), np.array([row[number] for row in table.values()]))


@dataclass(frozen=True)
class LargestShares:
    """Largest shares of a mode, as (name, share) or None.

    Args:
        spring: joint or tendon with the largest share of the strain energy.
        body: body with the largest share of the kinetic energy.
        damper: joint or tendon with the largest share of the dissipation.
    """

    spring: tuple[str, float] | None
    body: tuple[str, float] | None
    damper: tuple[str, float] | None


def largest_shares(prediction: Prediction) -> list[LargestShares]:
    """Return spring, body and damper with the largest shares of each mode."""
    shares, bodies = prediction.energy, prediction.energy.by_body()
    kinetic = np.array(list(bodies.values()))
    return [
        LargestShares(
            _largest(shares.springs, shares.strain[:, number]),
            _largest(list(bodies), kinetic[:, number]),
            _largest(shares.springs, shares.dissipation[:, number]),
        )
        for number in range(len(prediction.modes.poles))
    ]


def _largest(names: Sequence[str], values: Real) -> tuple[str, float] | None:
    if not len(values):
        return None
    largest = int(np.argmax(values))
    return (names[largest], float(values[largest])) if values[largest] > 0 else None


def table(prediction: Prediction) -> list[str]:
    """Return the modes as lines of text: frequency, damping ratio and largest energy shares."""
    head = ["spring, of strain energy", "body, of kinetic", "damper, of dissipation"]
    cells = []
    for name, shares in zip(prediction.modes.names, largest_shares(prediction), strict=True):
        spring = name or _cell(shares.spring)
        cells.append([spring, _cell(shares.body), _cell(shares.damper)])
    widths = [max(len(row[k]) for row in [head, *cells]) for k in range(3)]
    lines = [_line("mode", "frequency/Hz", "damping/%", head, widths)]
    frequencies = prediction.modes.freq_hz.tolist()
    rows = zip(frequencies, prediction.damping_words, cells, strict=True)
    for number, (frequency, damping, row) in enumerate(rows, start=1):
        lines.append(_line(f"{number:4d}", f"{frequency:.3f}", damping, row, widths))
    return lines


def _line(number: str, frequency: str, damping: str, cells: list[str], widths: list[int]) -> str:
    padded = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
    return f"{number}  {frequency:>12}  {damping:>10}  {padded}".rstrip()


def _cell(name_and_share: tuple[str, float] | None) -> str:
    if name_and_share is None:
        return "-"
    name, share = name_and_share
    if len(name) > _MAX_NAME_LENGTH:
        name = f"{name[:8]}~{name[9 - _MAX_NAME_LENGTH :]}"  # keep its end: the direction
    return f"{100 * share:3.0f} % {name}"
