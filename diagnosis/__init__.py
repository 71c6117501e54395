"""Diagnosis of the gap between model and test: its place, its causes, and what they close."""

from diagnosis.algorithm import Diagnosis, diagnose
from diagnosis.effects import EFFECTS, PROVEN, Effect, catalogue
from diagnosis.estimates.residual_shares import ResidualShare, residual_shares
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.known_cause_bound import oracle, told_of
from diagnosis.verdict.build import step_intervals, verdict_of
from diagnosis.verdict.schema import Verdict

__all__ = [
    "EFFECTS",
    "PROVEN",
    "Diagnosis",
    "Effect",
    "Hypothesis",
    "ResidualShare",
    "Scene",
    "Verdict",
    "catalogue",
    "diagnose",
    "oracle",
    "residual_shares",
    "step_intervals",
    "told_of",
    "verdict_of",
]
