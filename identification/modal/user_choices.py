"""Choices of the user: modes that are added to the identified ones, dropped from them or forced."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.modal.missing_modes import start_pole_at
from identification.modal.refinement import refine
from identification.modal.shape_fit import ModalFit, WeightedFrfs, fit_shapes, weighted_error
from identification.words import Complex, Mask, Real, UsageError, percent_text

# Relative difference between a frequency that the user gives and that of the mode it selects.
_MAX_FREQUENCY_MISMATCH = 0.02
# Relative difference of frequency within which a forced mode replaces a fitted one; its damping
# ratio counts if that is larger.
_REPLACEMENT_WINDOW = 1e-4


@dataclass(frozen=True)
class ModeChoices:
    """Modes that the user adds, drops or forces.

    Args:
        add: frequencies [Hz] of modes that the automatic search missed; their poles are fitted with
            all others.
        drop: frequencies [Hz] of identified modes to be left out.
        force: frequency [Hz] and damping ratio, negative for a mode that grows, of poles that are
            kept exactly; each replaces a mode found within half its bandwidth.
    """

    add: tuple[float, ...] = ()
    drop: tuple[float, ...] = ()
    force: tuple[tuple[float, float], ...] = ()

    def __bool__(self) -> bool:
        """Return whether there is any choice."""
        return bool(self.add or self.drop or self.force)


def apply_choices(
    data: WeightedFrfs, freq_hz: Real, fitted: ModalFit, choices: ModeChoices
) -> tuple[ModalFit, Real, Mask]:
    """Drop, force and add modes, and refit all modes together.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        fitted: modes of the automatic search.
        choices: modes to drop, force and add.

    Returns:
        The fit, its normal matrix as ``refine`` gives it, and which poles are fixed.

    Raises:
        UsageError: a frequency outside the band, a mode to drop that does not exist, or a mode to
            add that the data do not show.
    """
    for frequency_hz in [
        *choices.add,
        *choices.drop,
        *(frequency_hz for frequency_hz, _ in choices.force),
    ]:
        if not freq_hz[0] <= frequency_hz <= freq_hz[-1]:
            raise UsageError(
                f"{frequency_hz:g} Hz is outside the band {freq_hz[0]:g}..{freq_hz[-1]:g} Hz: no "
                "mode can be added, dropped or forced there"
            )
    fit = fit_shapes(data, *_drop_modes(fitted, choices.drop))
    fixed = np.zeros(len(fit.poles), bool)
    for frequency_hz, damping in choices.force:
        if not 0 < abs(damping) < 1:
            raise UsageError(
                f"damping ratio {damping:g} of {frequency_hz:g} Hz is not between 0 and 1, nor "
                "between -1 and 0 for a mode that grows"
            )
        mismatch = np.abs(fit.freq_hz / frequency_hz - 1)
        kept = (mismatch > max(abs(damping), _REPLACEMENT_WINDOW)) | fixed
        fit = fit_shapes(data, fit.poles[kept], fit.participation[:, kept])
        pole = 2 * np.pi * frequency_hz * (-damping + 1j * np.sqrt(1 - damping**2))
        _, row = start_pole_at(freq_hz, frequency_hz, weighted_error(data, fit), fit)
        fixed = np.append(fixed[kept], True)
        fit, _ = _refine_with(data, fit, pole, row, fixed)
    for frequency_hz in choices.add:
        pole, row = start_pole_at(freq_hz, frequency_hz, weighted_error(data, fit), fit)
        fixed = np.append(fixed, False)
        fit, _ = _refine_with(data, fit, pole, row, fixed)
        if (
            abs(fit.freq_hz[-1] / frequency_hz - 1) > _MAX_FREQUENCY_MISMATCH
            or fit.damping[-1] <= 0
        ):
            raise UsageError(
                f"the data hold no mode at {frequency_hz:g} Hz: the pole went to "
                f"{fit.freq_hz[-1]:.4g} Hz with {percent_text(fit.damping[-1], 3)} damping; "
                "force the mode, or do not add it"
            )
    fit, matrix = refine(data, fit.poles, fit.participation, fixed=fixed)
    return fit, matrix, fixed


def _drop_modes(fitted: ModalFit, frequencies: Sequence[float]) -> tuple[Complex, Complex]:
    """Return poles and participation without the modes nearest to these frequencies [Hz]."""
    kept = np.ones(len(fitted.poles), bool)
    for frequency in frequencies:
        mismatch = np.where(kept, np.abs(fitted.freq_hz / frequency - 1), np.inf)
        if not kept.any() or mismatch.min() > _MAX_FREQUENCY_MISMATCH:
            listed = ", ".join(f"{freq:.2f}" for freq in np.sort(fitted.freq_hz[kept]))
            raise UsageError(
                f"no mode to drop at {frequency:g} Hz: there are {listed or 'none'} Hz"
            )
        kept[int(mismatch.argmin())] = False
    return fitted.poles[kept], fitted.participation[:, kept]


def _refine_with(
    data: WeightedFrfs, fit: ModalFit, pole: complex, row: Complex, fixed: Mask
) -> tuple[ModalFit, Real]:
    """Add one pole and refine the fit."""
    return refine(
        data, np.append(fit.poles, pole), np.column_stack([fit.participation, row]), fixed=fixed
    )
