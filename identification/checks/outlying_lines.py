"""Check of frequency lines: which stand far above their neighbours, as a disturbance does."""

import numpy as np

from identification.words import Campaign, FrfEstimate, Mask

# A value above both neighbours on either side by this factor. A resonance of half bandwidth b falls
# as 1 / sqrt(1 + (df / b)^2): it does so only if b is below a thirtieth of the spacing df.
_MIN_SPIKE_RATIO = 30.0
_MIN_SIGNAL_RATIO = 3.0  # value over its noise; weights leave out what is noisier
_MAX_NAMED_LINES = 3  # frequencies that the remark names


def outlying_line_remarks(campaign: Campaign) -> tuple[str, ...]:
    """Return a sentence on lines at which channels far exceed both neighbours on either side."""
    counts: np.ndarray[tuple[int], np.dtype[np.int_]] = np.zeros(len(campaign.freq_hz), int)
    channels = 0
    for test in campaign.tests:
        counts += find_spikes(test.estimate).sum(axis=1)
        channels += len(test.estimate.frf.outputs)
    lines = np.flatnonzero(counts)
    if not len(lines):
        return ()
    most = lines[np.argsort(-counts[lines], kind="stable")][:_MAX_NAMED_LINES]
    named = ", ".join(
        f"{campaign.freq_hz[line]:.6g} Hz ({counts[line]} of {channels} channels)"
        for line in sorted(most)
    )
    further = len(lines) - len(most)
    named += f" and {further} more lines" if further else ""
    return (
        f"FRFs exceed those of the neighbouring lines {_MIN_SPIKE_RATIO:g} times at {named}: a "
        "disturbance or a slip of the export, or a resonance far narrower than the spacing of the "
        "lines; leave such lines out by ignore_hz in campaign.toml, because they can hide all else",
    )


def shifted_axis_remark(campaign: Campaign) -> str:
    """Return a sentence where the first line is one of 0 Hz, but its frequency is not; else empty.

    An FRF is real at 0 Hz, exactly where it comes from a discrete Fourier transform, and at no
    other line. An axis that begins with the spacing of the lines is then off by one line.
    """
    freq_hz = campaign.freq_hz
    values = [test.estimate.frf.values for test in campaign.tests]
    is_real = all(not value[0].imag.any() and value[0].any() for value in values)
    if freq_hz[0] <= 0 or not is_real or not all(value[1:].imag.any() for value in values):
        return ""
    return (
        f"the first line, stated at {freq_hz[0]:.6g} Hz, is real in all channels, as FRFs are at "
        "0 Hz alone: the axis of frequencies seems to be off by one line; begin it at 0 Hz"
    )


def find_spikes(estimate: FrfEstimate) -> Mask:
    """Return which values far exceed both neighbours on either side; (n_freq, n_output)."""
    size = np.abs(estimate.frf.values[:, :, 0])
    spikes: Mask = np.zeros(size.shape, bool)
    if len(size) < 5:
        return spikes
    middle = size[2:-2]
    around = np.maximum.reduce([size[:-4], size[1:-3], size[3:-1], size[4:]])
    noise = np.sqrt(estimate.variance[2:-2, :, 0])
    stands_out = (around > 0) & (middle > _MIN_SPIKE_RATIO * around)
    spikes[2:-2] = stands_out & (middle > _MIN_SIGNAL_RATIO * noise)
    return spikes & estimate.measured[:, 0]
