"""Measured modes beside the model's, as drawn and as tuned, for tuned.json."""

from collections.abc import Sequence

import numpy as np

from identification.words import ModalModel, Real
from mbmodel import Model
from tuning.files.schema import ModeRow, PairRow, PartnerRow
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalCost, Pairs

_SAME = 1e-6  # relative difference of two frequencies of one mode


def pair_rows(
    model: Model, measured: ModalModel, theta: Real, modes: dict[str, list[ModeRow]]
) -> tuple[list[PairRow], list[ModeRow]]:
    """Every measured mode with its partners, and the tuned model's modes that belong to none.

    Args:
        model: machine and Parts.
        measured: modes inside the band.
        theta: tuned; (n_parameter,).
        modes: of the model in the band, ``as_drawn`` and ``tuned``.
    """
    if not len(measured.poles):
        return [], modes["tuned"]
    cost = ModalCost(model, measured, MODAL_STAGES[-1])
    drawn, tuned = cost.pairs(model.drawn), cost.pairs(theta)
    rows = [
        PairRow(
            frequency=float(measured.freq_hz[k]),
            frequency_sd=float(measured.freq_sd[k]),
            damping=float(measured.damping[k]),
            damping_sd=float(measured.damping_sd[k]),
            as_drawn=_partner(measured, drawn, k, modes["as_drawn"]),
            tuned=_partner(measured, tuned, k, modes["tuned"]),
        )
        for k in np.argsort(measured.freq_hz)
    ]
    taken = {row.tuned.mode for row in rows if row.tuned is not None}
    return rows, [row for k, row in enumerate(modes["tuned"], start=1) if k not in taken]


def _partner(
    measured: ModalModel, pairs: Pairs, number: int, modes: Sequence[ModeRow]
) -> PartnerRow | None:
    partner = int(pairs.partner[number])
    if partner < 0:
        return None
    frequency, damping = float(pairs.freq_hz[partner]), float(pairs.damping[partner])
    known = float(measured.damping[number])
    return PartnerRow(
        mode=_place(frequency, damping, modes),
        frequency=frequency,
        damping=damping,
        mac=float(pairs.mac[number]),
        frequency_error=frequency / float(measured.freq_hz[number]) - 1,
        damping_error=damping / known - 1 if known > 0 else None,
    )


def _place(frequency: float, damping: float, modes: Sequence[ModeRow]) -> int | None:
    """Which of the modes in the band this one is, counted from 1."""
    for place, row in enumerate(modes, start=1):
        off = abs(row.frequency - frequency) + abs(row.damping - damping) * frequency
        if off <= _SAME * frequency:
            return place
    return None
