r"""Spectra of continuous excitation, averaged over blocks, and the FRFs that they give.

*Set points*: where a loop is closed, forces answer to the noise of the motion, and H1 is biased.
Signals Z that are recorded and independent of the noise, such as a controller's reference, at least
as many as forces, are instruments (joint input-output method; Soderstrom and Stoica 1989, ch. 8 and
10). X is replaced by what Z tells of it, S_xz S_zz^-1 Z, and the noise is that of Y - H X. Periods
of a force that a set point repeats are such instruments by themselves: noise does not repeat.

*Distortion*: a periodic force repeats the answer of nonlinear joints as well. Where records hold
more realisations than there are forces, the scatter between realisations shows noise and
distortion, that between periods noise alone (Pintelon and Schoukens 2012, ch. 4). The variance is
that of the realisations.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from scipy.ndimage import median_filter, uniform_filter1d

from identification.continuous.period_leakage import fit_leakage
from identification.continuous.plan import ContinuousBlocks
from identification.noise.variance import average_over_lines, several_input_variance
from identification.words import Complex, InputError, Integers, Mask, Real, Records

_USABLE_SHARE = 0.8  # of half the sampling rate: anti-aliasing filters act above
_MIN_LINE_POWER = 1e-6  # of the strongest line, of a periodic force: it has no power between lines
_MIN_STRENGTH = 10.0  # of instruments over noise in the forces (Stock and Yogo 2005: F of 10)
_NEIGHBOURS = 9  # lines whose median strength counts, and whose mean slope of the window
_MIN_SLOPE_LINES = 2  # by which an FRF has a slope
_MAX_BIAS = 0.2  # of an FRF, by a window: beyond it the first order is not enough
_MAX_EDGE = 2.0  # cot(pi t / L) at a distance t of 0.15 L from the end of a Hann window of length L
_MIN_SEEN = 3.0  # bias by a window, and its share, over their standard deviations
_SECOND_ORDER = 2.5  # over the square of a relative bias: where a sweep starts on a free axis


@dataclass(frozen=True, eq=False)
class ForcedSpectra:
    """Averages over blocks.

    Args:
        force: S_xx; (n_freq, n_in, n_in).
        cross: S_yx; (n_freq, n_out, n_in).
        motion: S_yy; (n_freq, n_out).
        count: independent blocks.
        noise: E|noise|^2 of S_yy's average where blocks repeat; (n_freq, n_out), else None.
        distortion: variance between realisations over that between periods; (n_out,), else None.
        weak: power of the noise in the forces' part that counts; (n_freq, n_in, n_in), else None.
        sloped: as cross, of the forces in the slope of the window, per sample; (n_freq, n_in,
            n_in), else None.
    """

    force: Complex
    cross: Complex
    motion: Real
    count: float
    noise: Real | None = None
    distortion: Real | None = None
    weak: Complex | None = None
    sloped: Complex | None = None

    @property
    def values(self) -> Complex:
        """H1; (n_freq, n_out, n_in)."""
        return self._per_force(self.cross)

    def _per_force(self, cross: Complex) -> Complex:
        solved = np.linalg.solve(self.force.swapaxes(1, 2), cross.swapaxes(1, 2))
        return np.asarray(solved.swapaxes(1, 2))

    def variance(self) -> Real:
        """E|error|^2 of H1; (n_freq, n_out, n_in)."""
        values = self.values
        if self.noise is not None:
            inverse = np.einsum("fii->fi", np.linalg.inv(self.force)).real
            return np.asarray(self.noise[:, :, None] * inverse[:, None, :])
        explained = np.einsum("foi,foi->fo", values, self.cross.conj()).real
        coherence = explained / np.where(self.motion > 0, self.motion, 1.0)
        # The formula counts whole averages; a fraction of one is none.
        return several_input_variance(values, coherence, self.force, int(self.count))

    def select(self, lines: Mask | Integers) -> "ForcedSpectra":
        """Return the averages on these lines alone."""
        noise = None if self.noise is None else self.noise[lines]
        weak = None if self.weak is None else self.weak[lines]
        sloped = None if self.sloped is None else self.sloped[lines]
        kept = self.force[lines], self.cross[lines], self.motion[lines]
        return ForcedSpectra(*kept, self.count, noise, self.distortion, weak, sloped)

    def window_bias(self, omega: Real, blocks: ContinuousBlocks) -> tuple[Complex, Real, Mask]:
        r"""Return what the slope of the window adds to the FRFs of the first force.

        A machine answers to a force in a window w(t) by H w x + i dH/domega w' x, to first order:
        it remembers the force of an instant at which the window was another. In blocks that overlap
        the slopes cancel, but not for what is excited at an end of the record alone, as by a sweep:
        of a random force chance is left, which differs from line to line.

        Args:
            omega: angular frequencies of the lines [rad per sample]; (n_freq,).
            blocks: how the records were cut.

        Returns:
            The bias, 0 where noise or the chance of a random force hides it, and the variance that
            its correction and its second order leave; (n_freq, n_out); and the lowest and
            highest lines that the edge of a window bends beyond use; (n_freq,).
        """
        none: Real = np.zeros(self.motion.shape)
        if self.sloped is None or len(omega) < _MIN_SLOPE_LINES:
            return none.astype(np.complex128), none, np.zeros(len(none), bool)
        values, share = self.values, self._per_force(self.sloped)[:, :, :1]
        bias = (1j * _slope(values, omega) @ share)[:, :, 0]
        spread = (np.abs(share) ** 2)[:, :, 0] / (2 * np.gradient(omega)[:, None] ** 2)
        noise = np.einsum("foi,fi->fo", self.variance(), spread)
        slope = np.gradient(blocks.window)
        chance = float(slope @ slope) / float(blocks.window @ blocks.window) / self.count
        smooth = uniform_filter1d(share, _NEIGHBOURS, axis=0, mode="nearest")
        is_seen = np.abs(bias) ** 2 > _MIN_SEEN**2 * noise
        is_seen &= np.abs(smooth).max(axis=1) > _MIN_SEEN * np.sqrt(chance / _NEIGHBOURS)
        square, bias = np.abs(bias) ** 2 * is_seen, bias * is_seen
        power = np.abs(values[:, :, 0]) ** 2
        is_large = square > _MAX_BIAS**2 * power
        second = np.divide(square**2, power, out=np.zeros_like(square), where=power > 0)
        variance = np.where(is_large, square, noise * is_seen) + _SECOND_ORDER**2 * second
        is_edge = np.abs(share).max(axis=(1, 2)) * len(blocks.window) > 2 * np.pi * _MAX_EDGE
        is_beside = np.logical_and.accumulate(is_edge)
        is_beside |= np.logical_and.accumulate(is_edge[::-1])[::-1]
        return bias * ~is_large, variance + power * is_edge[:, None], is_beside


def _slope(values: Complex, omega: Real) -> Complex:
    """Return dH/domega by the slope of log H, which is right for steep FRFs too."""
    size = np.log(np.maximum(np.abs(values), np.finfo(float).tiny))
    logarithm = size + 1j * np.unwrap(np.angle(values), axis=0)
    return np.asarray(values * np.gradient(logarithm, omega, axis=0))


def average_blocks(records: Records, blocks: ContinuousBlocks) -> ForcedSpectra:
    """Return the averages by which the FRFs of these blocks are estimated.

    Args:
        blocks: how they are cut.

    Raises:
        InputError: fewer set points than forces.
    """
    if blocks.kind == "periodic":
        return _average_periods(records, blocks)
    average = _average_by_set_points if len(records.set_points) else _average
    spectra, n_out = average(records, blocks), len(records.outputs)
    return replace(
        spectra,
        cross=spectra.cross[:, :n_out],
        motion=spectra.motion[:, :n_out],
        noise=None if spectra.noise is None else spectra.noise[:, :n_out],
        sloped=spectra.cross[:, n_out:] if blocks.kind == "random" else None,
    )


def _average(records: Records, blocks: ContinuousBlocks) -> ForcedSpectra:
    """Average the spectra of all blocks, block after block."""
    n_freq, n_in = blocks.length // 2 + 1, count_inputs(records)
    n_out = n_in + len(records.outputs)
    force: Complex = np.zeros((n_freq, n_in, n_in), np.complex128)
    cross: Complex = np.zeros((n_freq, n_out, n_in), np.complex128)
    motion, count = np.zeros((n_freq, n_out)), 0
    for record in range(len(records.force)):
        for x, y in _block_spectra(records, blocks, record):
            force += x[:, :, None] * x[:, None, :].conj()
            cross += y[:, :, None] * x[:, None, :].conj()
            motion += np.abs(y) ** 2
            count += 1
    return ForcedSpectra(force / count, cross / count, motion / count, blocks.count)


def _average_by_set_points(records: Records, blocks: ContinuousBlocks) -> ForcedSpectra:
    """Average the spectra of all blocks, with the set points as instruments."""
    n_in, n_set = count_inputs(records), len(records.set_points)
    if n_set < n_in:
        raise InputError(
            f"{records.test}: {n_set} references for {n_in} motors: record a reference or an "
            "injected disturbance for each motor"
        )
    n_freq, n_all = blocks.length // 2 + 1, 2 * n_in + n_set + len(records.outputs)
    whole: Complex = np.zeros((n_freq, n_all, n_all), np.complex128)
    count = 0
    for record in range(len(records.force)):
        set_points = records.set_points[:, record]
        for start, (x, y) in zip(
            blocks.starts, _block_spectra(records, blocks, record), strict=True
        ):
            z = _spectrum(set_points[:, start : start + blocks.length], blocks.window)
            signals = np.hstack([x, z, y])
            whole += signals[:, :, None] * signals[:, None, :].conj()
            count += 1
    whole /= count
    of_x, of_z, of_y = slice(n_in), slice(n_in, n_in + n_set), slice(n_in + n_set, None)
    inverse = np.linalg.pinv(whole[:, of_z, of_z], hermitian=True)
    force = whole[:, of_x, of_z] @ inverse @ whole[:, of_z, of_x]
    cross = whole[:, of_y, of_z] @ inverse @ whole[:, of_z, of_x]
    values = cross @ np.linalg.pinv(force, hermitian=True)
    motion = np.einsum("fii->fi", whole[:, of_y, of_y]).real
    residual = _residual_power(values, motion, whole[:, of_y, of_x], whole[:, of_x, of_x])
    free = max(int(blocks.count) - n_set, 1)
    weak = (whole[:, of_x, of_x] - force) * n_set / free
    return ForcedSpectra(force, cross, motion, blocks.count, residual / free, weak=weak)


def _residual_power(values: Complex, motion: Real, cross: Complex, force: Complex) -> Real:
    """Return the mean of |y - H x|^2; (n_freq, n_out).

    Args:
        motion: mean of |y|^2; (n_freq, n_out).
        cross: mean of y x^H; (n_freq, n_out, n_in).
        force: mean of x x^H; (n_freq, n_in, n_in).
    """
    mixed = np.einsum("foi,foi->fo", values, cross.conj()).real
    followed = np.einsum("foi,fij,foj->fo", values, force, values.conj()).real
    return np.asarray(np.maximum(motion - 2 * mixed + followed, 0.0))


def _average_periods(records: Records, blocks: ContinuousBlocks) -> ForcedSpectra:
    r"""Average the periods of each realisation, without what leaks into them, and with their noise.

    With x and y what noise adds to the lines of forces and motions (``period_leakage``), the mean
    of R realisations has the variance sum |y - H x|^2 / R^2. Between realisations of mean spectra
    X_r and Y_r and q forces it is sum |Y_r - H X_r|^2 / (R - q) / R. Noise changes slowly along
    frequency and the forces need not, so it is averaged over lines before it is divided by their
    power.
    """
    n_record, n_block = len(records.force), len(blocks.starts)
    n_in, n_out = count_inputs(records), len(records.outputs)
    n_freq, part = blocks.length // 2 + 1, slice(blocks.starts[0], blocks.starts[-1])
    part = slice(part.start, part.stop + blocks.length)
    means: Complex = np.zeros((n_record, n_freq, n_in + n_out), np.complex128)
    scatter: Complex = np.zeros((n_freq, n_in + n_out, n_in + n_out), np.complex128)
    for record in range(n_record):
        forces = np.vstack([records.force[record][None], records.further_forces[:, record]])
        signals = np.vstack([forces, records.motion[record]])[:, part]
        centred = signals - signals.mean(axis=1, keepdims=True)
        whole: Complex = np.asarray(scipy.fft.fft(centred, axis=1).T / n_block, np.complex128)
        leakage, beside = fit_leakage(whole, n_block, n_freq)
        means[record] = whole[::n_block][:n_freq] - leakage
        scatter += beside
    x, y = means[..., :n_in], means[..., n_in:]
    force = np.einsum("rfi,rfj->fij", x, x.conj()).astype(np.complex128)
    cross = np.einsum("rfo,rfi->foi", y, x.conj()).astype(np.complex128)
    power = np.einsum("fii->fi", force).real
    is_driven = (power > _MIN_LINE_POWER * power.max(axis=0)).all(axis=1)
    values = cross @ np.linalg.pinv(force, hermitian=True) * is_driven[:, None, None]
    noise = _residual_power(
        values,
        np.einsum("fii->fi", scatter[:, n_in:, n_in:]).real,
        scatter[:, n_in:, :n_in],
        scatter[:, :n_in, :n_in],
    )
    noise = average_over_lines(noise, 2 * n_record * (n_block - 1))
    spectra = ForcedSpectra(
        force / n_record,
        cross / n_record,
        (np.abs(y) ** 2).mean(axis=0),
        blocks.count,
        noise / n_record**2,
        weak=scatter[:, :n_in, :n_in] / n_record,
    )
    free = n_record - n_in
    if free <= 0:
        return spectra
    excited = choose_lines(spectra, blocks, records)
    values = spectra.select(excited).values
    residual = y[:, excited] - np.einsum("foi,rfi->rfo", values, x[:, excited])
    between = (np.abs(residual) ** 2).sum(axis=(0, 1)) / free / n_record
    return replace(spectra, distortion=between * n_record**2 / noise[excited].sum(axis=0))


def _block_spectra(
    records: Records, blocks: ContinuousBlocks, record: int
) -> Iterator[tuple[Complex, Complex]]:
    """Yield the spectra of each block: of forces (n_freq, n_in), and (n_freq, n_out + n_in).

    The latter are those of the motions, and then of the forces in the slope of the window.
    """
    forces = np.vstack([records.force[record][None], records.further_forces[:, record]])
    slope = np.gradient(blocks.window)
    for start in blocks.starts:
        part = slice(start, start + blocks.length)
        motion = _spectrum(records.motion[record][:, part], blocks.window)
        sloped = _spectrum(forces[:, part], slope)
        yield _spectrum(forces[:, part], blocks.window), np.hstack([motion, sloped])


def count_inputs(records: Records) -> int:
    """Return the number of forces that act at once."""
    return 1 + len(records.further_references)


def _spectrum(signals: Real, window: Real) -> Complex:
    """Return the spectra of signals without their means; (n_freq, n_signal)."""
    centred = signals - signals.mean(axis=1, keepdims=True)
    return np.asarray(scipy.fft.rfft(centred * window, axis=1).T)


def choose_lines(spectra: ForcedSpectra, blocks: ContinuousBlocks, records: Records) -> Mask:
    """Return the lines that count; (n_freq,)."""
    numbers = np.arange(len(spectra.motion))
    usable = numbers * records.rate_hz / blocks.length <= _USABLE_SHARE * records.rate_hz / 2
    power = np.einsum("fii->fi", spectra.force).real
    power = (power / np.maximum(power.max(axis=0), np.finfo(float).tiny)).min(axis=1)
    chosen: Mask = (numbers > 0) & usable & (power > 0)
    if blocks.kind == "random":
        chosen &= numbers % 2 == 0
    if blocks.kind == "periodic":
        chosen &= power > _MIN_LINE_POWER * power[chosen].max(initial=0.0)
    if spectra.weak is not None and chosen.any():
        # A force that the set points hardly move is noise, and no FRF has a region there. Of many
        # such lines some pass by chance, but not most of their neighbours.
        power, noise = (np.einsum("fii->fi", m[chosen]).real for m in (spectra.force, spectra.weak))
        strength = (power / np.maximum(noise, _MIN_LINE_POWER * power)).min(axis=1)
        width = min(_NEIGHBOURS, len(strength))
        chosen[chosen] = median_filter(strength, width, mode="nearest") > _MIN_STRENGTH
    return chosen
