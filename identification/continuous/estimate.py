r"""FRFs, coherence and variance of continuous excitation by one force or several at once.

With X the spectra of q forces and Y those of the motions in n independent blocks, averaged to
S_xx, S_yx and S_yy (Bendat and Piersol 2010, ch. 7):

    H1 = S_yx S_xx^-1
    g2 = (H1 S_xx H1^H) / S_yy                        multiple coherence
    cov(H_yi, H_yj) = (1 - g2) S_yy [S_xx^-1]_ij / (n - q)

*Set points*: where a loop is closed, forces answer to the noise of the motion, and H1 is biased.
Signals Z that are recorded and independent of the noise, such as a controller's reference, at least
as many as forces, are instruments (joint input-output method; Soderstrom and Stoica 1989, ch. 8 and
10). X is replaced by what Z tells of it, S_xz S_zz^-1 Z, and the noise is that of Y - H X. Periods
of a force that a set point repeats are such instruments by themselves: noise does not repeat.

*Leakage*: a Hann window of N samples smears a peak by a term that falls with 1 / N^2, so that the
FRFs of half the length differ by three times the error of the whole one. The square of that error,
beyond the noise of the difference, is added to the variance.

*Distortion*: a periodic force repeats the answer of nonlinear joints as well. Where records hold
more realisations than there are forces, the scatter between realisations shows noise and
distortion, that between periods noise alone (Pintelon and Schoukens 2012, ch. 4). The variance is
that of the realisations.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from scipy.ndimage import median_filter

from identification.continuous.plan import ContinuousBlocks, plan_continuous_blocks
from identification.hits.estimators import AveragedSpectra, estimate_frf
from identification.hits.settings import HitSettings
from identification.noise.variance import implied_coherence, several_input_variance
from identification.words import (
    Complex,
    Frf,
    FrfEstimate,
    InputError,
    Integers,
    Mask,
    Real,
    Records,
)

_USABLE_SHARE = 0.8  # of half the sampling rate: anti-aliasing filters act above
_MIN_LINE_POWER = 1e-6  # of the strongest line, of a periodic force: it has no power between lines
_MIN_FORCE_EIGENVALUE = 1e-8  # of S_xx: below it one force follows from the others
_HELD_SHARE = 0.2  # of the rate, above which images of a held command count
_MIN_STRENGTH = 10.0  # of instruments over noise in the forces (Stock and Yogo 2005: F of 10)
_NEIGHBOURS = 9  # lines whose median strength counts
_MIN_DISTORTION = 1.5  # variance between realisations over that between periods, to be said
_MIN_LEAKAGE = 0.02  # of the motion at its peak, to be said
_KIND_WORDS = {
    "periodic": "a force that repeats",
    "burst": "bursts",
    "random": "a force that neither repeats nor rests",
}


@dataclass(frozen=True, eq=False)
class ContinuousEstimate:
    """FRFs of one reference, and how they were made.

    Args:
        estimate: FRFs with coherence and variance.
        blocks: how the records were cut.
        remarks: sentences that a reader of the result must know.
    """

    estimate: FrfEstimate
    blocks: ContinuousBlocks
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Averages over blocks.

    Args:
        force: S_xx; (n_freq, n_in, n_in).
        cross: S_yx; (n_freq, n_out, n_in).
        motion: S_yy; (n_freq, n_out).
        count: independent blocks.
        noise: E|noise|^2 of S_yy's average where blocks repeat; (n_freq, n_out), else None.
        distortion: variance between realisations over that between periods; (n_out,), else None.
        weak: power of the noise in the forces' part that counts; (n_freq, n_in, n_in), else None.
    """

    force: Complex
    cross: Complex
    motion: Real
    count: float
    noise: Real | None = None
    distortion: Real | None = None
    weak: Complex | None = None

    @property
    def values(self) -> Complex:
        """H1; (n_freq, n_out, n_in)."""
        solved = np.linalg.solve(self.force.swapaxes(1, 2), self.cross.swapaxes(1, 2))
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

    def select(self, lines: Mask | Integers) -> "_Spectra":
        """Return the averages on these lines alone."""
        noise = None if self.noise is None else self.noise[lines]
        weak = None if self.weak is None else self.weak[lines]
        kept = self.force[lines], self.cross[lines], self.motion[lines]
        return _Spectra(*kept, self.count, noise, self.distortion, weak)


def estimate_continuous_frf(
    records: Records, settings: HitSettings | None = None
) -> ContinuousEstimate:
    """Estimate the FRFs of one reference, whose force and those beside it never rest.

    Lines are every second one of blocks with Hann windows, whose neighbours tell the same, from
    the first above 0 Hz to 0.8 of half the sampling rate; of periods, those that the force excites.

    Args:
        records: of one reference.
        settings: ``block_s`` and ``estimator`` apply; the usual ones if None.

    Raises:
        InputError: too few blocks, forces that follow from one another, or a setting of hits.
    """
    settings = settings or HitSettings()
    _refuse_settings(records, settings)
    blocks = plan_continuous_blocks(records, settings.block_s)
    inputs = _count_inputs(records)
    if int(blocks.count) <= inputs:
        raise InputError(
            f"{records.test}: {len(blocks.starts)} blocks of {_seconds(records, blocks)} in "
            f"{len(records.force)} records are too few for {inputs} forces: record longer, or set "
            "block_s"
        )
    has_set_points = bool(len(records.set_points)) and blocks.kind != "periodic"
    average = _average_by_set_points if has_set_points else _average
    average = _average_periods if blocks.kind == "periodic" else average
    spectra = average(records, blocks)
    lines = _choose_lines(spectra, blocks, records)
    spectra = spectra.select(lines)
    _refuse_dependent(records, spectra)
    freq = np.arange(blocks.length // 2 + 1)[lines] * records.rate_hz / blocks.length
    values, variance = spectra.values[:, :, 0], spectra.variance()[:, :, 0]
    if inputs == 1 and settings.estimator != "H1":
        single = AveragedSpectra(
            spectra.force[:, 0, 0].real, spectra.motion, spectra.cross[:, :, 0], int(spectra.count)
        )
        values = estimate_frf(single, settings.estimator)
    remarks = [_describe(records, blocks)]
    if blocks.kind == "random":
        leakage = _leakage(records, blocks, lines, values, variance)
        remarks += _leakage_sentence(records, freq, values, leakage, variance)
        variance = variance + leakage
    if spectra.distortion is not None:
        variance = variance * np.maximum(spectra.distortion, 1.0)
        remarks += _distortion_sentence(records, spectra.distortion)
    averages = int(blocks.count)
    estimate = FrfEstimate(
        frf=Frf(freq, values[:, :, None], records.outputs, (records.reference,), records.quantity),
        variance=variance[:, :, None],
        variance_source="coherence",
        measured=np.ones((len(records.outputs), 1), bool),
        coherence=implied_coherence(values, variance, averages)[:, :, None],
        averages=averages,
    )
    return ContinuousEstimate(estimate, blocks, tuple(remarks))


def remove_hold(continuous: ContinuousEstimate, rate_hz: float) -> ContinuousEstimate:
    """Return the FRFs by the force that acts, where its record is the command that is held.

    A command that acts until the next sample acts as (1 - exp(-s T)) / (s T) of it, s = i w and T
    the time of a sample: half a sample late, and smaller towards half the rate. Its images about
    the rate move the machine too: at a fifth of the rate an inertia follows the first one by
    (1/4)^3 of the command, and lines above are left out.

    Args:
        continuous: FRFs by the command.
        rate_hz: samples per second.
    """
    estimate = continuous.estimate
    estimate = estimate.select_lines(estimate.frf.freq_hz <= _HELD_SHARE * rate_hz)
    phase = 2j * np.pi * estimate.frf.freq_hz / rate_hz
    hold = ((1 - np.exp(-phase)) / phase)[:, None, None]
    frf = replace(estimate.frf, values=estimate.frf.values / hold)
    estimate = replace(estimate, frf=frf, variance=estimate.variance / np.abs(hold) ** 2)
    return replace(continuous, estimate=estimate)


def _refuse_settings(records: Records, settings: HitSettings) -> None:
    """Refuse settings that only hits have, and estimators of one force where several act."""
    usual = HitSettings()
    for key in ("pretrigger_s", "force_window_s", "exponential_tau", "window_tau"):
        if getattr(settings, key) not in (None, getattr(usual, key)):
            raise InputError(
                f"{records.test}: the force along {records.reference} never rests, but {key} is "
                f"for hits: remove {key} from its [[test]]"
            )
    if records.further_references and settings.estimator != "H1":
        raise InputError(
            f"{records.test}: {settings.estimator} is for one force, and "
            f"{1 + len(records.further_references)} act at once: remove estimator"
        )


def _average(records: Records, blocks: ContinuousBlocks) -> _Spectra:
    """Average the spectra of all blocks, block after block."""
    n_freq, n_in, n_out = blocks.length // 2 + 1, _count_inputs(records), len(records.outputs)
    force: Complex = np.zeros((n_freq, n_in, n_in), np.complex128)
    cross: Complex = np.zeros((n_freq, n_out, n_in), np.complex128)
    motion, count = np.zeros((n_freq, n_out)), 0
    for record in range(len(records.force)):
        for x, y in _block_spectra(records, blocks, record):
            force += x[:, :, None] * x[:, None, :].conj()
            cross += y[:, :, None] * x[:, None, :].conj()
            motion += np.abs(y) ** 2
            count += 1
    return _Spectra(force / count, cross / count, motion / count, blocks.count)


def _average_by_set_points(records: Records, blocks: ContinuousBlocks) -> _Spectra:
    """Average the spectra of all blocks, with the set points as instruments."""
    n_in, n_set = _count_inputs(records), len(records.set_points)
    if n_set < n_in:
        raise InputError(
            f"{records.test}: {n_set} references for {n_in} motors: record a reference or an "
            "injected disturbance for each motor"
        )
    n_freq, n_all = blocks.length // 2 + 1, n_in + n_set + len(records.outputs)
    whole: Complex = np.zeros((n_freq, n_all, n_all), np.complex128)
    count = 0
    for record in range(len(records.force)):
        set_points = records.set_points[:, record]
        for start, (x, y) in zip(
            blocks.starts, _block_spectra(records, blocks, record), strict=True
        ):
            z = _spectrum(set_points[:, start : start + blocks.length], blocks)
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
    left = _residual_power(values, motion, whole[:, of_y, of_x], whole[:, of_x, of_x])
    free = max(int(blocks.count) - n_set, 1)
    weak = (whole[:, of_x, of_x] - force) * n_set / free
    return _Spectra(force, cross, motion, blocks.count, left / free, weak=weak)


def _residual_power(values: Complex, motion: Real, cross: Complex, force: Complex) -> Real:
    """Return the mean of |y - H x|^2; (n_freq, n_out).

    Args:
        values: H; (n_freq, n_out, n_in).
        motion: mean of |y|^2; (n_freq, n_out).
        cross: mean of y x^H; (n_freq, n_out, n_in).
        force: mean of x x^H; (n_freq, n_in, n_in).
    """
    mixed = np.einsum("foi,foi->fo", values, cross.conj()).real
    followed = np.einsum("foi,fij,foj->fo", values, force, values.conj()).real
    return np.asarray(np.maximum(motion - 2 * mixed + followed, 0.0))


def _average_periods(records: Records, blocks: ContinuousBlocks) -> _Spectra:
    """Average the periods of each realisation first, which leaves its noise apart.

    With M periods of R realisations, X_r and Y_r their means and q forces, the noise of the mean
    of all is sum |Y - Y_r - H (X - X_r)|^2 / (R (M - 1)) / (R M), and its variance between
    realisations sum |Y_r - H X_r|^2 / (R - q) / R.
    """
    n_record, n_block = len(records.force), len(blocks.starts)
    n_in, n_out = _count_inputs(records), len(records.outputs)
    forces: list[Complex] = []
    motions: list[Complex] = []
    n_freq = blocks.length // 2 + 1
    scatter: Complex = np.zeros((n_freq, n_in + n_out, n_in + n_out), np.complex128)
    for record in range(n_record):
        pairs = list(_block_spectra(records, blocks, record))
        forces.append(np.mean([force for force, _ in pairs], axis=0))
        motions.append(np.mean([motion for _, motion in pairs], axis=0))
        for force, motion in pairs:
            off = np.hstack([force - forces[-1], motion - motions[-1]])
            scatter += off[:, :, None] * off[:, None, :].conj()
    x, y = np.stack(forces), np.stack(motions)
    force = np.einsum("rfi,rfj->fij", x, x.conj()).astype(np.complex128)
    cross = np.einsum("rfo,rfi->foi", y, x.conj()).astype(np.complex128)
    noise = _residual_power(
        cross @ np.linalg.pinv(force, hermitian=True),
        np.einsum("fii->fi", scatter[:, n_in:, n_in:]).real,
        scatter[:, n_in:, :n_in],
        scatter[:, :n_in, :n_in],
    )
    degrees = n_record * (n_block - 1) * n_block
    spectra = _Spectra(
        force / n_record,
        cross / n_record,
        (np.abs(y) ** 2).mean(axis=0),
        blocks.count,
        noise / (degrees * n_record),
        weak=scatter[:, :n_in, :n_in] / degrees,
    )
    free = n_record - n_in
    if free <= 0:
        return spectra
    excited = _choose_lines(spectra, blocks, records)
    values = spectra.select(excited).values
    left = y[:, excited] - np.einsum("foi,rfi->rfo", values, x[:, excited])
    between = (np.abs(left) ** 2).sum(axis=(0, 1)) / free / n_record
    return replace(spectra, distortion=between * degrees * n_record / noise[excited].sum(axis=0))


def _block_spectra(
    records: Records, blocks: ContinuousBlocks, record: int
) -> Iterator[tuple[Complex, Complex]]:
    """Yield the spectra of forces (n_freq, n_in) and motions (n_freq, n_out) of each block."""
    forces = np.vstack([records.force[record][None], records.further_forces[:, record]])
    for start in blocks.starts:
        part = slice(start, start + blocks.length)
        yield _spectrum(forces[:, part], blocks), _spectrum(records.motion[record][:, part], blocks)


def _count_inputs(records: Records) -> int:
    return 1 + len(records.further_references)


def _spectrum(signals: Real, blocks: ContinuousBlocks) -> Complex:
    """Return the spectra of signals without their means; (n_freq, n_signal)."""
    centred = signals - signals.mean(axis=1, keepdims=True)
    return np.asarray(scipy.fft.rfft(centred * blocks.window, axis=1).T)


def _choose_lines(spectra: _Spectra, blocks: ContinuousBlocks, records: Records) -> Mask:
    """Return the lines that count; (n_freq,)."""
    numbers = np.arange(len(spectra.motion))
    usable = numbers * records.rate_hz / blocks.length <= _USABLE_SHARE * records.rate_hz / 2
    power = np.einsum("fii->fi", spectra.force).real.min(axis=1)
    chosen: Mask = (numbers > 0) & usable & (power > 0)
    if blocks.kind == "random":
        chosen &= numbers % 2 == 0
    if blocks.kind == "periodic":
        chosen &= power > _MIN_LINE_POWER * power[chosen].max(initial=0.0)
    if spectra.weak is not None:
        # A force that the set points hardly move is noise, and no FRF has a region there. Of many
        # such lines some pass by chance, but not most of their neighbours.
        power, noise = (np.einsum("fii->fi", m[chosen]).real for m in (spectra.force, spectra.weak))
        strength = (power / np.maximum(noise, _MIN_LINE_POWER * power)).min(axis=1)
        width = min(_NEIGHBOURS, len(strength))
        chosen[chosen] = median_filter(strength, width, mode="nearest") > _MIN_STRENGTH
    return chosen


def _refuse_dependent(records: Records, spectra: _Spectra) -> None:
    """Refuse forces of which one follows from the others at most lines."""
    size = np.sqrt(np.einsum("fii->fi", spectra.force).real)
    relative = spectra.force / (size[:, :, None] * size[:, None, :])
    smallest = np.linalg.eigvalsh(relative)[:, 0]
    if len(smallest) and np.median(smallest) > _MIN_FORCE_EIGENVALUE:
        return
    if not len(smallest):
        raise InputError(
            f"{records.test}: the force along {records.reference} excites no line below 0.8 of "
            "half the sampling rate: check which channel is the force"
        )
    names = ", ".join(map(str, (records.reference, *records.further_references)))
    raise InputError(
        f"{records.test}: the forces along {names} are one signal, which cannot be told apart: "
        "record as many realisations as there are forces, each with other phases"
    )


def _leakage(
    records: Records, blocks: ContinuousBlocks, lines: Mask, values: Complex, variance: Real
) -> Real:
    """Return the square of the error by leakage; (n_freq, n_out)."""
    average = _average_by_set_points if len(records.set_points) else _average
    coarse = average(records, blocks.half()).select(np.flatnonzero(lines) // 2)
    noise = variance + coarse.variance()[:, :, 0]
    square = np.abs(coarse.values[:, :, 0] - values) ** 2
    return np.asarray(np.maximum(square - noise, 0.0) / 9)


def _leakage_sentence(
    records: Records, freq_hz: Real, values: Complex, leakage: Real, variance: Real
) -> list[str]:
    share = np.sqrt(leakage) / np.abs(values).max(axis=0, initial=1e-300)
    share[leakage <= variance] = 0.0  # not beyond what noise may pretend
    line, row = np.unravel_index(int(share.argmax()), share.shape)
    if share[line, row] < _MIN_LEAKAGE:
        return []
    return [
        f"{records.test}, force along {records.reference}: leakage at sharp modes is up to "
        f"{100 * share[line, row]:.2g} % of the peak ({freq_hz[line]:.4g} Hz, "
        f"{records.outputs[row]}) and counts as noise; longer blocks (block_s) have less"
    ]


def _distortion_sentence(records: Records, ratio: Real) -> list[str]:
    row = int(ratio.argmax())
    if ratio[row] < _MIN_DISTORTION:
        return []
    return [
        f"{records.test}: realisations differ by {np.sqrt(ratio[row]):.2g} times the noise at "
        f"{records.outputs[row]}, which is nonlinear distortion or a drift, and counts as noise"
    ]


def _describe(records: Records, blocks: ContinuousBlocks) -> str:
    names = sorted(map(str, (records.reference, *records.further_references)))
    forces = "force" if len(names) == 1 else "forces at once"
    window = ", Hann windows that overlap by two thirds" if blocks.kind == "random" else ""
    n_block = len(records.force) * len(blocks.starts)
    return (
        f"{records.test}, {forces} along {', '.join(names)}: {_KIND_WORDS[blocks.kind]}, {n_block} "
        f"blocks of {_seconds(records, blocks)}{window}, {blocks.count:.3g} independent"
    )


def _seconds(records: Records, blocks: ContinuousBlocks) -> str:
    return f"{blocks.length / records.rate_hz:.4g} s"
