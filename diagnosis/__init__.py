"""Diagnosis of the gap between model and test: its place, its causes, and what they close."""

from diagnosis.algorithm import Diagnosis, diagnose
from diagnosis.effects import EFFECTS, PROVEN, Effect, load_catalogue
from diagnosis.estimates.residual_shares import compute_residual_shares
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.input_hash import hash_inputs
from diagnosis.known_cause_bound import read_fault, refit_true_cause
from diagnosis.verdict.build import build_verdict, estimate_step_intervals
from diagnosis.verdict.schema import Verdict

__all__ = [
    "EFFECTS",
    "PROVEN",
    "Diagnosis",
    "Effect",
    "Hypothesis",
    "Scene",
    "Verdict",
    "build_verdict",
    "compute_residual_shares",
    "diagnose",
    "estimate_step_intervals",
    "hash_inputs",
    "load_catalogue",
    "read_fault",
    "refit_true_cause",
]
