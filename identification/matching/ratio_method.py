r"""Matching as the gondola's paper prints it: unsigned ratios to one sensor, 1 / norm^2.

At every place the amplitude is |z| of a single channel, sqrt(|x|^2 + |y|^2 + |z|^2) of a triaxial,
smoothed by a sliding average along frequency. Measured ratios are taken at every line to the place
``reference``; simulated ones, says the text, to the largest amplitude of each mode, which makes
both differ by a factor unless that place moves most. Both readings are here. Then

    1 / norm^2 = 1 / sum_p (measured_p - simulated_p)^2

at every line, for every mode and impact, and the mean over impacts (figs. 9 to 11).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.impacts import ImpactSpectra, smoothed
from identification.words import Dof, Integers, Real, UsageError

Reading = Literal["largest", "reference"]


@dataclass(frozen=True, eq=False)
class PrintedMatch:
    """1 / norm^2 of every mode.

    Args:
        places: names.
        freq_hz: lines; (n_freq,).
        amplitude: smoothed, of each place; (n_freq, n_place, n_impact).
        measured: ratios; (n_freq, n_place, n_impact).
        simulated: ratios; (n_mode, n_place).
        impacts: 1 / norm^2 of each; (n_freq, n_mode, n_impact).
    """

    places: tuple[str, ...]
    freq_hz: Real
    amplitude: Real
    measured: Real
    simulated: Real
    impacts: Real

    @property
    def mean(self) -> Real:
        """Over impacts; (n_freq, n_mode)."""
        averaged: Real = self.impacts.mean(axis=2)
        return averaged

    @property
    def peaks(self) -> Integers:
        """Line of the highest mean of each mode; (n_mode,)."""
        return np.asarray(self.mean.argmax(axis=0), np.intp)


def printed_match(
    spectra: ImpactSpectra,
    at: Real,
    reference: str,
    *,
    reading: Reading = "largest",
    width_hz: float = 0.3,
) -> PrintedMatch:
    """Compare ratios of amplitudes as printed.

    Args:
        spectra: of the impacts.
        at: modes at the channels, signed; (n_mode, n_channel).
        reference: the place to which measured ratios are taken.
        reading: to what simulated ratios are taken: each mode's ``largest``, or the ``reference``.
        width_hz: of the sliding average; ten lines of records of 30 s.

    Raises:
        UsageError: a reference that no channel reads.
    """
    places = _places(spectra.dofs)
    if reference not in places:
        raise UsageError(f"{reference} is not among {', '.join(places)}. Name one of these.")
    own = places.index(reference)
    amplitude = smoothed(_norms(np.abs(spectra.values), spectra.dofs, 1), spectra.freq_hz, width_hz)
    measured = amplitude / amplitude[:, own : own + 1]
    shapes = _norms(np.abs(at), spectra.dofs, 1)
    to = shapes.max(axis=1) if reading == "largest" else shapes[:, own]
    # What no channel sees has no ratios: zero everywhere.
    simulated = shapes / np.maximum(np.maximum(to, 1e-12 * shapes.max(axis=1)), 1e-300)[:, None]
    apart = measured[:, None] - simulated[None, :, :, None]
    closeness = 1 / np.maximum((apart**2).sum(axis=2), 1e-300)
    return PrintedMatch(places, spectra.freq_hz, amplitude, measured, simulated, closeness)


def steadiest(at: Real, dofs: Sequence[Dof]) -> str:
    """The place that is nowhere near a node, as far as any is: for ratios to be taken to.

    Args:
        at: modes at the channels; (n_mode, n_channel).
        dofs: the channels.
    """
    own = _norms(np.abs(at), dofs, 1)
    seen = own[own.max(axis=1) > 0]
    if not len(seen):
        return _places(dofs)[0]
    return _places(dofs)[int(np.argmax((seen / seen.max(axis=1, keepdims=True)).min(axis=0)))]


def _places(dofs: Sequence[Dof]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(dof.point for dof in dofs))


def _norms(values: Real, dofs: Sequence[Dof], axis: int) -> Real:
    """Over the channels of each place."""
    places = _places(dofs)
    moved = np.moveaxis(values, axis, 0)
    rows = [
        np.sqrt((moved[[dof.point == place for dof in dofs]] ** 2).sum(axis=0)) for place in places
    ]
    return np.moveaxis(np.array(rows), 0, axis)
