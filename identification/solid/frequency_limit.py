r"""Up to which frequency a body moves as a solid: what remains beside the motion, along frequency.

With the sensors' errors fitted, e = P z is what no rigid motion explains. Summed over hits and over
a window of lines that is as wide as a lightly damped mode,

    deviation^2 = (sum |e|^2 - noise) / (sum |z|^2 - noise),

every channel taken in units of its noise and every line at its own size: the share of the readings
that is not rigid (seed, ch. 2.2, as a number). What flexible motion has in common with rigid
motion is not seen: with few spare channels the deviation is too small.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammainccinv

from identification.solid.body_channels import BodyData
from identification.solid.rigid_fit import Model, project
from identification.solid.sensor_faults import State
from identification.words import Complex, Integers, Mask, Real

# A model of solid bodies that is right within one per cent of the motion is as good as its
# tolerances of gain (1 %) and angle (1 degree, 1.7 %) allow: less is reported, and still solid.
SOLID_WITHIN = 0.01
# Chance that a solid body is called flexible by its noise, over all lines.
_FALSE = 1e-3
# Half a window: some half-power bandwidths of a mode with 1 % of damping, 4 lines at least.
_RELATIVE_WIDTH = 0.02
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class Spectrum:
    """What remains beside rigid motion, per line; all (n_freq,).

    Args:
        reconstruction: relative difference of readings and their rigid reconstruction, sensors as
            drawn, noise included.
        expected: the same that noise and tolerances alone would give.
        deviation: the same with errors fitted, beyond noise.
        hidden: deviation that the noise would hide.
        excess: residual over noise, errors fitted; 1 is noise alone.
        beyond: where the deviation exceeds ``SOLID_WITHIN`` beyond doubt.
        significant: where it exceeds zero beyond doubt.
    """

    reconstruction: Real
    expected: Real
    deviation: Real
    hidden: Real
    excess: Real
    beyond: Mask
    significant: Mask


def spectrum(
    state: State, drawn: State, believed: Model, errors: Real, noise_scale: float
) -> Spectrum:
    """Compare residual, noise and tolerances along frequency.

    Args:
        state: the body, channels exchanged and read as believed.
        drawn: the body as drawn and measured.
        believed: with shapes of single channels that are left out.
        errors: of the sensors.
        noise_scale: variance of the noise over the stated one.
    """
    data, reading, freq = state.data, state.reading, state.data.freq_hz
    power, noise, square = _powers(data, reading, believed, errors)
    zero = np.zeros_like(errors)
    raw, raw_noise, _ = _powers(drawn.data, drawn.reading, drawn.model, zero)
    total, total_noise = _sums(data, reading)
    whole, _ = _sums(drawn.data, drawn.reading)
    rigid = np.maximum(total - total_noise, 1e-12 * total.max() + 1e-300)
    near, near_noise, size = (
        np.maximum(_smooth(x, freq), 0.0) for x in (power, noise_scale * noise, rigid)
    )
    spread = noise_scale**2 * np.maximum(_smooth(square, freq), 0.0) / _widths(freq)
    hidden = _highest(near_noise, spread, _FALSE / len(freq)) - near_noise
    beyond = near - near_noise - hidden
    whole = np.maximum(whole, 1e-300)
    tolerated = _tolerated(drawn.data, drawn.model)
    return Spectrum(
        reconstruction=np.sqrt(np.maximum(raw, 0.0) / whole),
        expected=np.sqrt(np.maximum(noise_scale * raw_noise + tolerated, 0.0) / whole),
        deviation=np.sqrt(np.maximum(near - near_noise, 0.0) / np.maximum(size, 1e-300)),
        hidden=np.sqrt(hidden / np.maximum(size, 1e-300)),
        excess=np.sqrt(near / np.maximum(_smooth(noise, freq), 1e-300)),
        beyond=beyond > SOLID_WITHIN**2 * size,
        significant=beyond > 0,
    )


def _highest(mean: Real, variance: Real, chance: float) -> Real:
    """What a sum of squares of noise exceeds by this chance, from its mean and variance.

    Taken as gamma distributed (Satterthwaite 1946): where few lines carry the sum, its upper tail
    is far longer than that of a normal one.
    """
    known = (mean > 0) & (variance > 0)
    shape = np.where(known, mean, 1.0) ** 2 / np.where(known, variance, 1.0)
    return np.asarray(np.where(known, gammainccinv(shape, chance) * mean / shape, mean), float)


def solid_to(freq_hz: Real, beyond: Mask) -> float | None:
    """Last line before the first that is beyond; None if that is the first line."""
    first = int(np.argmax(beyond)) if beyond.any() else len(freq_hz)
    return float(freq_hz[first - 1]) if first else None


def _powers(
    data: BodyData, reading: Complex, model: Model, errors: Real
) -> tuple[Real, Real, Real]:
    """Residual, its noise and the variance of that, per line, in units of the readings."""
    power, noise, square = (np.zeros(len(data.freq_hz)) for _ in range(3))
    rows = model.rows(errors) * model.scale[:, None]
    for column, mask in enumerate(data.measured):
        unit = _unit(data.line[column])
        spare = project(rows, mask).spare
        left = (data.white[column] / reading) @ spare
        variance = (
            (data.noise[column] / np.abs(reading) ** 2) @ np.maximum(np.diag(spare), 0.0) * unit
        )
        power += (np.abs(left) ** 2).sum(axis=1) * unit
        noise += variance
        square += variance**2 / max(np.trace(spare), 1.0)
    return power, noise, square


def _sums(data: BodyData, reading: Complex) -> tuple[Real, Real]:
    unit = _unit(data.line)
    total = (np.abs(data.white / reading) ** 2).sum(axis=2) * unit
    noise = (data.noise / np.abs(reading) ** 2).sum(axis=2) * unit
    return total.sum(axis=0), noise.sum(axis=0)


def _tolerated(data: BodyData, drawn: Model) -> Real:
    """Residual of errors within tolerance: sum s_p^2 |P B_p x|^2, noise taken off."""
    zero = np.zeros(drawn.sensors.count)
    rows = drawn.rows(zero) * drawn.scale[:, None]
    slopes = drawn.sensors.slopes(zero) * (drawn.scale[:, None] * drawn.spread[:, None, None])
    total = np.zeros(len(data.freq_hz))
    for column, mask in enumerate(data.measured):
        split = project(rows, mask)
        seen = split.spare @ slopes
        metric = np.einsum("pcq,pcr->qr", seen, seen)
        motion = data.white[column] @ split.inverse.T
        share = np.einsum("fq,qr,fr->f", motion.conj(), metric, motion).real
        share -= data.noise[column] @ np.einsum("qc,qr,rc->c", split.inverse, metric, split.inverse)
        total += np.maximum(share, 0.0) * _unit(data.line[column])
    return total


def _unit(line: Real) -> Real:
    """Square of what turns whitened readings back into readings of their line."""
    return np.where(line > 0, 1 / np.where(line > 0, line, 1.0) ** 2, 0.0)


def _widths(freq_hz: Real) -> Real:
    """Lines in the window about each line; (n_freq,)."""
    first, last = _windows(freq_hz)
    return (last - first + 1).astype(float)


def _smooth(values: Real, freq_hz: Real) -> Real:
    """Mean over the window about each line."""
    first, last = _windows(freq_hz)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((total[last + 1] - total[first]) / (last - first + 1), float)


def _windows(freq_hz: Real) -> tuple[Integers, Integers]:
    """First and last line of the window about each line."""
    step = float(np.median(np.diff(freq_hz))) if len(freq_hz) > 1 else 1.0
    half = np.maximum(_FEWEST, np.round(_RELATIVE_WIDTH * freq_hz / step)).astype(np.intp)
    place = np.arange(len(freq_hz))
    return np.maximum(place - half, 0), np.minimum(place + half, len(freq_hz) - 1)
