"""Checks of what files state: positions in millimetres, a test twice, lines that stand out."""

from itertools import combinations
from pathlib import Path

import numpy as np

from identification.words import (
    Campaign,
    Complex,
    FrfEstimate,
    InputError,
    Layout,
    Mask,
    Output,
    Real,
    Test,
)

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


_MAX_SIZE_M = 100.0  # distance of points on a machine: above it, positions are hardly in metres
_MIN_SIZE_M = 1e-3  # and below it
_MAX_ARM_M = 20.0  # of a sensor from the centre of mass of its body, in the median
_MAX_ARM_TO_SPREAD = 100.0  # such arms over the distance of the bodies' centres


def check_lengths(path: Path, layout: Layout) -> list[str]:
    """Return remarks on a layout whose size is hardly one in metres.

    Args:
        layout: bodies with their centres of mass, and points.

    Raises:
        InputError: sensors and hammer points lie 100 times farther from their bodies' centres of
            mass than these lie from each other, and more than 20 m.
    """
    size = _spread(layout.positions)
    if size == 0:
        return []
    arms = np.linalg.norm(layout.positions - layout.centres[layout.body_of], axis=1)
    arm, spread = float(np.median(arms)), _spread(layout.centres)
    if spread > 0 and arm > max(_MAX_ARM_M, _MAX_ARM_TO_SPREAD * spread):
        raise InputError(
            f"{path}: points lie {arm:.3g} m from the centres of mass of their bodies, which are "
            f"{spread:.3g} m apart, as if positions in mm were read as m: divide the positions of "
            "the sites by 1000"
        )
    if _MIN_SIZE_M <= size <= _MAX_SIZE_M:
        return []
    is_large = size > _MAX_SIZE_M
    advice = "if they were written in mm, divide them by 1000" if is_large else "check their unit"
    return [f"sensors and hammer points lie within {size:.3g} m: positions are in m; {advice}"]


def _spread(positions: Real) -> float:
    """Return the diagonal of the box around positions [m]."""
    return float(np.linalg.norm(np.ptp(positions, axis=0))) if len(positions) else 0.0


_MAX_REPEATED_DIFFERENCE = (
    1e-5  # relative: what the six digits of text files leave of equal numbers
)


def refuse_repeated_tests(path: Path, campaign: Campaign) -> None:
    """Refuse a campaign in which two tests hold the same FRFs, up to signs of labels and rounding.

    Noise makes two real tests differ. A copy would count as new data, and two references with the
    same FRFs cannot be told apart.

    Raises:
        InputError: two tests are equal; the message names both.
    """
    columns = [_column(test) for test in campaign.tests]
    sizes = [_size(column) for column in columns]
    for first, second in combinations(range(len(columns)), 2):
        size = max(sizes[first], sizes[second])
        if size == 0 or abs(sizes[first] - sizes[second]) > _MAX_REPEATED_DIFFERENCE * size:
            continue
        if columns[first].keys() != columns[second].keys():
            continue
        difference = _size(
            {dof: columns[first][dof] - columns[second][dof] for dof in columns[first]}
        )
        if difference <= _MAX_REPEATED_DIFFERENCE * size:
            names = [_name(campaign.tests[number]) for number in (first, second)]
            raise InputError(
                f"{path}: {names[0]} and {names[1]} hold the same FRFs: one is a copy; remove it, "
                "or export the right one"
            )


def _column(test: Test) -> dict[Output, Complex]:
    """Return the FRFs of the measured channels, along positive axes of channel and reference."""
    frf = test.estimate.frf
    return {
        dof.positive: dof.sign * test.condition.reference.sign * frf.values[:, row, 0]
        for row, dof in enumerate(frf.outputs)
        if test.estimate.measured[row, 0]
    }


def _size(column: dict[Output, Complex]) -> float:
    """Return the norm of all FRFs of a test."""
    return float(np.sqrt(sum(float((np.abs(values) ** 2).sum()) for values in column.values())))


def _name(test: Test) -> str:
    """Return file and reference of a test."""
    return f"{test.condition.test} at {test.condition.reference}"
