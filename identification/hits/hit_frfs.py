"""Estimation of FRFs from records: hits are found, cut, checked, windowed and averaged."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import scipy.fft

from identification.hits.blocks import BlockPlan, Blocks, common_setting, cut_blocks, plan_blocks
from identification.hits.densities import (
    hit_densities,
    noise_densities,
    noise_powers,
    record_traces,
)
from identification.hits.detection import Blow, find_blows
from identification.hits.estimators import AveragedSpectra, average_spectra, estimate_frf
from identification.hits.hit_drift import describe_drift
from identification.hits.hit_signals import (
    describe_coarse_channels,
    find_coarse_channels,
    find_hum,
    leave_out_dying_channels,
)
from identification.hits.peak_slope import estimate_peak_slope
from identification.hits.rejection import reject_hits
from identification.hits.remarks import hit_remarks, window_remarks
from identification.hits.settings import HitSettings
from identification.hits.windows import (
    choose_tau,
    combine_windows,
    detect_recorded_window,
    exponential_windows,
    force_windows,
    residual_response,
)
from identification.noise.variance import coherence_variance, difference_variance
from identification.words import (
    Complex,
    Frf,
    FrfEstimate,
    Hit,
    HitEstimate,
    HitRejection,
    InputError,
    Real,
    Records,
    SpectralDensities,
)

_MIN_DIFFERENCE_VARIANCE = 1e-3  # of 20: bounds the correction for very short windows
_Key = tuple[Records, HitSettings, BlockPlan]


@dataclass(eq=False)
class KeptEstimates:
    """Results of one reference's records alone, for the next call with the same object.

    Args:
        residuals: residual response of records with their settings and blocks.
        estimates: estimates of the same with one exponential window.
    """

    residuals: dict[_Key, float] = field(default_factory=dict)
    estimates: dict[tuple[_Key, float], HitEstimate] = field(default_factory=dict)


def estimate_hit_frf(records: Records, settings: HitSettings | None = None) -> HitEstimate:
    """Estimate the FRFs of one reference; see ``estimate_hit_frfs``."""
    (hits,) = estimate_hit_frfs([records], [settings or HitSettings()])
    return replace(hits, remarks=(*hits.remarks, *window_remarks([hits])))


def estimate_hit_frfs(
    records: Sequence[Records],
    settings: Sequence[HitSettings],
    kept: KeptEstimates | None = None,
) -> tuple[HitEstimate, ...]:
    """Estimate the FRFs of all references, on one frequency axis and with one exponential window.

    H1, H2 or Hv is computed on the lines k / block_s from 0 Hz to half the sampling rate; X(w) is
    the sum of x(t) exp(-i w t), which is the convention exp(+i w t). The variance of each complex
    value (real plus imaginary part) is |H|^2 (1 - g2) / (g2 (n - 1)). A single hit has no
    coherence, which would be 1, and its variance comes from differences along frequency. Errors of
    neighbouring lines are independent, except that an exponential window correlates them over
    1 / (pi tau) Hz. A window that the analyser has applied to force and motion already, with the
    time constant ``window_tau`` of the settings, multiplies with that of this function.

    Args:
        records: records of each reference; a reference may appear several times.
        settings: settings of each of the records.
        kept: of the call before, while a test runs; it becomes that of this call.

    Returns:
        One estimate for each of the records.

    Raises:
        InputError: there is no hit, no hit can be used, or settings or sampling rates contradict
            one another.
    """
    blows = [find_blows(reference) for reference in records]
    plan = plan_blocks(records, blows, settings)
    kept = KeptEstimates() if kept is None else kept
    keys: list[_Key] = [(*pair, plan) for pair in zip(records, settings, strict=True)]
    blows_of = dict(zip(keys, blows, strict=True))

    @cache
    def select(key: _Key) -> _UsableHits:
        reference, setting, _ = key
        return _select_hits(reference, blows_of[key], plan, setting)

    kept.residuals = {
        key: select(key).residual_response
        if (residual := kept.residuals.get(key)) is None
        else residual
        for key in keys
    }
    tau = common_setting(records, settings, "exponential_tau")
    if tau is None:
        length_s = (plan.block - plan.pretrigger) / records[0].rate_hz
        tau = choose_tau(length_s, list(kept.residuals.values()))
    kept.estimates = {
        (key, tau): kept.estimates.get((key, tau)) or _estimate(select(key), key[1], tau)
        for key in keys
    }
    return tuple(kept.estimates[key, tau] for key in keys)


@dataclass(frozen=True, eq=False)
class _UsableHits:
    """Hits of one reference that are averaged.

    Args:
        blocks: blocks of these hits, with the force window applied.
        window: force window; (n_hit, n_sample).
        left_out: rejected hits.
        residual_response: amplitude at the end of the blocks over the largest amplitude.
        noise: spectral densities before the hits, or None.
        recorded_tau: time constant of the exponential window that the records seem to carry
            [s]; None for none.
        faults: clauses on the signals of the hits, with what follows.
    """

    blocks: Blocks
    window: Real
    left_out: tuple[HitRejection, ...]
    residual_response: float
    noise: SpectralDensities | None
    recorded_tau: float | None
    faults: tuple[str, ...]


def _select_hits(
    records: Records, blows: tuple[Blow, ...], plan: BlockPlan, settings: HitSettings
) -> _UsableHits:
    """Cut the blocks of one reference, reject bad hits and window the force."""
    blocks, left_out = cut_blocks(records, blows, plan)
    blocks = blocks.keep(np.array([b.number not in settings.left_out for b in blocks.blows], bool))
    blocks, faults = leave_out_dying_channels(blocks)
    if settings.reject and blocks.blows:
        blocks, rejected = reject_hits(blocks, lambda chosen: hit_spectra(chosen, settings))
        left_out += rejected
    if not blocks.blows:
        raise InputError(
            f"{records.test}: none of the {len(blows)} hits along {records.reference} can be used: "
            f"{'; '.join(map(str, left_out[:3]))}: repeat the test, or set block_s, "
            "pretrigger_s or reject = false"
        )
    window = force_windows(blocks, settings.force_window_s)
    recorded_tau = detect_recorded_window(blocks)
    blocks = replace(blocks, force=blocks.force * window)
    noise = noise_densities(blocks.records, blows, plan.block)
    window_s = float((window > 0).sum(axis=1).max()) / records.rate_hz
    return _UsableHits(
        blocks,
        window,
        left_out,
        residual_response(blocks),
        noise,
        recorded_tau,
        (*faults, *_describe_signals(blocks, blows, window_s)),
    )


def _describe_signals(blocks: Blocks, blows: Sequence[Blow], window_s: float) -> list[str]:
    """Return clauses on hum and coarse converters, with what follows from them."""
    hum = find_hum(blocks.records, blows, window_s)
    coarse = describe_coarse_channels(find_coarse_channels(blocks), blocks.records.reference)
    effects = (
        (hum, "FRFs are wrong there; ground the hammer, or leave the lines out by ignore_hz"),
        (coarse, "motion below a step is lost; record with a smaller range"),
    )
    return [f"{clause}: {effect}" for clause, effect in effects if clause is not None]


def hit_spectra(blocks: Blocks, settings: HitSettings) -> tuple[Complex, Complex]:
    """Return F (n_hit, n_freq) and X (n_hit, n_freq, n_out) without exponential window."""
    window = force_windows(blocks, settings.force_window_s)
    force = scipy.fft.rfft(blocks.force * window)
    return force, np.moveaxis(scipy.fft.rfft(blocks.motion), 1, 2)


def _estimate(hits: _UsableHits, settings: HitSettings, tau: float) -> HitEstimate:
    """Estimate the FRFs of one reference from its usable hits."""
    blocks = hits.blocks
    records, plan = blocks.records, blocks.plan
    whole_record, first_block = record_traces(blocks)
    decay, total = exponential_windows(blocks, tau), combine_windows(tau, settings.window_tau)
    force = scipy.fft.rfft(blocks.force * decay)
    motion = np.moveaxis(scipy.fft.rfft(blocks.motion * decay[:, None, :]), 1, 2)
    averages = average_spectra(force, motion)
    if not (averages.force > 0).all():
        raise InputError(
            f"{records.test}: the force along {records.reference} has a zero spectrum at some "
            "lines: check which channel is the force"
        )
    freq = np.arange(plan.block // 2 + 1) * records.rate_hz / plan.block
    momenta = blocks.force.sum(axis=1) / records.rate_hz
    values = estimate_frf(averages, settings.estimator, noise_powers(hits.noise, freq))
    peaks = np.array([blow.main.height for blow in blocks.blows])
    drift = describe_drift(force, motion, peaks, records.outputs, freq)
    faults = list(hits.faults)
    if drift is not None:
        faults.append(
            f"{drift}: a drift with time, such as temperature or a stud that loosens, not with the "
            "level; let the machine settle, or spread the hits of each point over the test"
        )
    estimate = HitEstimate(
        test=records.test,
        reference=records.reference,
        estimate=_with_variance(
            records,
            freq,
            values,
            averages,
            total,
            loss=_difference_loss(exponential_windows(blocks, total)),
        ),
        estimator=settings.estimator,
        kept=tuple(
            Hit(b.main.record + 1, b.number, b.onset / records.rate_hz, b.main.height, momentum)
            for b, momentum in zip(blocks.blows, momenta.tolist(), strict=True)
        ),
        rejected=tuple(sorted(hits.left_out, key=lambda rejection: rejection.hit)),
        rate_hz=records.rate_hz,
        block_s=plan.block / records.rate_hz,
        pretrigger_s=plan.pretrigger / records.rate_hz,
        force_window_s=float((hits.window > 0).sum(axis=1).max()) / records.rate_hz,
        residual_response=hits.residual_response,
        whole_record=whole_record,
        first_block=first_block,
        densities=hit_densities(blocks),
        noise=hits.noise,
        # What the signals or their order explain is no change with the level.
        peak_slope=None if faults else estimate_peak_slope(force, motion, peaks),
        tau_s=tau,
    )
    recorded_tau = None if settings.window_tau else hits.recorded_tau
    place = f"{records.test}, hammer at {records.reference}"
    of_signals = [f"{place}: {fault}" for fault in faults]
    return replace(estimate, remarks=(*of_signals, *hit_remarks(estimate, recorded_tau)))


def _with_variance(
    records: Records,
    freq_hz: Real,
    values: Complex,
    averages: AveragedSpectra,
    tau: float,
    *,
    loss: float,
) -> FrfEstimate:
    """Return FRFs with coherence and variance; ``loss`` scales a variance by differences."""
    has_coherence = averages.count > 1
    coherence = averages.coherence
    variance = (
        coherence_variance(values, coherence, averages.count)
        if has_coherence
        else difference_variance(values) * loss
    )
    frf = Frf(freq_hz, values[:, :, None], records.outputs, (records.reference,), records.quantity)
    return FrfEstimate(
        frf=frf,
        variance=variance[:, :, None],
        variance_source="coherence" if has_coherence else "differences",
        measured=np.ones((len(records.outputs), 1), bool),
        coherence=coherence[:, :, None] if has_coherence else None,
        averages=averages.count,
        window_tau=tau,
    )


def _difference_loss(decay: Real) -> float:
    """Return the factor by which third differences underestimate noise under the window.

    The window ``w`` correlates the noise of lines k apart by
    c_k = sum w^2 exp(-2 i pi k t / T) / sum w^2, with time ``t`` from the hit, where ``w`` is 1.
    The third differences of white noise then have the variance
    20 - 30 Re c_1 + 12 Re c_2 - 2 Re c_3 instead of 20.

    Args:
        decay: exponential windows; (n_hit, n_sample).
    """
    window = decay[0]
    size = len(window)
    hit = int(np.abs(np.log(window)).argmin())
    turn = 2j * np.pi * (np.arange(size) - hit) / size
    weights = window**2 / (window**2).sum()
    c = [float((weights * np.exp(-k * turn)).sum().real) for k in (1, 2, 3)]
    return 20.0 / max(20 - 30 * c[0] + 12 * c[1] - 2 * c[2], _MIN_DIFFERENCE_VARIANCE)
