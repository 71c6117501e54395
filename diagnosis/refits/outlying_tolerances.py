"""Tolerances that lie beyond their bounds by chance.

Among hundreds of tolerances some exceed their bounds of 2.5 standard deviations by chance. Held at
the bound, such a tolerance leaves a gap that looks like an effect, or like an error of the model
beside one. So those at a bound are fitted up to ``outlier_sigma``, however many they are: one
outlier that is held drives others to their bounds, and these come back once it is free. One that
ends there too is a fault, which no tolerance may hide. So are several that are improbable together:
of n tolerances, the binomial probability that k shift as far as the k-th largest must not be below
that of one beyond ``outlier_sigma``.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import binom, norm

from diagnosis.hypothesis import Scene
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, run_refits
from diagnosis.settings import DiagnosisSettings
from identification.words import Mask, Real
from tuning import TOLERANCE_BOUND_SIGMA


def admit_outliers(
    scene: Scene, refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Refit]:
    """Return refits with wider bounds on outlying tolerances, if these lower the objective.

    Args:
        scene: campaign and nominal model.
        refits: the null model, or sets of causes.
        settings: schedule, and the largest outlier.
    """
    widened = {number: _find_outliers(refit, settings) for number, refit in enumerate(refits)}
    chosen = [number for number, outliers in widened.items() if outliers.any()]
    tasks = []
    for number in chosen:
        refit = refits[number]
        parametrisation = refit.session.parametrisation.widen_bounds(
            widened[number], settings.outlier_sigma
        )
        session = replace(refit.session, parametrisation=parametrisation)
        tasks.append(RefitTask(refit.hypothesis, session, refit.fit.theta, refit.floor))
    admitted = list(refits)
    for number, wider in zip(chosen, run_refits(scene, tasks, settings.schedule), strict=True):
        ends_at_bound = wider.session.parametrisation.coordinates_at_bound(wider.fit.x)
        is_fault = (ends_at_bound & widened[number]).any() or not _is_chance(wider, settings)
        if not is_fault and wider.objective < refits[number].objective:
            admitted[number] = wider
    return admitted


def _find_outliers(refit: Refit, settings: DiagnosisSettings) -> Mask:
    """Return which tolerances are at their bounds of 2.5 standard deviations; (n_x,)."""
    narrow = refit.session.parametrisation
    wide = narrow.widen_bounds(narrow.coordinates_at_bound(refit.fit.x), settings.outlier_sigma)
    outliers: Mask = (wide.lower < narrow.lower) | (wide.upper > narrow.upper)
    return outliers


def _is_chance(refit: Refit, settings: DiagnosisSettings) -> bool:
    """Return whether tolerances shift beyond their bounds by chance."""
    x: Real = refit.fit.x[refit.session.parametrisation.is_tolerance]
    shifts = -np.sort(-np.abs(x))
    beyond = shifts[shifts >= TOLERANCE_BOUND_SIGMA]
    by_chance = binom.sf(np.arange(len(beyond)), len(shifts), 2 * norm.sf(beyond))
    return not (by_chance < binom.sf(0, len(shifts), 2 * norm.sf(settings.outlier_sigma))).any()
