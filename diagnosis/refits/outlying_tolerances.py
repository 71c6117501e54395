"""Refits with wider bounds on tolerances that lie beyond their bounds by chance.

See ``tuning.fitting.outlying_tolerances``, by which the null model admits them.
"""

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.hypothesis import Scene
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import RefitTask, run_refits
from diagnosis.settings import DiagnosisSettings
from tuning.fitting.outlying_tolerances import are_by_chance, widen_outliers


def admit_outliers(
    scene: Scene, refits: Sequence[Refit], settings: DiagnosisSettings
) -> list[Refit]:
    """Return refits with wider bounds on outlying tolerances, if these lower the objective.

    Args:
        scene: campaign and nominal model.
        refits: the null model, or sets of causes.
        settings: schedule, and the largest outlier.
    """
    sigma, tasks, chosen = settings.outlier_sigma, [], []
    for number, refit in enumerate(refits):
        wide = widen_outliers(refit.session.parametrisation, refit.fit.x, sigma)
        if wide is not None:
            session = replace(refit.session, parametrisation=wide)
            tasks.append(RefitTask(refit.hypothesis, session, refit.fit.theta, refit.floor))
            chosen.append(number)
    admitted = list(refits)
    for number, wider in zip(chosen, run_refits(scene, tasks, settings.schedule), strict=True):
        refit = refits[number]
        coordinates = refit.session.parametrisation, wider.session.parametrisation
        if wider.objective < refit.objective and are_by_chance(*coordinates, wider.fit.x, sigma):
            admitted[number] = wider
    return admitted
