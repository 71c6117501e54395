"""Rows of tuned.json about measured modes and their partners in the nominal and the tuned model."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.words import HasPoles, ModalModel, Real
from mbmodel import Model
from tuning.files.schema import ModelModeRow, ModePairRow, ModePartnerRow
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalCost, ModePairs

_MAX_FREQUENCY_DIFFERENCE = 1e-6  # relative, between two values of one mode


def pair_rows(
    model: Model, measured: ModalModel, theta: Real, modes: dict[str, list[ModelModeRow]]
) -> tuple[list[ModePairRow], list[ModelModeRow]]:
    """Return a row for each measured mode, and the tuned model's unpaired modes.

    Args:
        measured: modes inside the band.
        theta: tuned parameters [SI]; (n_parameter,).
        modes: modes of the model in the band, ``as_drawn`` and ``tuned``.
    """
    if not len(measured.poles):
        return [], modes["tuned"]
    cost = ModalCost(model, measured, MODAL_STAGES[-1])
    drawn, tuned = cost.pairs(model.drawn), cost.pairs(theta)
    rows = [
        ModePairRow(
            frequency=float(measured.freq_hz[k]),
            frequency_sd=float(measured.freq_sd[k]),
            damping=float(measured.damping[k]),
            damping_sd=float(measured.damping_sd[k]),
            as_drawn=_partner(measured, drawn, k, modes["as_drawn"]),
            tuned=_partner(measured, tuned, k, modes["tuned"]),
        )
        for k in np.argsort(measured.freq_hz)
    ]
    paired = {row.tuned.mode for row in rows if row.tuned is not None}
    return rows, [row for k, row in enumerate(modes["tuned"], start=1) if k not in paired]


def _partner(
    measured: ModalModel, pairs: ModePairs, number: int, modes: Sequence[ModelModeRow]
) -> ModePartnerRow | None:
    """Return the row of a measured mode's partner, None without one."""
    k = int(pairs.partner[number])
    if k < 0:
        return None
    values = float(measured.freq_hz[number]), float(measured.damping[number])
    place = _place(float(pairs.freq_hz[k]), float(pairs.damping[k]), modes)
    return partner_row(pairs, k, values, mode=place, mac=float(pairs.mac[number]))


def partner_row(
    model: HasPoles, index: int, measured: tuple[float, float | None], **fields: Any
) -> ModePartnerRow:
    """Return the row of a mode of the model with its errors.

    Args:
        model: modes of the model.
        index: index of the mode among them.
        measured: frequency [Hz] and damping ratio that it is compared with.
        fields: further fields of the row.
    """
    frequency, damping = float(model.freq_hz[index]), float(model.damping[index])
    freq_hz, ratio = measured
    return ModePartnerRow(
        frequency=frequency,
        damping=damping,
        frequency_error=frequency / freq_hz - 1,
        damping_error=damping / ratio - 1 if ratio is not None and ratio > 0 else None,
        **fields,
    )


def _place(frequency: float, damping: float, modes: Sequence[ModelModeRow]) -> int | None:
    """Return the position of a mode among those in the band, counted from 1, or None outside."""
    for place, row in enumerate(modes, start=1):
        difference = abs(row.frequency - frequency) + abs(row.damping - damping) * frequency
        if difference <= _MAX_FREQUENCY_DIFFERENCE * frequency:
            return place
    return None
