"""Frequency band in which the FRFs of a campaign are used.

By default the band reaches from the first to the last line whose median coherence over channels
exceeds 0.5. A single line never decides: noise of three hits has a coherence above 0.5 at every
fourth line. So the first line counts only if a quarter of the lines that follow it is coherent too,
of the nearest as of all 31, and the last line only with a quarter of those before it.

Coherence can be low although the FRFs are good: hits that differ lower it, and so does an export on
another scale. The scatter of the FRFs from line to line then contradicts it. Where smooth FRFs
continue a band for a tenth of its lines or more, the band contains them, and a remark says so.

On a machine that moves along few axes most channels of triaxial sensors read noise alone. Where the
median over all channels gives no band, that over the coherent channels does, with a remark.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.noise.variance import difference_variance
from identification.words import Campaign, InputError, Mask, Real, Test, thinning_step

_MIN_BAND_COHERENCE = 0.5  # median over channels at the first and the last line of the band
# Lines inwards from an end of the band that are examined: at most 31, and a share of all lines.
_MAX_EDGE_LINES, _EDGE_LINE_SHARE = 31, 25
_MIN_COHERENT_SHARE = 0.25  # of the lines examined
# Coherent lines of a channel that reads more than noise; noise of three hits has a quarter.
_MIN_ALIVE_SHARE = 1 / 3
# Standard deviation of a line from its neighbours over |H|, below which FRFs are smooth; noise
# alone gives 1, and a coherence of 0.5 over 10 averages 1/3.
_MAX_SMOOTH_SCATTER = 1 / 6
# Step of the differences that measure it, in lines. An exponential window correlates the noise of
# neighbouring lines, which then looks smooth.
_SCATTER_STEP = 8
_MIN_SCATTER_SAMPLES = 16  # lines for each start of such a step
_MAX_SILENT_CUT = 0.02  # share of the lines that the band leaves out without a remark
_MIN_SMOOTH_SHARE = 0.1  # lines that smooth FRFs add to a band, over its own


@dataclass(frozen=True, eq=False)
class Band:
    """Lines of a band, and the remark that explains it.

    Args:
        lines: which lines it contains; (n_freq,).
        remark: sentence for the reader, empty if coherence alone decides.
    """

    lines: Mask
    remark: str = ""


def select_band(
    campaign: Campaign, band: tuple[float, float] | None = None, source: Path | None = None
) -> Campaign:
    """Return the campaign on the lines of a band, with a remark where the band needs one.

    Args:
        band: lowest and highest frequency [Hz], both included; None for the default.

    Raises:
        InputError: the band holds no line.
    """
    choice = _choose_band(campaign, band, source)
    remarks = (*campaign.remarks, choice.remark) if choice.remark else campaign.remarks
    low, high = np.flatnonzero(choice.lines)[[0, -1]]  # a band has no gaps: a slice copies nothing
    return replace(campaign.select_lines(slice(low, high + 1)), remarks=remarks)


def band_lines(
    campaign: Campaign, band: tuple[float, float] | None = None, source: Path | None = None
) -> Mask:
    """Choose the frequency lines of a band.

    Without coherence in any test the default has all lines except 0 Hz. If tests come from time
    records, it ends at 0.8 of half the sampling rate, since anti-aliasing filters distort the
    response above.

    Args:
        band [Hz], source: as for ``select_band``.

    Returns:
        Mask of the chosen lines; (n_freq,).

    Raises:
        InputError: the band holds no line.
    """
    return _choose_band(campaign, band, source).lines


def _choose_band(campaign: Campaign, band: tuple[float, float] | None, source: Path | None) -> Band:
    """Choose the lines of a stated band or of the default."""
    freq = campaign.freq_hz
    name = source or campaign.name
    if band is not None:
        lines = (freq >= band[0]) & (freq <= band[1])
        if not lines.any():
            raise InputError(
                f"{name}: the band {band[0]:g}..{band[1]:g} Hz holds none of the lines "
                f"{freq[0]:g}..{freq[-1]:g} Hz: widen it"
            )
        return Band(lines)
    highest = [test.hits.usable_limit_hz for test in campaign.tests if test.hits is not None]
    below = freq < min(highest, default=np.inf)
    with_coherence = [test for test in campaign.tests if test.estimate.coherence is not None]
    if not with_coherence:
        lines = (freq > 0) & below
        if not lines.any():
            raise InputError(f"{name}: there is no line above 0 Hz: export the FRFs again")
        return Band(lines)
    coherence, channels = _median_coherence(with_coherence, below)
    coherent = _between_ends((coherence > _MIN_BAND_COHERENCE) & below)
    is_used = (coherence > _MIN_BAND_COHERENCE) | _smooth_lines(with_coherence)
    extended = _between_ends(is_used & below)
    if not extended.any():
        raise InputError(
            f"{name}: the median coherence exceeds {_MIN_BAND_COHERENCE} at no line: check the "
            "test, or give a band"
        )
    added = extended & ~coherent
    if added.sum() < _MIN_SMOOTH_SHARE * max(coherent.sum(), 1) and coherent.any():
        return Band(coherent, channels or _describe_cut(freq, coherent, below))
    low, high = freq[np.flatnonzero(added)[[0, -1]]]
    remark = (
        f"from {low:.4g} to {high:.4g} Hz the median coherence is "
        f"{np.median(coherence[added]):.2g}, but the FRFs are smooth from line to line: these "
        "lines are used; check how the coherence was exported, or state a band"
    )
    return Band(extended, remark)


def _describe_cut(freq: Real, lines: Mask, usable: Mask) -> str:
    """Return why the band leaves many lines at the ends of the axis out; empty if few.

    Args:
        freq: frequency lines [Hz]; (n_freq,).
        lines: lines of the band; (n_freq,).
        usable: lines below the highest usable frequency; (n_freq,).
    """
    usable = usable & (freq > 0)
    if (usable & ~lines).sum() <= _MAX_SILENT_CUT * usable.sum():
        return ""
    (low, high), (first, last) = (freq[np.flatnonzero(mask)[[0, -1]]] for mask in (lines, usable))
    return (
        f"the band is {low:.4g} to {high:.4g} Hz of {first:.4g} to {last:.4g} Hz, because the "
        f"median coherence of the channels falls to {_MIN_BAND_COHERENCE} beyond it; state a band "
        "to use other lines"
    )


def _median_coherence(tests: list[Test], below: Mask) -> tuple[Real, str]:
    """Return the median coherence over channels of the tests; (n_freq,), and a remark or nothing.

    On a machine that moves along few axes most channels of triaxial sensors read noise alone. If
    their median then exceeds the least coherence on no line ``below`` the highest frequency, it is
    that of the channels which exceed it on a third of the lines.
    """
    coherences = [test.estimate.coherence for test in tests]
    stacked = np.hstack([c.reshape(len(below), -1) for c in coherences if c is not None])
    median = np.asarray(np.median(stacked, axis=1), np.float64)
    if _between_ends((median > _MIN_BAND_COHERENCE) & below).any():
        return median, ""
    alive = (stacked[below] > _MIN_BAND_COHERENCE).mean(axis=0) >= _MIN_ALIVE_SHARE
    if not alive.any():
        return median, ""
    remark = (
        f"only {alive.sum()} of {len(alive)} channels are coherent: the band is that of their "
        "median coherence; check that the others lie across the motion"
    )
    return np.asarray(np.median(stacked[:, alive], axis=1), np.float64), remark


def _channel_step(n_values: int) -> int:
    """Return n such that every n-th channel of a large test is enough; 1 for all of them.

    No multiple of three is returned: sensors of three axes shall count with all of them.
    """
    step = thinning_step(n_values)
    return step if step % 3 else step + 1


def _between_ends(good: Mask) -> Mask:
    """Return the lines from the first to the last that enough good lines confirm; (n_freq,)."""
    count = len(good)
    whole = int(np.clip(count // _EDGE_LINE_SHARE, 1, _MAX_EDGE_LINES))
    sums = np.concatenate([[0], np.cumsum(good)])
    place = np.arange(count)
    is_first, is_last = good.copy(), good.copy()
    for width in (whole, round(_MIN_COHERENT_SHARE * whole)):
        needed = _MIN_COHERENT_SHARE * width
        is_first &= sums[np.minimum(place + width, count)] - sums[place] >= needed
        is_last &= sums[place + 1] - sums[np.maximum(place + 1 - width, 0)] >= needed
    first, last = np.flatnonzero(is_first), np.flatnonzero(is_last)
    lines = np.zeros(count, bool)
    if first.size and last.size:
        lines[first[0] : last[-1] + 1] = True
    return lines


def _smooth_lines(tests: list[Test]) -> Mask:
    """Return the lines at which the median FRF hardly scatters; (n_freq,)."""
    ratios = []
    step = _channel_step(sum(test.estimate.frf.values.size for test in tests))
    for test in tests:
        values = test.estimate.frf.values[:, ::step, 0]
        if len(values) < _SCATTER_STEP * _MIN_SCATTER_SAMPLES:
            return np.zeros(len(values), bool)
        variance = np.empty(values.shape)
        for start in range(_SCATTER_STEP):
            variance[start::_SCATTER_STEP] = difference_variance(values[start::_SCATTER_STEP])
        power = np.abs(values) ** 2
        ratios.append(np.divide(variance, power, np.full(power.shape, np.inf), where=power > 0))
    return np.median(np.hstack(ratios), axis=1) < _MAX_SMOOTH_SCATTER**2
