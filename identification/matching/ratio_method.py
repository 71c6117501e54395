"""Matching by amplitude ratios, as in the gondola's paper: unsigned, to one sensor, 1 / norm^2.

At every place the amplitude is |z| of a single channel, sqrt(|x|^2 + |y|^2 + |z|^2) of a triaxial
sensor, smoothed by a sliding average along frequency. Measured ratios are taken at every line to
the place ``reference``. The paper takes simulated ratios to the largest amplitude of each mode, so
that both differ by a factor unless that place moves most. Both readings of the method are
implemented. Then

    1 / norm^2 = 1 / sum_p (measured_p - simulated_p)^2

at every line, for every mode and impact, and the mean over impacts (figs. 9 to 11).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.impacts import ImpactSpectra, sliding_average
from identification.words import Dof, Integers, Real, UsageError

RatioReference = Literal["largest", "reference"]


@dataclass(frozen=True, eq=False)
class RatioMatch:
    """Closeness 1 / norm^2 of every mode.

    Args:
        places: names of the places.
        freq_hz: lines [Hz]; (n_freq,).
        amplitude: smoothed amplitude of each place; (n_freq, n_place, n_impact).
        measured: measured ratios; (n_freq, n_place, n_impact).
        simulated: simulated ratios; (n_mode, n_place).
        closeness: 1 / norm^2 for each impact; (n_freq, n_mode, n_impact).
    """

    places: tuple[str, ...]
    freq_hz: Real
    amplitude: Real
    measured: Real
    simulated: Real
    closeness: Real

    @property
    def mean(self) -> Real:
        """Mean of 1 / norm^2 over impacts; (n_freq, n_mode)."""
        return self.closeness.mean(axis=2)

    @property
    def peaks(self) -> Integers:
        """Number of the line of the highest mean of each mode; (n_mode,)."""
        return np.asarray(self.mean.argmax(axis=0), np.intp)


def match_by_ratios(
    spectra: ImpactSpectra,
    simulated_shapes: Real,
    reference: str,
    *,
    reading: RatioReference = "largest",
    width_hz: float = 0.3,
) -> RatioMatch:
    """Compare ratios of amplitudes as in the paper.

    Args:
        simulated_shapes: modes at the channels, signed; (n_mode, n_channel).
        reference: place to which measured ratios are taken.
        reading: amplitude to which simulated ratios are taken: each mode's ``largest``, or that of
            the ``reference``.
        width_hz: width of the sliding average [Hz]; the default is ten lines of records of 30 s.

    Raises:
        UsageError: a reference that no channel reads.
    """
    places = _places(spectra.dofs)
    if reference not in places:
        raise UsageError(f"{reference} is not among the places {', '.join(places)}: name one.")
    reference_place = places.index(reference)
    amplitude = sliding_average(
        _place_amplitudes(np.abs(spectra.values), spectra.dofs, 1), spectra.freq_hz, width_hz
    )
    measured = amplitude / amplitude[:, reference_place : reference_place + 1]
    shapes = _place_amplitudes(np.abs(simulated_shapes), spectra.dofs, 1)
    divisor = shapes.max(axis=1) if reading == "largest" else shapes[:, reference_place]
    # A mode that no channel reads has no ratios: they are zero.
    simulated = (
        shapes / np.maximum(np.maximum(divisor, 1e-12 * shapes.max(axis=1)), 1e-300)[:, None]
    )
    difference = measured[:, None] - simulated[None, :, :, None]
    closeness = 1 / np.maximum((difference**2).sum(axis=2), 1e-300)
    return RatioMatch(places, spectra.freq_hz, amplitude, measured, simulated, closeness)


def choose_reference(simulated_shapes: Real, dofs: Sequence[Dof]) -> str:
    """Return the place that is farthest from a node in all modes, as reference of the ratios.

    Args:
        simulated_shapes: modes at the channels; (n_mode, n_channel).
    """
    amplitudes = _place_amplitudes(np.abs(simulated_shapes), dofs, 1)
    visible = amplitudes[amplitudes.max(axis=1) > 0]
    if not len(visible):
        return _places(dofs)[0]
    return _places(dofs)[int(np.argmax((visible / visible.max(axis=1, keepdims=True)).min(axis=0)))]


def _places(dofs: Sequence[Dof]) -> tuple[str, ...]:
    """Return the names of the places, each once."""
    return tuple(dict.fromkeys(dof.point for dof in dofs))


def _place_amplitudes(values: Real, dofs: Sequence[Dof], axis: int) -> Real:
    """Return the norm over the channels of each place."""
    places = _places(dofs)
    moved = np.moveaxis(values, axis, 0)
    rows = [
        np.sqrt((moved[[dof.point == place for dof in dofs]] ** 2).sum(axis=0)) for place in places
    ]
    return np.moveaxis(np.array(rows), 0, axis)
