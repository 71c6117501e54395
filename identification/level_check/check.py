"""Level check of a campaign: every mode's frequency and damping at each level of its tests.

The modes of the lowest level are identified; a machine is the most linear there. Each other level
is fitted from these, at the same shapes. Tests that return to a level show how far the machine
drifts meanwhile, which counts as a further deviation of every value.

Modes against the peak of the hits within one test: a level test for free.

The hits of a test scatter in their peak, and records tell how the FRFs change with it
(``identification.hits.peak_slope``). To first order that change is

    D = sum_r  dH/ds_r  ds_r/d(ln A)  +  dH/dl_r  dl_r/d(ln A),

which one linear step of the fit at known shapes solves for the change of every pole. Hits that are
aimed differently change the participation alone. A drift during the test is no trend with the peak.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.level_check.shared_shapes import PoleFit, find_first_step, fit_poles
from identification.level_check.trends import (
    HYSTERESIS_SENTENCE,
    LEVEL_CHECK_SETTINGS,
    NO_CHANGE,
    ModeTrend,
    find_clearest_trend,
    group_visits,
    is_like_hysteresis,
)
from identification.modal import combine_tests, identify
from identification.modal.shape_fit import ModalFit
from identification.roving_hammer import is_roving_hammer
from identification.words import Campaign, Mask, ModalModel, Real, Test

_MAX_TRACKED_SHIFT = 0.5  # relative shift of a frequency beyond which a mode is lost
_MAX_TRACKED_DAMPING = 0.4  # damping ratio beyond which nothing resonates


@dataclass(frozen=True, eq=False)
class LevelCheck:
    """Modes against the level.

    Args:
        level_n: peak forces, the lowest first [N, or ``unit``]; (n_level,).
        trends: of each mode that could be followed through all levels, by its frequency.
        changed: for each mode, whether its frequency and its damping change.
        returns: whether tests return to a level, so that drift is known.
        is_within_tests: whether the levels are those of single hits, one standard deviation of
            their peaks below and above the mean.
        unit: unit of the levels.
    """

    level_n: Real
    trends: tuple[ModeTrend, ...]
    changed: tuple[tuple[bool, bool], ...]
    returns: bool
    is_within_tests: bool = False
    unit: str = "N"

    @property
    def is_constant(self) -> bool:
        """Whether no mode changes with the level."""
        return find_clearest_trend(self.trends) is None

    @property
    def sentence(self) -> str:
        """Finding in one or two sentences."""
        if not self.trends:
            return "Level check: no mode could be followed through all levels."
        span = f"{self.level_n[0]:.4g} to {self.level_n[-1]:.4g} {self.unit}".rstrip()
        if self.is_within_tests:
            span = f"single hits of {span}"
        trend = find_clearest_trend(self.trends)
        if trend is None:
            return f"Level check, {span}: {NO_CHANGE}."
        moved = sum(map(any, self.changed))
        text = (
            f"Level check, {span}: {moved} of {len(self.trends)} modes depend on the level. "
            f"{trend.sentence} "
        )
        if is_like_hysteresis(self.trends):
            text += f"{HYSTERESIS_SENTENCE} "
        text += "For what changes them, run mbw diagnose."
        if self.returns or self.is_within_tests:
            return text
        return (
            f"{text} No test returns to a level: a joint that drifts between the levels changes "
            "frequencies too; repeat the first level at the end."
        )


def check_levels(campaign: Campaign) -> LevelCheck | None:
    """Follow the modes through the levels of a campaign; None for less than two levels.

    Raises:
        InputError: the tests of a level cannot be combined.
    """
    visits = [(level, visited) for level, visited in group_visits(campaign) if level is not None]
    levels = sorted({level for level, _ in visits})
    if len(levels) < 2 or any(test.condition.level_n is None for test in campaign.tests):
        return None
    visits.sort(key=lambda visit: visit[0])  # stable: in the order of the tests at each level
    model, identified, _ = identify(visits[0][1])
    inside = np.arange(len(model.poles)) < int(identified.inside.sum())
    fits = _fit_visits(model, inside, [visited for _, visited in visits])
    trends = []
    for mode in np.flatnonzero(inside):
        trend = _join_visits(fits, np.array([level for level, _ in visits]), int(mode), model)
        if trend is not None:
            trends.append(trend)
    trends.sort(key=lambda trend: float(trend.freq_hz[0]))
    chance = LEVEL_CHECK_SETTINGS.max_chance / max(2 * len(trends), 1)
    return LevelCheck(
        np.array(levels),
        tuple(trends),
        tuple(trend.changes(chance) for trend in trends),
        len(visits) > len(levels),
        unit=campaign.tests[0].condition.drive_unit,
    )


def check_hits(campaign: Campaign, model: ModalModel, inside: Mask) -> LevelCheck | None:
    """Follow the modes through the scatter of the hits' peaks; None without such records.

    Args:
        campaign: tests from time records.
        model: its modal model.
        inside: modes of the band; (n_mode,).

    Raises:
        InputError: the tests cannot be combined.
    """
    trends = find_trends_within_tests(campaign, model, inside)
    if not trends:
        return None
    chance = LEVEL_CHECK_SETTINGS.max_chance / (2 * len(trends))
    return LevelCheck(
        trends[0].level,
        trends,
        tuple(trend.changes(chance) for trend in trends),
        returns=False,
        is_within_tests=True,
        unit=campaign.tests[0].condition.drive_unit,
    )


def _fit_visits(model: ModalModel, inside: Mask, visits: Sequence[Campaign]) -> list[PoleFit]:
    """Fit the poles of each visit at the shapes of the lowest level, from the visit before."""
    poles, participation = model.poles, model.participation.copy()
    fits = []
    for visited in visits:
        measured = combine_tests(visited)
        if is_roving_hammer(visited):
            measured = measured.transpose()
        outputs = [k for k, dof in enumerate(measured.outputs) if dof in model.outputs]
        inputs = [k for k, dof in enumerate(measured.inputs) if dof in model.inputs]
        known = replace(
            measured,
            values=measured.values[:, outputs][:, :, inputs],
            variance=measured.variance[:, outputs][:, :, inputs],
            measured=measured.measured[np.ix_(outputs, inputs)],
            outputs=tuple(measured.outputs[k] for k in outputs),
            inputs=tuple(measured.inputs[k] for k in inputs),
        )
        columns = [model.inputs.index(dof) for dof in known.inputs]
        rows = [model.outputs.index(dof) for dof in known.outputs]
        nothing = np.zeros(known.measured.shape)
        start = ModalFit(poles, participation[columns], model.shapes[rows], nothing, nothing, 0.0)
        fit = fit_poles(known.weight_by_variance(), start, inside)
        poles, participation[columns] = fit.poles, fit.participation
        fits.append(fit)
    return fits


def _join_visits(
    fits: Sequence[PoleFit], visited: Real, mode: int, model: ModalModel
) -> ModeTrend | None:
    """Return a mode at each level, with its drift between visits; None if it was lost."""
    poles = np.array([fit.poles[mode] for fit in fits])
    freq, damping = np.abs(poles) / (2 * np.pi), -poles.real / np.abs(poles)
    is_lost = np.abs(freq / freq[0] - 1) > _MAX_TRACKED_SHIFT
    if (is_lost | (damping <= 0) | (damping > _MAX_TRACKED_DAMPING)).any():
        return None
    freq_sd = np.array([fit.freq_sd[mode] for fit in fits])
    damping_sd = np.array([fit.damping_sd[mode] for fit in fits])
    # The shapes are those of the lowest level, with their noise.
    freq_sd[0] = max(freq_sd[0], float(model.freq_sd[mode]))
    damping_sd[0] = max(damping_sd[0], float(model.damping_sd[mode]))
    levels = np.unique(visited)
    (freq, freq_sd), (damping, damping_sd) = (
        _average_visits(visited, levels, values, deviations)
        for values, deviations in ((freq, freq_sd), (damping, damping_sd))
    )
    return ModeTrend(levels, freq, freq_sd, damping, damping_sd)


def _average_visits(
    visited: Real, levels: Real, values: Real, deviations: Real
) -> tuple[Real, Real]:
    """Return means over the visits to each level; drift is the largest span between visits."""
    rows = [visited == level for level in levels]
    drift = max(float(np.ptp(values[row])) for row in rows)
    means = np.array([values[row].mean() for row in rows])
    noise = np.array([np.sqrt((deviations[row] ** 2).sum()) / row.sum() for row in rows])
    return means, np.hypot(noise, drift)


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
