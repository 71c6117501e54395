"""Modes against the peak of the hits within one test: a level test for free.

The hits of a test scatter in their peak, and records tell how the FRFs change with it
(``identification.hits.peak_slope``). To first order that change is

    D = sum_r  dH/ds_r  ds_r/d(ln A)  +  dH/dl_r  dl_r/d(ln A),

which one linear step of the fit at known shapes solves for the change of every pole. Hits that are
aimed differently change the participation alone. A drift during the test is no trend with the peak.
"""

from dataclasses import replace

import numpy as np

from identification.level_check.shared_shapes import PoleFit, find_first_step
from identification.level_check.trends import ModeTrend
from identification.modal import combine_tests
from identification.modal.shape_fit import ModalFit
from identification.roving_hammer import is_roving_hammer
from identification.words import Campaign, Mask, ModalModel, Test


def find_trends_within_tests(
    campaign: Campaign, model: ModalModel, inside: Mask
) -> tuple[ModeTrend, ...]:
    """Return each mode at one standard deviation of the peaks below and above their mean.

    Args:
        campaign: tests from time records; others, and those of equal hits, do not count.
        model: modal model of the campaign.
        inside: modes of the band; (n_mode,).

    Returns:
        Trends of two levels each; empty without such tests.
    """
    tests = [changed for test in campaign.tests if (changed := _replace_by_slope(test))]
    if not tests or is_roving_hammer(campaign):
        return ()
    peaks = np.array([hit.peak_n for test in tests if test.hits for hit in test.hits.kept])
    spread = float(
        np.mean([t.hits.peak_slope.spread for t in tests if t.hits and t.hits.peak_slope])
    )
    measured = combine_tests(replace(campaign, tests=tuple(tests)))
    rows = [model.outputs.index(dof) for dof in measured.outputs]
    columns = [model.inputs.index(dof) for dof in measured.inputs]
    nothing = np.zeros(measured.measured.shape)
    start = ModalFit(
        model.poles, model.participation[columns], model.shapes[rows], nothing, nothing, 0.0
    )
    step = find_first_step(measured.weight_by_variance(), start, inside)
    level = float(np.exp(np.log(np.abs(peaks)).mean()))
    return tuple(
        _build_trend(model, step, int(mode), level, spread) for mode in np.flatnonzero(inside)
    )


def _replace_by_slope(test: Test) -> Test | None:
    """Return a test whose FRFs are the derivative by the peak; None where there is none."""
    hits = test.hits
    if hits is None or hits.peak_slope is None:
        return None
    frf, whole = test.estimate.frf, hits.estimate.frf
    lines = np.isin(whole.freq_hz, frf.freq_hz)
    if lines.sum() != len(frf.freq_hz) or not set(frf.outputs) <= set(whole.outputs):
        return None
    rows = [whole.outputs.index(dof) for dof in frf.outputs]
    values = hits.peak_slope.values[lines][:, rows, None]
    variance = hits.peak_slope.variance[lines][:, rows, None]
    estimate = replace(test.estimate, frf=replace(frf, values=values), variance=variance)
    return replace(test, estimate=estimate)


def _build_trend(
    model: ModalModel, step: PoleFit, mode: int, level: float, spread: float
) -> ModeTrend:
    """Return the two ends of a mode's trend; their difference has the step's deviation."""
    pole, change = model.poles[mode], step.poles[mode]
    size = abs(pole)
    growth = (pole.conjugate() * change).real / size
    freq_change = growth / (2 * np.pi)
    damping_change = -change.real / size + pole.real * growth / size**2
    ends, root = spread * np.array([-1.0, 1.0]), np.sqrt(2) * spread
    frequency, damping = model.freq_hz[mode], model.damping[mode]
    return ModeTrend(
        level * np.exp(ends),
        frequency + ends * freq_change,
        np.full(2, root * step.freq_sd[mode]),
        damping + ends * damping_change,
        np.full(2, root * step.damping_sd[mode]),
    )
