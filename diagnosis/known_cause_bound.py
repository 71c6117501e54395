"""What a refit leaves that is told the effect and its place: the most that can be reached."""

from collections.abc import Mapping
from typing import Any

from diagnosis.algorithm import Diagnosis, gap_with
from diagnosis.data_checks.sensors import hypothesis_of
from diagnosis.estimates.held_out_gap import HeldOutGap
from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import BENDS
from identification import Fault


def told_of(answer: Mapping[str, Any]) -> Fault | None:
    """The one effect of an answer as its TOML has it; None of nothing or several."""
    if "location" not in answer or "cause" in answer:
        return None
    parameters = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in answer.get("parameters", {}).items()
    }
    return Fault(answer["effect"], answer["location"], answer.get("dof"), 1.0, parameters, 1.0)


def oracle(found: Diagnosis, told: Fault, jobs: int = 1) -> HeldOutGap | None:
    """Fit with the effect that is there.

    Args:
        found: the diagnosis, made without knowing it.
        told: effect, place and direction; what a fit cannot find by itself, its parameters too.
        jobs: threads.

    Returns:
        The gap with it; None of an effect that is no Part yet.
    """
    causes = found.present.causes
    if found.after is not None and causes and _same(causes[0], told):
        return found.after
    one = _hypothesis(found, told)
    return None if one is None else gap_with(found, one, jobs)


def _same(one: Hypothesis, told: Fault) -> bool:
    return (one.effect, one.location) == (told.effect, told.location) and (
        told.dof is None or one.dof in (None, told.dof)
    )


def _hypothesis(found: Diagnosis, told: Fault) -> Hypothesis | None:
    if told.location.startswith("sensor:") or told.effect == BENDS:
        return hypothesis_of(told, found.session, (told.location.partition(":")[2],))
    # Scores come the most promising first: of a scan, the shape that is nearest.
    alike = (one.hypothesis for one in found.search.scores if _same(one.hypothesis, told))
    return next(alike, None)
