r"""FRFs, coherence and variance of continuous excitation by one force or several at once.

With X the spectra of q forces and Y those of the motions in n independent blocks, averaged to
S_xx, S_yx and S_yy (Bendat and Piersol 2010, ch. 7):

    H1 = S_yx S_xx^-1
    g2 = (H1 S_xx H1^H) / S_yy                        multiple coherence
    cov(H_yi, H_yj) = (1 - g2) S_yy [S_xx^-1]_ij / (n - q)
    p2_i = |H_yi|^2 / (|H_yi|^2 + (1 - g2) S_yy [S_xx^-1]_ii)    partial coherence

The coherence of an FRF is the partial one: what its own force explains of the motion once all that
the other forces explain is taken off both. With one force it is the ordinary coherence.

*Leakage*: a Hann window of N samples smears a peak by a term that falls with 1 / N^2, so that the
FRFs of half the length differ by three times the error of the whole one. The square of that error,
beyond the noise of the difference, is added to the variance. Forces in closed loops and distortion:
``spectra``.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from identification.continuous.plan import ContinuousBlocks, plan_continuous_blocks
from identification.continuous.spectra import (
    ForcedSpectra,
    average_blocks,
    choose_lines,
    count_inputs,
)
from identification.continuous.whole_periods import align_periods
from identification.hits.estimators import AveragedSpectra, estimate_frf
from identification.hits.settings import HitSettings
from identification.noise.variance import implied_coherence
from identification.words import (
    Complex,
    Frf,
    FrfEstimate,
    InputError,
    Mask,
    Real,
    Records,
)

_MIN_FORCE_EIGENVALUE = 1e-8  # of S_xx: below it one force follows from the others
_MIN_DISTORTION = 1.5  # variance between realisations over that between periods, to be said
_MIN_LEAKAGE = 0.02  # of the motion at its peak, to be said
_DROPPED = 0.01  # force power over its usual size about a line, to be said: 20 dB
_NOT_EXCITED = 1e-8  # of its usual size: 80 dB, by which no shaker falls at a mode
_DROP_LINES = 41  # about a line, that say what is usual: far more than a mode is wide
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


def estimate_continuous_frf(
    records: Records, settings: HitSettings | None = None
) -> ContinuousEstimate:
    """Estimate the FRFs of one reference, whose force and those beside it never rest.

    Lines are every second one of blocks with Hann windows, whose neighbours tell the same, from
    the first above 0 Hz to 0.8 of half the sampling rate; of periods, those that the force excites.

    Args:
        settings: ``block_s``, ``period_s`` and ``estimator`` apply; the usual ones if None.

    Raises:
        InputError: too few blocks, forces that follow from one another, or a setting of hits.
    """
    settings = settings or HitSettings()
    _refuse_settings(records, settings)
    records, period, period_remarks = align_periods(records, settings)
    blocks = plan_continuous_blocks(records, settings.block_s, period)
    inputs = count_inputs(records)
    if int(blocks.count) <= inputs:
        raise InputError(
            f"{records.test}: {len(blocks.starts)} blocks of {_seconds(records, blocks)} in "
            f"{len(records.force)} records are too few for {inputs} forces: record longer, or set "
            "block_s"
        )
    spectra = average_blocks(records, blocks)
    lines = choose_lines(spectra, blocks, records)
    spectra = spectra.select(lines)
    _refuse_dependent(records, blocks, spectra)
    freq = np.arange(blocks.length // 2 + 1)[lines] * records.rate_hz / blocks.length
    values, variance = spectra.values[:, :, 0], spectra.variance()[:, :, 0]
    if inputs == 1 and settings.estimator != "H1":
        single = AveragedSpectra(
            spectra.force[:, 0, 0].real, spectra.motion, spectra.cross[:, :, 0], int(spectra.count)
        )
        values = estimate_frf(single, settings.estimator)
    bias, bias_variance, is_bent = spectra.window_bias(2 * np.pi * freq / records.rate_hz, blocks)
    is_kept = ~is_bent | is_bent.all()
    values, variance = (values - bias)[is_kept], (variance + bias_variance)[is_kept]
    freq, spectra = freq[is_kept], spectra.select(is_kept)
    lines[lines] = is_kept
    remarks = [
        *period_remarks,
        _describe(records, blocks),
        *_bent_sentence(records, freq, int((~is_kept).sum())),
        *_drop_sentence(records, freq, spectra.force[:, 0, 0].real, inputs),
    ]
    if blocks.kind == "random":
        leakage = _leakage(records, blocks, lines, freq, values, variance)
        remarks += _leakage_sentence(records, freq, values, leakage, variance)
        variance = variance + leakage
    if spectra.distortion is not None:
        variance = variance * np.maximum(spectra.distortion, 1.0)
        remarks += _distortion_sentence(records, spectra.distortion)
    averages = int(blocks.count)
    estimate = FrfEstimate(
        frf=Frf(freq, values[:, :, None], records.outputs, (records.reference,), records.quantity),
        variance=variance[:, :, None],
        # Of periods the noise is averaged over lines already, and the variance follows the force.
        variance_source="stated" if blocks.kind == "periodic" else "coherence",
        measured=np.ones((len(records.outputs), 1), bool),
        coherence=implied_coherence(values, variance, averages - inputs + 1)[:, :, None],
        averages=averages,
    )
    return ContinuousEstimate(estimate, blocks, tuple(remarks))


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


def _refuse_dependent(records: Records, blocks: ContinuousBlocks, spectra: ForcedSpectra) -> None:
    """Refuse forces of which one follows from the others at most lines."""
    size = np.sqrt(np.einsum("fii->fi", spectra.force).real)
    relative = spectra.force / (size[:, :, None] * size[:, None, :])
    smallest = np.linalg.eigvalsh(relative)[:, 0]
    if len(smallest) and np.median(smallest) > _MIN_FORCE_EIGENVALUE:
        return
    if not len(smallest):
        raise InputError(
            f"{records.test}: the force along {records.reference} excites no line below 0.8 of "
            "half the sampling rate: check which channel is the force, and that its reference moves"
        )
    names = ", ".join(map(str, (records.reference, *records.further_references)))
    count, inputs = len(records.force), count_inputs(records)
    if blocks.kind == "periodic" and count < inputs:
        raise InputError(
            f"{records.test}: {count} realisation{'s' * (count > 1)} cannot tell the {inputs} "
            f"forces along {names} apart: record as many realisations as there are forces, each "
            "with other phases, and state realisations of a log"
        )
    raise InputError(
        f"{records.test}: the forces along {names} are one signal, which cannot be told apart: "
        "record as many realisations as there are forces, each with other phases"
    )


def _leakage(
    records: Records,
    blocks: ContinuousBlocks,
    lines: Mask,
    freq_hz: Real,
    values: Complex,
    variance: Real,
) -> Real:
    """Return the square of the error by leakage; (n_freq, n_out)."""
    half = blocks.half()
    coarse = average_blocks(records, half).select(np.flatnonzero(lines) // 2)
    bias, bias_variance, _ = coarse.window_bias(2 * np.pi * freq_hz / records.rate_hz, half)
    noise = variance + coarse.variance()[:, :, 0] + bias_variance
    square = np.abs(coarse.values[:, :, 0] - bias - values) ** 2
    return np.asarray(np.maximum(square - noise, 0.0) / 9)


def _leakage_sentence(
    records: Records, freq_hz: Real, values: Complex, leakage: Real, variance: Real
) -> list[str]:
    share = np.sqrt(leakage) / np.abs(values).max(axis=0, initial=1e-300)
    share[leakage <= variance] = 0.0  # not beyond what noise may pretend
    line, row = np.unravel_index(int(share.argmax()), share.shape)
    if share[line, row] < _MIN_LEAKAGE:
        return []
    peak = int(np.abs(values[:, row]).argmax())
    is_mode = 0 < peak < len(values) - 1  # else the FRF is steep, as that of a free axis
    where, top = ("at sharp modes", "peak") if is_mode else ("of a steep FRF", "largest value")
    return [
        f"{records.test}, force along {records.reference}: leakage {where} is up to "
        f"{100 * share[line, row]:.2g} % of the {top} ({freq_hz[line]:.4g} Hz, "
        f"{records.outputs[row]}) and counts as noise; longer blocks (block_s) have less"
    ]


def _bent_sentence(records: Records, freq_hz: Real, count: int) -> list[str]:
    """Return a sentence on lines that are left out, as those where a sweep starts and stops."""
    if not count:
        return []
    return [
        f"{records.test}, force along {records.reference}: {count} lines are left out and "
        f"{freq_hz[0]:.4g} to {freq_hz[-1]:.4g} Hz remain, because only the ends of the record "
        "excite the others, where a window bends them: record some seconds of rest before and "
        "after a sweep"
    ]


def _drop_sentence(records: Records, freq_hz: Real, power: Real, inputs: int) -> list[str]:
    """Return a sentence on a force that falls at a mode, where its channel reads noise."""
    lines = max(_DROP_LINES, len(power) // 10)
    usual = median_filter(power, lines, mode="nearest")
    level = uniform_filter1d(power, 3, mode="nearest") / np.maximum(usual, 1e-300)
    level[level < _NOT_EXCITED] = 1.0  # as between the lines of a stepped sine
    line = int(level.argmin())
    if level[line] > _DROPPED:
        return []
    way_out = "" if inputs > 1 else '; estimator = "H2" or "Hv" is not biased in this way'
    return [
        f"{records.test}: the force along {records.reference} falls by "
        f"{-10 * np.log10(max(level[line], 1e-30)):.0f} dB at {freq_hz[line]:.4g} Hz, as that of a "
        f"shaker at a mode: noise of the force channel makes H1 too small there{way_out}"
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
