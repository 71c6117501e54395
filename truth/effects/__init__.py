"""Effects that a machine has and its drawing lacks, listed here by name."""

from collections.abc import Mapping
from types import MappingProxyType

from truth.effects.body_errors import draw_appendage, draw_gyroscopic, draw_mass_error
from truth.effects.drift import draw_drift, draw_level_drift
from truth.effects.effect import Answer, Draw, Effect, Scene, draw_nothing
from truth.effects.feedback_delay import draw_feedback_delay
from truth.effects.flexible_body import draw_flexible_body
from truth.effects.frequency_laws import draw_structural_damping, draw_viscoelastic
from truth.effects.hammer_errors import (
    draw_hammer_delay,
    draw_hammer_gain,
    draw_hammer_misalignment,
    draw_hammer_position,
)
from truth.effects.joint_errors import draw_inertance, draw_joint_coupling, draw_missing_dof
from truth.effects.joint_laws import draw_backlash, draw_friction, draw_hardening
from truth.effects.parallel_path import draw_parallel_path
from truth.effects.sensor_errors import (
    draw_mount_resonance,
    draw_sensor_delay,
    draw_sensor_gain,
    draw_sensor_misalignment,
    draw_sensor_polarity,
    draw_sensor_position,
    draw_sensor_swap,
)
from truth.effects.support_loss import draw_support_loss

CATALOGUE: Mapping[str, Draw] = MappingProxyType(
    {
        "none": draw_nothing,
        "mass_error": draw_mass_error,
        "appendage": draw_appendage,
        "flexible_body": draw_flexible_body,
        "gyroscopic": draw_gyroscopic,
        "joint_coupling": draw_joint_coupling,
        "missing_dof": draw_missing_dof,
        "structural_damping": draw_structural_damping,
        "viscoelastic": draw_viscoelastic,
        "inertance": draw_inertance,
        "feedback_delay": draw_feedback_delay,
        "support_loss": draw_support_loss,
        "friction": draw_friction,
        "backlash": draw_backlash,
        "hardening": draw_hardening,
        "parallel_path": draw_parallel_path,
        "sensor_gain": draw_sensor_gain,
        "sensor_polarity": draw_sensor_polarity,
        "sensor_misalignment": draw_sensor_misalignment,
        "sensor_position": draw_sensor_position,
        "sensor_swap": draw_sensor_swap,
        "sensor_delay": draw_sensor_delay,
        "mount_resonance": draw_mount_resonance,
        "hammer_misalignment": draw_hammer_misalignment,
        "drift": draw_drift,
        "hammer_gain": draw_hammer_gain,
        "hammer_delay": draw_hammer_delay,
        "hammer_position": draw_hammer_position,
    }
)
RIVALS: Mapping[str, Draw] = MappingProxyType({"level_drift": draw_level_drift})  # of laws
NONLINEAR = frozenset({"friction", "backlash", "hardening"})  # they need the time domain

__all__ = [
    "CATALOGUE",
    "NONLINEAR",
    "RIVALS",
    "Answer",
    "Draw",
    "Effect",
    "Scene",
]
