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
    """Return the single effect of an answer from its TOML; None for no effect or several."""
    if "location" not in answer or "cause" in answer:
        return None
    parameters = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in answer.get("parameters", {}).items()
    }
    return Fault(answer["effect"], answer["location"], answer.get("dof"), 1.0, parameters, 1.0)


def refit_true_cause(diagnosis: Diagnosis, fault: Fault, jobs: int = 1) -> HeldOutGap | None:
    """Return the gap of a refit with the true effect; None if no hypothesis describes it.

    Args:
        diagnosis: diagnosis without knowledge of the effect.
        fault: effect, place and direction, with the parameters that a fit cannot find.
        jobs: number of threads.
    """
    causes = diagnosis.present.causes
    if diagnosis.after is not None and causes and _is_fault(causes[0], fault):
        return diagnosis.after
    hypothesis = _find_hypothesis(diagnosis, fault)
    return None if hypothesis is None else estimate_gap_with(diagnosis, hypothesis, jobs)


def _is_fault(hypothesis: Hypothesis, fault: Fault) -> bool:
    return (hypothesis.effect, hypothesis.location) == (fault.effect, fault.location) and (
        fault.dof is None or hypothesis.dof in (None, fault.dof)
    )


def _find_hypothesis(diagnosis: Diagnosis, fault: Fault) -> Hypothesis | None:
    if fault.location.startswith("sensor:") or fault.effect == BENDS:
        return build_fault_hypothesis(fault, diagnosis.session, (fault.location.partition(":")[2],))
    # The most promising score comes first: of a scan, the nearest shape.
    matching = (
        score.hypothesis for score in diagnosis.search.scores if _is_fault(score.hypothesis, fault)
    )
    return next(matching, None)
