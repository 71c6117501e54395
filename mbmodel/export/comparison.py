"""FRFs of the state space by python-control beside those of the equation of motion."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from identification.words import Complex, Input, Output, UsageError
from mbmodel.export.branch_states import ApproximatedLaw
from mbmodel.export.state_space import export_state_space
from mbmodel.export.system_poles import system_poles
from mbmodel.frf.linearised import Evaluator
from mbmodel.model import Model
from mbmodel.ports.request import FrfRequest

# Of the largest peak of all FRFs: an FRF below it is zero but for rounding, and its own peak is no
# measure of an error.
_MIN_PEAK_SHARE = 1e-10


@dataclass(frozen=True, eq=False)
class StateSpaceComparison:
    """Difference of two computations of the same FRFs.

    Args:
        request: outputs, inputs and lines.
        states: number of states.
        max_difference: largest difference of any FRF at any line, relative to that FRF's peak.
        rms_difference: root mean square over FRFs of ||difference|| / ||FRF||.
        worst: output, input and frequency [Hz] of the largest difference.
        worst_frfs: that FRF by the equation of motion, and by the state space; (2, n_freq).
        growth: largest real part of a pole of the state space [1/s]; above zero it is unstable.
        laws: what the state space approximates.
    """

    request: FrfRequest
    states: int
    max_difference: float
    rms_difference: float
    worst: tuple[Output, Input, float]
    worst_frfs: Complex
    growth: float
    laws: tuple[ApproximatedLaw, ...]


def compare_state_space(model: Model, request: FrfRequest) -> StateSpaceComparison:
    """Compute FRFs by python-control from the state space, and by the equation of motion.

    python-control evaluates C (s - A)^-1 B + D. Before, the states get units in which the entries
    of A are of like size: with slycot it loses five digits otherwise. The FRFs of the equation of
    motion hold losses and delays exactly, so the difference is that of the approximations and of
    rounding.

    Args:
        model: machine and Parts, at their nominal parameters.
        request: outputs, inputs and lines; lines at 0 Hz are left out.

    Raises:
        UsageError: no line above 0 Hz.
    """
    import control  # noqa: PLC0415  # with its matplotlib it would slow down every start

    lines = request.freq_hz[request.freq_hz > 0]
    if not len(lines):
        raise UsageError("the state space is compared at lines above 0 Hz: raise the band's end")
    request = replace(request, freq_hz=lines)
    expected = Evaluator(model, request).at(model.drawn).values
    export = export_state_space(model, model.drawn, request)
    system = export.system
    _, (units, _) = scipy.linalg.matrix_balance(system.A, permute=False, separate=True)
    scaled = control.ss(
        system.A * units / units[:, None], system.B / units[:, None], system.C * units, system.D
    )
    response = control.frequency_response(scaled, 2 * np.pi * lines, squeeze=False)
    values = np.moveaxis(np.asarray(response.complex), -1, 0)
    difference = np.abs(values - expected)
    relative = difference / _peaks(expected)
    line, output, column = np.unravel_index(int(relative.argmax()), relative.shape)
    power = np.maximum((np.abs(expected) ** 2).sum(axis=0), _peaks(expected)[0] ** 2)
    return StateSpaceComparison(
        request,
        int(system.nstates),
        float(relative.max()),
        float(np.sqrt(((difference**2).sum(axis=0) / power).mean())),
        (request.outputs[output], request.inputs[column], float(lines[line])),
        np.stack([expected[:, output, column], values[:, output, column]]),
        float(system_poles(system.A).real.max(initial=-np.inf)),
        export.laws,
    )


def _peaks(values: Complex) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the peak of each FRF, of all for one that is zero but for rounding; (1, out, in)."""
    peaks = np.abs(values).max(axis=0)
    largest = float(peaks.max()) or 1.0
    return np.asarray(np.where(peaks > _MIN_PEAK_SHARE * largest, peaks, largest)[None])
