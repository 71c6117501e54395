"""Rows of faults of sensors, in modes.json and diagnosis.json."""

from typing import Annotated

from pydantic import BaseModel, Field

from identification import Fault

Finite = Annotated[float, Field(allow_inf_nan=False)]


class FaultRow(BaseModel):
    """Fault of one sensor or of two sensors, or a body that does not move as a solid.

    Args:
        effect: name of the fault, such as ``sensor_gain`` or ``flexible_body``.
        location: ``sensor:acc12``, ``sensor:acc1+acc2`` or ``body:ty``.
        dof: directions, such as ``tz`` or ``tx+ty``; null for all.
        probability: posterior probability of the fault, given the faults before it.
        parameters: gain; rotation [rad] and offset [m] along world axes; delay [s]; frequency [Hz],
            damping ratio.
        excess_after: residual over the noise once the fault is corrected.
    """

    effect: str
    location: str
    dof: str | None
    probability: Finite
    parameters: dict[str, Finite | list[Finite]]
    excess_after: Finite


def fault_row(fault: Fault) -> FaultRow:
    """Return a fault's row of ``modes.json``."""
    parameters = {
        name: list(value) if isinstance(value, tuple) else float(value)
        for name, value in fault.parameters.items()
    }
    return FaultRow(
        effect=fault.effect,
        location=fault.location,
        dof=fault.dof,
        probability=fault.probability,
        parameters=parameters,
        excess_after=fault.excess_after,
    )
