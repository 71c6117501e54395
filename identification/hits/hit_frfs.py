"""Records of hammer hits to FRFs: found, cut, judged, windowed, averaged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft

from identification.hits.block_plan import Plan, common, plan_blocks
from identification.hits.blocks import Blocks, cut_blocks
from identification.hits.densities import hit_densities, noise_densities, noise_powers
from identification.hits.detection import Blow, find_blows
from identification.hits.estimators import Averages, average, estimate_frf
from identification.hits.rejection import reject
from identification.hits.remarks import remarks_of
from identification.hits.settings import HitSettings
from identification.hits.windows import choose_tau, exponential_windows, force_windows, left_over
from identification.noise.variance import coherence_variance, difference_variance
from identification.words import (
    Complex,
    Densities,
    Frf,
    FrfEstimate,
    Hit,
    HitEstimate,
    InputError,
    Real,
    Records,
    Rejected,
)


def estimate(records: Records, settings: HitSettings | None = None) -> HitEstimate:
    """FRFs of one reference; see ``estimate_all``."""
    return estimate_all([records], [settings or HitSettings()])[0]


def estimate_all(
    records: Sequence[Records], settings: Sequence[HitSettings]
) -> tuple[HitEstimate, ...]:
    """FRFs of all references of a campaign, on one frequency axis, with one exponential window.

    H(w) by H1, H2 or Hv on the lines k / block_s, k = 0 .. half the rate; convention exp(+i w t):
    X(w) is the sum of x(t) exp(-i w t). The variance of each complex value (real plus imaginary
    part) is |H|^2 (1 - g2) / (g2 (n - 1)); of a single hit it comes from differences along
    frequency, and there is no coherence, which would be 1. Errors of neighbouring lines are
    independent but for the exponential window, which spreads them over 1 / (pi tau).

    Args:
        records: of each reference; several may have the same.
        settings: of each.

    Returns:
        One estimate for each records.

    Raises:
        InputError: no hit, none that can be used, settings or rates that contradict one another.
    """
    blows = [find_blows(own) for own in records]
    plan = plan_blocks(records, blows, settings)
    judged = [
        _judge(own, found, plan, setting)
        for own, found, setting in zip(records, blows, settings, strict=True)
    ]
    tau = common(records, settings, "exponential_tau")
    if tau is None:
        tau = choose_tau([one.blocks for one in judged], [one.left for one in judged])
    return tuple(_finish(one, setting, tau) for one, setting in zip(judged, settings, strict=True))


@dataclass(frozen=True, eq=False)
class _Judged:
    """Hits of one reference that are kept.

    Args:
        blocks: of them, the force windowed.
        window: on the force; (n_hit, n_sample).
        left_out: the other hits.
        left: share of the response at the blocks' end.
        noise: before the hits.
    """

    blocks: Blocks
    window: Real
    left_out: tuple[Rejected, ...]
    left: float
    noise: Densities | None


def _judge(records: Records, blows: tuple[Blow, ...], plan: Plan, settings: HitSettings) -> _Judged:
    blocks, left_out = cut_blocks(records, blows, plan)
    if settings.reject and blocks.blows:
        blocks, more = reject(blocks, lambda some: _spectra(some, settings.force_window_s))
        left_out += more
    if not blocks.blows:
        raise InputError(
            f"{records.test}: none of the {len(blows)} hits along {records.reference} can be used: "
            f"{'; '.join(map(str, left_out[:3]))}: repeat the test, or state block_s, "
            "pretrigger_s or reject = false"
        )
    window = force_windows(blocks, settings.force_window_s)
    blocks = replace(blocks, force=blocks.force * window)
    noise = noise_densities(records, blows, plan.block)
    return _Judged(blocks, window, left_out, left_over(blocks), noise)


def _spectra(blocks: Blocks, force_window_s: float | None) -> tuple[Complex, Complex]:
    """F (n_hit, n_freq) and X (n_hit, n_freq, n_out) without exponential window."""
    window = force_windows(blocks, force_window_s)
    force = scipy.fft.rfft(blocks.force * window)
    return force, np.moveaxis(scipy.fft.rfft(blocks.motion), 1, 2)


def _finish(judged: _Judged, settings: HitSettings, tau: float) -> HitEstimate:
    blocks = judged.blocks
    records, plan = blocks.records, blocks.plan
    fading = exponential_windows(blocks, tau)
    force = scipy.fft.rfft(blocks.force * fading)
    motion = np.moveaxis(scipy.fft.rfft(blocks.motion * fading[:, None, :]), 1, 2)
    averages = average(force, motion)
    if not (averages.force > 0).all():
        raise InputError(
            f"{records.test}: the force along {records.reference} has no spectrum at some lines: "
            "check which channel is the force"
        )
    freq = np.arange(plan.block // 2 + 1) * records.rate_hz / plan.block
    values = estimate_frf(averages, settings.estimator, noise_powers(judged.noise, freq))
    found = HitEstimate(
        test=records.test,
        reference=records.reference,
        estimate=_with_variance(records, freq, values, averages, tau, loss=_loss(fading)),
        estimator=settings.estimator,
        kept=tuple(
            Hit(b.main.record + 1, b.number, b.onset / records.rate_hz, b.main.height)
            for b in blocks.blows
        ),
        rejected=tuple(sorted(judged.left_out, key=lambda one: one.hit)),
        rate_hz=records.rate_hz,
        block_s=plan.block / records.rate_hz,
        pretrigger_s=plan.pretrigger / records.rate_hz,
        force_window_s=float((judged.window > 0).sum(axis=1).max()) / records.rate_hz,
        left=judged.left,
        densities=hit_densities(blocks),
        noise=judged.noise,
    )
    return replace(found, remarks=remarks_of(found))


def _with_variance(
    records: Records,
    freq_hz: Real,
    values: Complex,
    averages: Averages,
    tau: float,
    *,
    loss: float,
) -> FrfEstimate:
    several = averages.count > 1
    coherence = averages.coherence
    variance = (
        coherence_variance(values, coherence, averages.count)
        if several
        else difference_variance(values) * loss
    )
    frf = Frf(freq_hz, values[:, :, None], records.outputs, (records.reference,), records.quantity)
    return FrfEstimate(
        frf=frf,
        variance=variance[:, :, None],
        variance_source="coherence" if several else "differences",
        measured=np.ones((len(records.outputs), 1), bool),
        coherence=coherence[:, :, None] if several else None,
        averages=averages.count,
        window_tau=tau,
    )


def _loss(fading: Real) -> float:
    """What third differences miss of noise that the window has spread over neighbouring lines.

    White noise times w has the correlation c_k = sum w^2 exp(-2 i pi k t / T) / sum w^2 between
    lines k apart, t from the hit, where w is 1. Its third differences then have the variance
    20 - 30 Re c_1 + 12 Re c_2 - 2 Re c_3 instead of 20.
    """
    window = fading[0]
    size = len(window)
    hit = int(np.abs(np.log(window)).argmin())
    turn = 2j * np.pi * (np.arange(size) - hit) / size
    weights = window**2 / (window**2).sum()
    c = [float((weights * np.exp(-k * turn)).sum().real) for k in (1, 2, 3)]
    return 20.0 / max(20 - 30 * c[0] + 12 * c[1] - 2 * c[2], 1e-3)
