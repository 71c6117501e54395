"""Gap of a refit with the true cause: the bound that a diagnosis can reach."""

from collections.abc import Mapping
from typing import Any

from diagnosis.algorithm import Diagnosis, estimate_gap_with
from diagnosis.data_checks.sensors import build_fault_hypothesis
from diagnosis.estimates.held_out_gap import HeldOutGap
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import BENDS
from identification import Fault


def read_fault(answer: Mapping[str, Any]) -> Fault | None:
    """The one effect of an answer as its TOML has it; None of nothing or several."""
    if "location" not in answer or "cause" in answer:
        return None
    parameters = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in answer.get("parameters", {}).items()
    }
    return Fault(answer["effect"], answer["location"], answer.get("dof"), 1.0, parameters, 1.0)


def refit_true_cause(diagnosis: Diagnosis, fault: Fault, jobs: int = 1) -> HeldOutGap | None:
    """Fit with the effect that is there.

    Args:
        diagnosis: the diagnosis, made without knowing it.
        fault: effect, place and direction; what a fit cannot find by itself, its parameters too.
        jobs: threads.

    Returns:
        The gap with it; None of an effect that is no Part yet.
    """
    causes = diagnosis.present.causes
    if diagnosis.after is not None and causes and _same(causes[0], fault):
        return diagnosis.after
    hypothesis = _hypothesis(diagnosis, fault)
    return None if hypothesis is None else estimate_gap_with(diagnosis, hypothesis, jobs)


def _same(hypothesis: Hypothesis, fault: Fault) -> bool:
    return (hypothesis.effect, hypothesis.location) == (fault.effect, fault.location) and (
        fault.dof is None or hypothesis.dof in (None, fault.dof)
    )


def _hypothesis(diagnosis: Diagnosis, fault: Fault) -> Hypothesis | None:
    if fault.location.startswith("sensor:") or fault.effect == BENDS:
        return build_fault_hypothesis(fault, diagnosis.session, (fault.location.partition(":")[2],))
    # Scores come the most promising first: of a scan, the shape that is nearest.
    alike = (
        score.hypothesis for score in diagnosis.search.scores if _same(score.hypothesis, fault)
    )
    return next(alike, None)
