"""What the model lacks: where the gap lies, which effect causes it, how far it shrinks with it."""

from diagnosis.diagnose import Diagnosis, diagnose
from diagnosis.effects import EFFECTS, PROVEN, Effect, catalogue
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.oracle import oracle, told_of
from diagnosis.report import step_intervals, verdict_of
from diagnosis.residual import ResidualShare, residual_shares
from diagnosis.verdict import Verdict

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
