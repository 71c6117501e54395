r"""Robust stability of control loops: |W T| < 1 for the errors of the model.

The model errs by a relative error of the plant of size |W| at most. The loops are stable for all
such plants if they are stable for the model and

    |W T| < 1 at every line,    T = L / (1 + L) of the loop with all others closed

(Skogestad and Postlethwaite 2005, ch. 7.5). With all loops at once |T| is the largest singular
value of T = GK (1 + GK)^-1, the units scaled out. There are two weights:

- the held-out error of the tuning (``multiplicative_error``), in its band;
- the model-error floor, a relative error e of the machine's forces (``model_discrepancy``), which
  is known at the ports of the loop itself. It changes L by dL = S_l dG K S^l / S_ll^2, S_l and S^l
  row and column l of S. At each line the circle |dL| < e sd(dL) sqrt(-log 0.05) holds 95 % of it,
  and |W T| = |dL S_ll|.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from mbmodel.uncertainty.model_discrepancy import discrepancy_motion
from tuning.assessment.multiplicative_error import MultiplicativeError
from tuning.control_loops.loop_gain_lines import sensitivity
from tuning.control_loops.margin_values import AllMargins
from tuning.control_loops.scaled_singular_values import scaled_singular_values
from tuning.error_budget.loop_algebra import controller_response, measured_rows
from tuning.error_budget.loop_plant import LoopPlant

_CIRCLE_95 = float(np.sqrt(-np.log(0.05)))  # radius that holds 95 % of a complex normal value
HELD_OUT, FLOOR = "held-out error of the tuning", "model-error floor"


@dataclass(frozen=True)
class RobustTest:
    """Largest |W T|: below 1 the loops are stable for every plant within the weight.

    Args:
        weight: what W is: the held-out error or the model-error floor.
        peak: of |W T|.
        freq_hz: of the peak [Hz].
        band: in which W is known [Hz].
    """

    weight: str
    peak: float
    freq_hz: float
    band: tuple[float, float]


def held_out_tests(
    plant: LoopPlant,
    theta: Real,
    nominal: AllMargins,
    errors: Sequence[MultiplicativeError | None],
) -> tuple[list[list[RobustTest]], list[RobustTest]]:
    """Return |W T| of each loop, and of all, W the held-out error of each plant."""
    robust: list[list[RobustTest]] = [[] for _ in errors]
    known_errors = {k: error for k, error in enumerate(errors) if error is not None}
    if not known_errors:
        return robust, []
    lines = next(iter(known_errors.values())).freq_hz
    inside = (nominal.freq_hz > lines[0]) & (nominal.freq_hz < lines[-1])
    freq = np.unique(np.concatenate([nominal.freq_hz[inside], lines]))
    closed = np.eye(len(errors)) - sensitivity(plant.gain_at(theta)(freq))
    weighted = np.zeros_like(closed)
    for k, error in known_errors.items():
        weighted[:, k] = np.interp(freq, lines, error.quantile)[:, None] * closed[:, k]
        robust[k].append(_peak(HELD_OUT, freq, np.abs(weighted[:, k, k])))
    is_whole = len(known_errors) == len(errors)
    at_once = [_peak(HELD_OUT, freq, scaled_singular_values(weighted))] if is_whole else []
    return robust, at_once


def floor_tests(
    plant: LoopPlant, theta: Real, nominal: AllMargins, discrepancy: float
) -> list[RobustTest]:
    """Return |W T| of each loop and of all by a relative error of the machine's forces."""
    freq = nominal.freq_hz
    lines = plant.lines(theta, freq)
    laplace = lines.request.laplace
    reading = measured_rows(plant.definition, plant.ports, laplace)
    gains = controller_response(plant.definition, laplace)
    closed = sensitivity(nominal.gains)
    drive = plant.ports.controls @ (gains[:, :, None] * closed)
    deviation = np.einsum("fll->fl", discrepancy_motion(lines, closed @ reading, drive))
    single = deviation / np.abs(np.einsum("fll->fl", closed))
    together = scaled_singular_values(discrepancy_motion(lines, reading, drive).astype(complex))
    sizes = discrepancy * _CIRCLE_95 * np.column_stack([single, together])
    return [_peak(FLOOR, freq, column) for column in sizes.T]


def _peak(weight: str, freq: Real, sizes: Real) -> RobustTest:
    """Return the largest value over lines."""
    best = int(np.argmax(sizes))
    return RobustTest(
        weight, float(sizes[best]), float(freq[best]), (float(freq[0]), float(freq[-1]))
    )
