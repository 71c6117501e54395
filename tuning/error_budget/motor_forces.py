"""Force or torque of a motor per unit of its control, for a disturbance in N or N m."""

from pathlib import Path

import numpy as np

from identification.words import Input, InputError
from mbmodel import Machine
from tuning.error_budget.spectral_units import Kind

FORCE_UNITS: dict[Kind | None, str] = {"force": "N", "torque": "N m"}


def motor_force(path: Path, key: str, machine: Machine, port: Input, unit: str) -> float:
    """Return the force or torque of a motor at its slide or hinge per unit of its control.

    Args:
        path: budget.toml, for messages.
        key: of the disturbance, for messages.
        machine: with the motor.
        port: the motor.
        unit: N or N m.

    Raises:
        InputError: a motor at no single slide or hinge, or a unit of the other kind.
    """
    gain = machine.motors[str(port)]
    acts_at = np.flatnonzero(gain.joint)
    axles = [axle for axle in machine.axles if axle.coordinate in acts_at]
    if gain.body.any() or len(acts_at) != 1 or len(axles) != 1:
        raise InputError(
            f"{path}: {key} is stated in {unit}, but {port} acts at no single slide or hinge: "
            "state it in units of its control, such as 1/sqrt(Hz)"
        )
    needed = "N m" if axles[0].turns else "N"
    if unit != needed:
        raise InputError(
            f"{path}: {key} is stated in {unit}, but {port} acts at {axles[0].joint} in {needed}: "
            f"write {needed}/sqrt(Hz), or 1/sqrt(Hz) for units of its control"
        )
    return float(gain.joint[acts_at[0]])
