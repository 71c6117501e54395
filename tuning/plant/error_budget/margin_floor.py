r"""Deviations of stability margins by the model-error floor.

The floor changes the loop gain by dL, a complex error with one standard deviation sd in each
component (``robust_stability``), alike near the frequency of a margin. With x + i y = dL / L, and
a + i b = d ln L / d ln w the slopes there, to first order:

    gain margin 1 / |L| where L is real     d ln = -x + y a / b
    phase margin where |L| = 1              d = y - x b / a
    delay margin, the phase p over w        d ln = y / p + x (1 / a - b / (a p))
    modulus margin, smallest |1 + L|        d = Re(dL), turned: sd
    crossover |L| = 1                       d ln w = -x / a
    bandwidth by |S|                        d ln w = Re(S dL) / (d ln |S| / d ln w)
"""

from collections.abc import Callable

import numpy as np

from identification.words import Real
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.plant.control_loops.loop_gain_lines import LoopGainOf, sensitivity, single_loop_gains
from tuning.plant.control_loops.margin_values import AllMargins, LoopMargins, Margin
from tuning.plant.error_budget.loop_algebra import controller_response, measured_rows
from tuning.plant.error_budget.loop_plant import LoopPlant

_STEP = 1e-5  # relative, of the frequency of a slope


def floor_deviations(
    plant: LoopPlant, theta: Real, nominal: AllMargins, discrepancy: float
) -> tuple[dict[str, float], ...]:
    """Return the deviations of the margins of each loop by a relative error of all forces.

    Args:
        plant: FRFs between the ports of the loops.
        theta: its parameters in SI; (n_theta,).
        nominal: margins there.
        discrepancy: relative error e of the machine's forces.
    """
    gain_of = plant.gain_at(theta)

    def deviation_of(freq_hz: Real) -> Real:
        lines = plant.lines(theta, freq_hz)
        laplace = lines.request.laplace
        reading = measured_rows(plant.definition, plant.ports, laplace)
        gains = controller_response(plant.definition, laplace)
        closed = sensitivity(gain_of(freq_hz))
        drive = plant.ports.controls @ (gains[:, :, None] * closed)
        errors = np.einsum("fll->fl", discrepancy_motion(lines, closed @ reading, drive))
        returned = np.abs(np.einsum("fll->fl", closed)) ** 2
        return np.asarray(discrepancy / np.sqrt(2) * errors / returned)

    return tuple(
        margin_deviations(gain_of, deviation_of, number, loop)
        for number, loop in enumerate(nominal.loops)
    )


def margin_deviations(
    gain_of: LoopGainOf,
    deviation_of: Callable[[Real], Real],
    number: int,
    margins: LoopMargins,
) -> dict[str, float]:
    """Return the deviations of the margins of one loop by their names, all others closed.

    That of the phase margin is in degrees, all others of the logarithm. A margin that no change
    reaches has none.

    Args:
        gain_of: GK at any lines [Hz].
        deviation_of: standard deviation of each component of L at any lines; (n_freq, n_loop).
        number: of the loop.
        margins: its margins.
    """
    named = {
        name: margin.freq_hz
        for name, margin in vars(margins).items()
        if isinstance(margin, Margin) and margin.is_finite and margin.freq_hz > 0
    }
    if not named:
        return {}
    freq = np.array(list(named.values()))
    lines = np.concatenate([freq, freq * (1 + _STEP)])
    pairs = single_loop_gains(gain_of(lines))[:, number].reshape(2, -1)
    deviations = deviation_of(freq)[:, number]
    deviation_by_name: dict[str, float] = {}
    for k, name in enumerate(named):
        gain, after = complex(pairs[0, k]), complex(pairs[1, k])
        if not (gain and after):  # a loop whose gain vanishes there has no slope
            continue
        slope = complex(np.log(after / gain)) / _STEP
        phase = 2 * np.pi * float(freq[k]) * margins.delay.value
        factor = abs(_factor(name, gain, slope, phase))
        deviation_by_name[name] = factor * float(deviations[k]) / abs(gain)
    return deviation_by_name


def _factor(name: str, gain: complex, slope: complex, phase: float) -> float:
    """Return the deviation of a margin per deviation of dL / L.

    Args:
        name: of the margin.
        gain: L there.
        slope: d ln L / d ln w.
        phase: of the delay margin [rad].
    """
    growth, turn = slope.real, slope.imag
    closed = gain / (1 + gain)
    match name:
        case "crossover":
            return 1 / growth
        case "gain" | "reduction":
            return float(np.hypot(1.0, growth / turn))
        case "phase":
            return float(np.degrees(np.hypot(1.0, turn / growth)))
        case "delay":
            return float(np.hypot(1 / phase, (1 - turn / phase) / growth))
        case "modulus":
            return abs(closed)
        case _:
            return abs(closed) / (slope * closed).real
