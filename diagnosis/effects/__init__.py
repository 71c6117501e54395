"""The catalogue: one file for each effect, which proposes its hypotheses for a machine."""

from collections.abc import Callable, Iterator

from diagnosis.effects import (
    appendage,
    drift,
    feedback_delay,
    gyroscopic,
    hammer_misalignment,
    joint_coupling,
    mass_error,
    missing_dof,
    parallel_path,
    sensor_gain,
    sensor_misalignment,
    sensor_polarity,
    sensor_position,
    structural_damping,
    support_loss,
    viscoelastic,
)
from diagnosis.hypothesis import Hypothesis, Scene

Proposer = Callable[[Scene], Iterator[Hypothesis]]

EFFECTS: dict[str, Proposer] = {
    "appendage": appendage.propose,
    "drift": drift.propose,
    "feedback_delay": feedback_delay.propose,
    "gyroscopic": gyroscopic.propose,
    "hammer_misalignment": hammer_misalignment.propose,
    "joint_coupling": joint_coupling.propose,
    "mass_error": mass_error.propose,
    "missing_dof": missing_dof.propose,
    "parallel_path": parallel_path.propose,
    "sensor_gain": sensor_gain.propose,
    "sensor_misalignment": sensor_misalignment.propose,
    "sensor_polarity": sensor_polarity.propose,
    "sensor_position": sensor_position.propose,
    "structural_damping": structural_damping.propose,
    "support_loss": support_loss.propose,
    "viscoelastic": viscoelastic.propose,
}

__all__ = ["EFFECTS", "Proposer"]
