"""Controllers that are objects of python-control."""

from typing import Any

import numpy as np

from identification.readers.controller import stated_delay
from identification.readers.loop_toml import MIN_PERIOD_S
from identification.words import Controller, UsageError


def controller_from_system(system: Any) -> Controller:
    """Return the controller that a python-control object is.

    Args:
        system: state space or transfer function of one input and one output, or a number.

    Raises:
        UsageError: it is no linear system of one input and one output, has a delay, or is sampled
            with a period that is not known.
    """
    import control  # noqa: PLC0415  # with its matplotlib it would add 0.7 s to every start
    import scipy.signal  # noqa: PLC0415  # slow to load

    if isinstance(system, Controller):
        return system
    try:
        is_number = isinstance(system, int | float)
        converted = control.ss(control.tf([system], [1]) if is_number else system)
    except Exception as error:
        raise UsageError(
            f"{type(system).__name__} is no linear controller ({error}): give a state space or a "
            "transfer function of python-control"
        ) from error
    if converted.ninputs != 1 or converted.noutputs != 1:
        raise UsageError(
            f"the controller has {converted.noutputs} x {converted.ninputs} channels: give each "
            "loop a controller with one input and one output"
        )
    period = 0.0 if converted.dt is None else converted.dt
    if period is True or not (period == 0 or MIN_PERIOD_S <= period <= 1):
        raise UsageError(
            f"the controller is discrete with the step {converted.dt}: give its sampling period as "
            f"dt, from {MIN_PERIOD_S:g} s to 1 s"
        )
    late = stated_delay(getattr(system, "__dict__", {}))
    if late:
        raise UsageError(f"the controller: {late}")
    matrices = converted.A, converted.B, converted.C, converted.D
    if isinstance(system, control.TransferFunction):
        fraction = np.ravel(system.num[0][0]), np.ravel(system.den[0][0])
        if len(np.trim_zeros(fraction[1], "f")) - 1 > len(converted.A):
            # The conversion cancelled a pole that the controller has, and that may grow.
            matrices = scipy.signal.tf2ss(*fraction)
    states, entry, output, through = (np.asarray(matrix, float) for matrix in matrices)
    return Controller(states, entry, output, through, float(period))
