"""What a user adds to the modes found, drops from them or forces into them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.modal.missing_modes import start_at
from identification.modal.refinement import Data, ModalFit, fit_shapes, refine, weighted_error
from identification.words import Complex, Mask, Real, UsageError

_NEAR = 0.02  # relative difference of frequency within which a mode is meant
_LEAST = 1e-4  # the same for a mode that a forced one replaces, if its damping is less


@dataclass(frozen=True)
class Wishes:
    """Modes of the user's own.

    Args:
        add: where the automatic search missed one [Hz]; its pole is fitted with all others.
        drop: where it found one that is none [Hz].
        force: frequency [Hz] and damping ratio of poles that stay exactly there; each takes the
            place of a mode found within half its bandwidth.
    """

    add: tuple[float, ...] = ()
    drop: tuple[float, ...] = ()
    force: tuple[tuple[float, float], ...] = ()

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.add or self.drop or self.force)


def edited(
    data: Data, freq_hz: Real, found: ModalFit, wishes: Wishes
) -> tuple[ModalFit, Real, Mask]:
    """Drop, force, add, and fit all again.

    Returns:
        The fit, its normal matrix as ``refine`` gives it, and which poles are held.

    Raises:
        UsageError: a frequency outside the band, a mode to drop that is not there, one to add that
            the data do not hold.
    """
    for frequency in [*wishes.add, *wishes.drop, *(place for place, _ in wishes.force)]:
        if not freq_hz[0] <= frequency <= freq_hz[-1]:
            raise UsageError(
                f"{frequency:g} Hz is outside the band {freq_hz[0]:g}..{freq_hz[-1]:g} Hz: no mode "
                "can be added, dropped or forced there"
            )
    fit = fit_shapes(data, *_dropped(found, wishes.drop))
    held = np.zeros(len(fit.poles), bool)
    for place, damping in wishes.force:
        if not 0 < damping < 1:
            raise UsageError(f"damping ratio {damping:g} of {place:g} Hz is not between 0 and 1")
        away = np.abs(fit.freq_hz / place - 1)
        kept = (away > max(damping, _LEAST)) | held
        fit = fit_shapes(data, fit.poles[kept], fit.participation[:, kept])
        pole = 2 * np.pi * place * (-damping + 1j * np.sqrt(1 - damping**2))
        _, row = start_at(freq_hz, place, weighted_error(data, fit), fit)
        held = np.append(held[kept], True)
        fit, _ = _with(data, fit, pole, row, held)
    for place in wishes.add:
        pole, row = start_at(freq_hz, place, weighted_error(data, fit), fit)
        held = np.append(held, False)
        fit, _ = _with(data, fit, pole, row, held)
        if abs(fit.freq_hz[-1] / place - 1) > _NEAR or fit.damping[-1] <= 0:
            raise UsageError(
                f"the data hold no mode at {place:g} Hz: the pole went to {fit.freq_hz[-1]:.4g} Hz "
                f"with {100 * fit.damping[-1]:.3g} % damping; force it, or leave it out"
            )
    fit, matrix = refine(data, fit.poles, fit.participation, held=held)
    return fit, matrix, held


def _dropped(found: ModalFit, places: Sequence[float]) -> tuple[Complex, Complex]:
    """Poles and participation without the modes nearest to these frequencies [Hz]."""
    kept = np.ones(len(found.poles), bool)
    for place in places:
        away = np.where(kept, np.abs(found.freq_hz / place - 1), np.inf)
        if not kept.any() or away.min() > _NEAR:
            there = ", ".join(f"{freq:.2f}" for freq in np.sort(found.freq_hz[kept]))
            raise UsageError(f"no mode to drop at {place:g} Hz: there are {there or 'none'} Hz")
        kept[int(away.argmin())] = False
    return found.poles[kept], found.participation[:, kept]


def _with(
    data: Data, fit: ModalFit, pole: complex, row: Complex, held: Mask
) -> tuple[ModalFit, Real]:
    return refine(
        data, np.append(fit.poles, pole), np.column_stack([fit.participation, row]), held=held
    )
