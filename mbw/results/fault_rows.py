"""Rows of faults of sensors, in modes.json and diagnosis.json."""

from identification.readers.result_files import ResultRow


class FaultRow(ResultRow):
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
    probability: float
    parameters: dict[str, float | list[float]]
    excess_after: float
