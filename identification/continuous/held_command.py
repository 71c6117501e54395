"""FRFs by the force that acts, where the record holds a command that acts until the next sample."""

from dataclasses import replace

import numpy as np

from identification.continuous.estimate import ContinuousEstimate
from identification.words import DERIVATIVE_ORDER, Complex, Real

_HELD_SHARE = 0.2  # of the rate, above which images of a held command count
_MASS_LINE_SHARE = 0.6  # of the highest line, from which lines show the mass line above the modes


def remove_hold(continuous: ContinuousEstimate, rate_hz: float) -> ContinuousEstimate:
    r"""Return the FRFs by the force that acts, where its record is the command that is held.

    A command that acts until the next sample acts as (1 - exp(-s T)) / (s T) of it, s = i w and T
    the time of a sample: half a sample late, and smaller towards half the rate. Its images at
    w_k = w + 2 pi k / T move the machine too, and sampling folds their motion onto w. Far above the
    modes the receptance is -a / w^2, so that FRFs of order q (0 for receptance) gain

        sum over k != 0 of (i w_k)^q (-a / w_k^2) (w / w_k),

    at a fifth of the rate -1.2 % of an inertia's receptance, 14 % of its mobility. The sum is taken
    off by the mass line that the highest lines show; as far as they scatter about it, it counts as
    noise. Lines above a fifth of the rate are left out.

    Args:
        continuous: FRFs by the command.
        rate_hz: samples per second.
    """
    estimate = continuous.estimate
    estimate = estimate.select_lines(estimate.frf.freq_hz <= _HELD_SHARE * rate_hz)
    omega = 2 * np.pi * estimate.frf.freq_hz[:, None, None]
    phase = 1j * omega / rate_hz
    hold = (1 - np.exp(-phase)) / phase
    values, variance = estimate.frf.values / hold, estimate.variance / np.abs(hold) ** 2
    order = DERIVATIVE_ORDER[estimate.frf.quantity]
    mass_line: Complex = np.asarray(-((1j * omega) ** order) / omega**2, np.complex128)
    x = omega / (2 * rate_hz)
    # Sums over all k of 1 / (x + k pi)^(3 - q), for orders 0, 1 and 2.
    folded = (np.cos(x) / np.sin(x) ** 3, 1 / np.sin(x) ** 2, 1 / np.tan(x))[order]
    image: Complex = mass_line * (folded * x ** (3 - order) - 1)
    sampled: Complex = np.asarray(mass_line + image)
    size, scatter = _fit_inertance(values, variance, mass_line, sampled, omega)
    frf = replace(estimate.frf, values=values - size * image)
    estimate = replace(estimate, frf=frf, variance=variance + np.abs(scatter * image) ** 2)
    return replace(continuous, estimate=estimate)


def _fit_inertance(
    values: Complex, variance: Real, mass_line: Complex, folded: Complex, omega: Real
) -> tuple[Real, Real]:
    """Return a of the mass line of each FRF, and how far its lines scatter; (n_out, n_in) each.

    Modes below add c / w^4 to a / w^2, to first order, of which sampling folds next to nothing.

    Args:
        values, variance: FRFs and their variance; (n_freq, n_out, n_in).
        mass_line, folded: those of a = 1, in continuous time and as sampled; (n_freq, 1, 1).
        omega: angular frequencies [rad/s]; (n_freq, 1, 1).
    """
    top = omega[:, 0, 0] >= _MASS_LINE_SHARE * omega.max(initial=0.0)
    squares = (omega[top].max(initial=1.0) / omega[top, 0, 0]) ** 2
    columns = np.stack([(folded / mass_line)[top, 0, 0].real, squares], axis=1)
    shape = values.shape[1:]
    sizes, scatters = np.zeros(shape), np.zeros(shape)
    if len(columns) <= columns.shape[1]:
        return sizes, scatters
    for cell in np.ndindex(shape):
        seen = (values[top][:, *cell] / mass_line[top, 0, 0]).real
        weight = 1 / np.sqrt(np.maximum(variance[top][:, *cell], np.finfo(float).tiny))
        weight *= np.abs(mass_line[top, 0, 0])
        fit = np.linalg.lstsq(columns * weight[:, None], seen * weight)[0]
        sizes[cell] = fit[0]
        scatters[cell] = np.median(np.abs(seen - columns @ fit))
    return sizes, scatters
