"""Hypotheses of the faults of sensors and the bending of bodies that redundant channels prove."""

from collections.abc import Iterator

import numpy as np

from diagnosis.data_checks.sensors import SensorChecks, build_fault_hypothesis
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import BENDS
from diagnosis.settings import DiagnosisSettings
from tuning import Session


def build_gross_hypotheses(checks: SensorChecks, session: Session) -> tuple[Hypothesis, ...]:
    """Return the hypotheses of gross faults, which every set of causes has."""
    hypotheses = (build_fault_hypothesis(fault, session, is_certain=True) for fault in checks.gross)
    return tuple(hypothesis for hypothesis in hypotheses if hypothesis is not None)


def build_candidates(
    checks: SensorChecks, session: Session, settings: DiagnosisSettings
) -> Iterator[Hypothesis]:
    """Yield the hypotheses of the other faults, which compete with all effects of the catalogue.

    The frequency of a body's mode starts at several multiples of that of its highest peak, because
    the joints below and the load above the body move the peak. Of many bodies that bend a little,
    those that deviate most from the motion of a solid are candidates.

    Args:
        settings: starts of a mode's frequency.
    """
    deviations = {
        check.body: float(np.sqrt(np.mean(check.deviation**2))) for check in checks.bodies
    }
    bending = [fault.location.partition(":")[2] for fault in checks.small if fault.effect == BENDS]
    most = sorted(bending, key=lambda body: -deviations[body])[: settings.max_bending_bodies]
    for fault in checks.small:
        body = fault.location.partition(":")[2]
        if fault.effect == BENDS and body not in most:
            continue
        ratios = settings.bending_start_ratios if fault.effect == BENDS else (1.0,)
        for ratio in ratios:
            hypothesis = build_fault_hypothesis(fault, session, (body,), checks.campaign, ratio)
            if hypothesis is not None and hypothesis.is_modelled:
                yield hypothesis
