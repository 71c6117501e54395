"""Level of the measured and of the nominal accelerances along logarithmic frequency.

Where all stiffness changes by one factor, an accelerance A(w) becomes A(w / c): the curve keeps its
form and its height, and only shifts along ln w. A curve of many FRFs together therefore tells a
wrong unit (shift in height), a wrong quantity (slope) and a wrong frequency axis (large shift
along ln w) from wrong stiffness (small shift along ln w).
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Complex,
    Dof,
    Mask,
    Real,
    Signal,
    Test,
    group_by_key,
)
from mbmodel import Model
from tuning.misfit.batch import predict

_LOG_FREQUENCY_STEP = 0.02  # step of ln f: bins of 2 % in frequency
_MIN_SUMMED_POWER_TO_VARIANCE = 25.0  # summed |H|^2 over its variance on lines that count
# Cells whose rms is below this part of the largest of their test do not count: in symmetric
# machines a small nominal FRF is zero, and the measured one is cross-talk.
_MIN_RELATIVE_RMS = 0.1
_MIN_LEVEL_BINS = 12  # bins with a level, for a comparison


@dataclass(frozen=True, eq=False)
class LevelCurve:
    """Level of accelerances, ln of the root of the sum of their squares, along ln f.

    Args:
        log_freq: ln of the frequency [ln Hz], evenly spaced; (n_bin,).
        level: level in each bin; (n_bin,).
    """

    log_freq: Real
    level: Real

    def at(self, log_freq: Real) -> Real:
        """Return the level at other frequencies; NaN outside the curve."""
        return np.interp(log_freq, self.log_freq, self.level, left=np.nan, right=np.nan)


def split_by_scale(campaign: Campaign) -> dict[tuple[str, str, str], Campaign]:
    """Return the tests of each file whose FRFs share a unit, as one campaign each.

    Accelerometers of a file are read alike, and forces at points too. Each encoder and each motor
    has a column with a unit of its own.

    Returns:
        Campaigns by file, encoder and motor; the names are empty for points.
    """
    by_scale: dict[tuple[str, str, str], list[Test]] = {}
    for test in campaign.tests:
        reference, outputs = test.condition.reference, test.estimate.frf.outputs
        if isinstance(reference, Dof) and reference.is_rotation:
            continue
        drive = reference.point if isinstance(reference, Signal) else ""
        rows = group_by_key(
            (output.point if isinstance(output, Signal) else "", row)
            for row, output in enumerate(outputs)
        )
        for encoder, chosen in rows.items():
            part = replace(test, hits=None, estimate=test.estimate.select_outputs(chosen))
            by_scale.setdefault((test.condition.test, encoder, drive), []).append(part)
    return {key: replace(campaign, tests=tuple(tests)) for key, tests in by_scale.items()}


def predict_on_lines(
    model: Model, campaign: Campaign, freq_hz: Real, theta: Real | None = None
) -> Campaign:
    """Return the campaign with a model's FRFs on other lines instead of the measured.

    Args:
        model: the model.
        freq_hz: lines [Hz]; (n_freq,).
        theta: values of the parameters; None for the nominal ones.
    """
    empty = tuple(_on_lines(test, freq_hz) for test in campaign.tests)
    answers = predict(
        model, model.drawn if theta is None else theta, replace(campaign, tests=empty)
    )
    return replace(
        campaign,
        tests=tuple(
            replace(test, estimate=replace(test.estimate, frf=replace(test.estimate.frf, values=v)))
            for test, v in zip(empty, answers, strict=True)
        ),
    )


def _on_lines(test: Test, freq_hz: Real) -> Test:
    """Return a test of zeros on other lines."""
    estimate = test.estimate
    shape = (len(freq_hz), *estimate.frf.values.shape[1:])
    frf = replace(estimate.frf, freq_hz=freq_hz, values=np.zeros(shape, complex))
    return replace(
        test,
        hits=None,
        estimate=replace(
            estimate,
            frf=frf,
            variance=np.zeros(shape),
            variance_source="differences",
            coherence=None,
            shared=None,
        ),
    )


def strong_cells(campaign: Campaign) -> tuple[Mask, ...]:
    """Return which channels of each test are strong, translations alone; (n_out,) each."""
    chosen = []
    for test in campaign.tests:
        frf = test.estimate.frf
        kept = test.estimate.measured[:, 0] & np.array([not dof.is_rotation for dof in frf.outputs])
        power = np.median(np.abs(_accelerance(test)[:, :, 0]) ** 2, axis=0) * kept
        chosen.append(kept & (power > _MIN_RELATIVE_RMS**2 * power.max(initial=0.0)))
    return tuple(chosen)


def _accelerance(test: Test) -> Complex:
    """Return the FRFs times (i w)^(2 - q); (n_freq, n_out, 1)."""
    frf = test.estimate.frf
    order = 2 - DERIVATIVE_ORDER[frf.quantity]
    return frf.values * (2j * np.pi * frf.freq_hz[:, None, None]) ** order


def level_curve(campaign: Campaign, cells: tuple[Mask, ...]) -> LevelCurve | None:
    """Return the level of the chosen cells of all tests; None if too few lines are above noise."""
    freq = campaign.freq_hz
    power, noise = np.zeros(len(freq)), np.zeros(len(freq))
    for test, kept in zip(campaign.tests, cells, strict=True):
        scale = np.abs(2j * np.pi * freq) ** (2 - DERIVATIVE_ORDER[test.estimate.frf.quantity])
        power += (np.abs(_accelerance(test)[:, kept, 0]) ** 2).sum(axis=1)
        noise += scale**2 * test.estimate.variance[:, kept, 0].sum(axis=1)
    good = (freq > 0) & (power > _MIN_SUMMED_POWER_TO_VARIANCE * noise) & np.isfinite(power)
    if good.sum() < _MIN_LEVEL_BINS:
        return None
    x, y = np.log(freq[good]), np.log(power[good]) / 2
    edges = np.arange(x[0], x[-1] + _LOG_FREQUENCY_STEP, _LOG_FREQUENCY_STEP)
    bins = np.digitize(x, edges) - 1
    count = np.bincount(bins, minlength=len(edges))
    mean = np.bincount(bins, y, minlength=len(edges)) / np.maximum(count, 1)
    centres = edges + _LOG_FREQUENCY_STEP / 2
    filled = count > 0
    if filled.sum() < _MIN_LEVEL_BINS:
        return None
    return LevelCurve(centres, np.interp(centres, centres[filled], mean[filled]))
