"""Modes that are hardly modes of the machine: they explain how hits of one test differ.

A machine whose frequencies shift a little between hits gives FRFs that one set of poles cannot fit.
The fit then adds poles beside the true ones. If references were hit one after the other, such a
pole has the shape of its neighbour; with a roving hammer it has the neighbour's participation. What
else it describes are differences of FRFs, whose phases have nothing in common. Two real modes that
lie as close differ in shape and in participation, and each has a common phase (modal phase
collinearity, Pappa, Elliott and Schenk 1993).

Nothing is doubtful where one set of poles fits all FRFs within their noise. A mode whose shape and
participation agree at several drive points is no artefact of hits either: two independent
measurements show it. Damped modes that overlap may well lack a common phase.
"""

from dataclasses import dataclass

import numpy as np

from identification.modal.indicators import mac, mpc
from identification.words import Mask, ModalModel, Real

# Squared error of the fit over the variance of the noise, below which hits do not differ; MAC of
# shape and participation at the drive points, above which a mode is evident.
_MIN_DIFFERENCE_MISFIT, _MIN_EVIDENT_RECIPROCITY = 1.5, 0.9
# Modal phase collinearity below which a shape has no common phase.
_MIN_COLLINEARITY = 0.5
# MAC of shapes or of participation above which a mode repeats a stronger neighbour, in vectors of
# at least six entries; real modes hardly ever share as much.
_MIN_REPEATED_MAC, _MIN_ENTRIES = 0.9, 6
# The same for fewer entries, where two of forty real modes agree so by chance, so that the shape
# must lack a common phase too.
_MIN_SHORT_MAC, _MAX_SHORT_COLLINEARITY = 0.95, 0.8


@dataclass(frozen=True, eq=False)
class _ModeEvidence:
    """Quantities by which modes inside the band are doubted.

    Args:
        collinearity: MPC of each shape; (n_mode,).
        strength: response of each mode at its resonance; (n_mode,).
        is_near: whether two modes overlap in their half-power bands; (n_mode, n_mode).
        shape_mac, participation_mac: MAC; (n_mode, n_mode).
        n_out, n_in: numbers of entries of shapes and participation.
    """

    collinearity: Real
    strength: Real
    is_near: Mask
    shape_mac: Real
    participation_mac: Real
    n_out: int
    n_in: int

    def find_shared(self, mode: int, neighbour: int) -> tuple[str, float] | None:
        """Return what a mode shares with a stronger neighbour, and the MAC; None for nothing."""
        for name, values, entries in (
            ("shape", self.shape_mac, self.n_out),
            ("participation", self.participation_mac, self.n_in),
        ):
            value = float(values[mode, neighbour])
            is_short = 1 < entries < _MIN_ENTRIES
            lacks_phase = bool(self.collinearity[mode] < _MAX_SHORT_COLLINEARITY)
            is_repeated = entries >= _MIN_ENTRIES and value > _MIN_REPEATED_MAC
            if is_repeated or (is_short and lacks_phase and value > _MIN_SHORT_MAC):
                return name, value
        return None


def find_doubtful_modes(
    model: ModalModel, count: int, misfit: float, reciprocity: Real | None = None
) -> tuple[tuple[str, ...], ...]:
    """Return the reasons to doubt each mode inside the band, as parts of a sentence.

    Modes are examined from the strongest on. A mode that repeats a stronger one nearby is doubtful.
    So is a mode without common phase, unless it is the strongest of those that repeat it: a true
    mode that was split loses its phase as well.

    Args:
        model: modes, those inside the band first.
        count: number of modes inside the band.
        misfit: squared error of the fit over the variance of the noise.
        reciprocity: MAC of shape and participation at two drive points or more, if known;
            (n_mode,).

    Returns:
        Reasons of each mode, none for most; count.
    """
    if misfit < _MIN_DIFFERENCE_MISFIT:
        return ((),) * count
    evidence = _collect_evidence(model, count)
    order = np.argsort(-evidence.strength, kind="stable")
    reasons: list[list[str]] = [[] for _ in range(count)]
    originals = set()
    for rank, mode in enumerate(order):
        for neighbour in order[:rank]:
            shared = (
                evidence.find_shared(mode, neighbour) if evidence.is_near[mode, neighbour] else None
            )
            if shared is not None and not reasons[neighbour]:
                reasons[mode].append(
                    f"it shares its {shared[0]} with mode {neighbour + 1} (MAC {shared[1]:.2f}), "
                    "whose band it overlaps: one mode that differs between hits looks like two"
                )
                originals.add(int(neighbour))
                break
    for mode in range(count):
        if evidence.collinearity[mode] < _MIN_COLLINEARITY and mode not in originals:
            reasons[mode].append(
                f"its shape has no common phase (collinearity "
                f"{evidence.collinearity[mode]:.2f}): it may only describe how hits differ"
            )
    if reciprocity is not None and len(reciprocity):
        for mode in np.flatnonzero(reciprocity[:count] > _MIN_EVIDENT_RECIPROCITY):
            reasons[mode] = []
    return tuple(tuple(of_mode) for of_mode in reasons)


def _collect_evidence(model: ModalModel, count: int) -> _ModeEvidence:
    """Compute collinearity, strength, distances and MAC of the modes inside the band."""
    poles = model.poles[:count]
    shapes, rows = model.shapes[:, :count], model.participation[:, :count]
    size = np.linalg.norm(shapes, axis=0) * np.linalg.norm(rows, axis=0)
    half_width = np.abs(poles.real)
    return _ModeEvidence(
        mpc(shapes),
        size / half_width,
        np.abs(poles[:, None] - poles) < half_width[:, None] + half_width,
        mac(shapes, shapes),
        mac(rows, rows),
        len(shapes),
        len(rows),
    )
