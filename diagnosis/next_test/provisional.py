"""Provisional findings while a test runs: the null model, its score tests, and the next hit.

They are the first steps of a diagnosis (``diagnosis.algorithm``), without refits of causes. A gain
is thus a prediction of the linearised model; the full diagnosis decides. Planned hits are ranked by
the information that they add (``tuning.assessment.further_tests``).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from diagnosis.data_checks.check_data import check_data
from diagnosis.inference.calibration import load_calibration
from diagnosis.null_model import fit_baseline
from diagnosis.search.refit_round import list_excluded, score_hypotheses
from diagnosis.search.score_test import select_best_of_sites
from diagnosis.settings import SETTINGS, DiagnosisSettings
from identification.words import Dof, Real
from mbmodel import Model
from tuning import (
    Gap,
    Session,
    channel_gaps,
    estimate_confidence,
    is_gap_visible,
    predict,
    summarise_gaps,
)
from tuning.assessment.findings import GainRow
from tuning.assessment.further_tests import rank_planned_hits


@dataclass(frozen=True)
class ProvisionalCause:
    """Effect and place that would explain a part of the gap.

    Args:
        effect, location, dof: as the verdict states them.
        gain: predicted gain [nats], by the number of independent values.
    """

    effect: str
    location: str
    dof: str | None
    gain: float

    @property
    def site(self) -> str:
        """Effect and place, such as ``appendage@body:ty``."""
        return f"{self.effect}@{self.location}"


@dataclass(frozen=True, eq=False)
class ProvisionalFindings:
    """Findings of the accepted hits so far.

    Args:
        model, theta: null model and its fitted parameters [SI].
        gap: gap of the null model.
        is_gap_visible: whether more than noise remains.
        causes: the most promising effects, the best first; none without a gap.
        next_hits: planned places and directions, the most informative first.
    """

    model: Model
    theta: Real
    gap: Gap
    is_gap_visible: bool
    causes: tuple[ProvisionalCause, ...]
    next_hits: tuple[GainRow, ...]


def find_provisionally(
    session: Session,
    planned: Sequence[Dof],
    *,
    jobs: int = 1,
    settings: DiagnosisSettings = SETTINGS,
) -> ProvisionalFindings:
    """Fit the null model to what was measured, score all effects, and rank planned hits.

    Args:
        session: accepted hits and nominal model.
        planned: places and directions that are still to be hit.

    Raises:
        UsageError: the band holds too few lines.
    """
    base = fit_baseline(check_data(session, settings), jobs, settings)
    null = base.null
    campaign, model = null.session.campaign, null.session.model
    gap = summarise_gaps(channel_gaps(predict(model, null.fit.theta, campaign), campaign))
    is_visible = is_gap_visible(null.gap)
    causes: tuple[ProvisionalCause, ...] = ()
    if is_visible:
        ranked = score_hypotheses(base.scene, null, list_excluded(base), settings)
        independent = null.summary.count_independent(load_calibration()) / null.summary.values
        causes = tuple(
            ProvisionalCause(*score.hypothesis.key, score.gain * independent)
            for score in select_best_of_sites(ranked)[: settings.max_refits]
        )
    confidence = estimate_confidence(model, campaign, null.fit, jobs, has_model_error=is_visible)
    gains = rank_planned_hits(null.session, confidence, planned)
    return ProvisionalFindings(model, null.fit.theta, gap, is_visible, causes, gains)
