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

Outside the band in which W is known the test says nothing: the plant may have modes there that the
model lacks. Where |L| = 1 or |T| peaks outside that band, a small |W T| shows no robust stability.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.plant.control_loops.loop_gain_lines import sensitivity, single_loop_gains
from tuning.plant.control_loops.margin_values import AllMargins
from tuning.plant.control_loops.scaled_singular_values import scaled_singular_values
from tuning.plant.error_budget.loop_algebra import controller_response, measured_rows
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.uncertainty.multiplicative_error import MultiplicativeError

_CIRCLE_95 = float(np.sqrt(-np.log(0.05)))  # radius that holds 95 % of a complex normal value
_MIN_CRITICAL_SIZE = 1.05  # of |T|, which an error below 1 / 1.05 of the plant makes critical
HELD_OUT, FLOOR = "held-out error of the tuning", "model-error floor"


@dataclass(frozen=True)
class RobustTest:
    """Largest |W T|: below 1 the loops are stable for every plant within a weight known there.

    Args:
        weight: what W is: the held-out error or the model-error floor.
        peak: largest |W T|.
        frequency: frequency of the peak [Hz].
        band: band in which W is known [Hz].
        holds: whether the peak is below 1.
        outside: frequencies outside the band with |L| = 1 or at a peak of |T| [Hz].
        robustly_stable: whether the loops are stable for all plants within W; None where the peak
            is below 1 but W is not known at all frequencies that matter.
        wanted_band: band that a test has to cover, an octave beyond what is critical [Hz].
    """

    weight: str
    peak: float
    frequency: float
    band: tuple[float, float]
    holds: bool
    outside: tuple[float, ...]
    robustly_stable: bool | None
    wanted_band: tuple[float, float]


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
        robust[k].append(_robust_test(HELD_OUT, freq, np.abs(weighted[:, k, k]), nominal, [k]))
    is_whole = len(known_errors) == len(errors)
    if not is_whole:
        return robust, []
    together = scaled_singular_values(weighted)
    return robust, [_robust_test(HELD_OUT, freq, together, nominal, range(len(errors)))]


def floor_tests(
    plant: LoopPlant,
    theta: Real,
    nominal: AllMargins,
    discrepancy: float,
    tested: tuple[float, float] | None = None,
) -> list[RobustTest]:
    """Return |W T| of each loop and of all by a relative error of the machine's forces.

    Args:
        plant: FRFs between the ports of the loops.
        theta: its parameters in SI; (n_theta,).
        nominal: margins with the lines.
        discrepancy: relative error of the forces.
        tested: band of the test that showed it [Hz]; None for that of all lines.
    """
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
    count = sizes.shape[1] - 1
    loops = [*([k] for k in range(count)), range(count)]
    return [
        _robust_test(FLOOR, freq, column, nominal, which, tested)
        for column, which in zip(sizes.T, loops, strict=True)
    ]


def _robust_test(
    weight: str,
    freq: Real,
    sizes: Real,
    nominal: AllMargins,
    loops: Iterable[int],
    band: tuple[float, float] | None = None,
) -> RobustTest:
    """Return the largest |W T| over lines, and where a loop is critical outside the band of W."""
    best = int(np.argmax(sizes))
    peak = float(sizes[best])
    low, high = band or (float(freq[0]), float(freq[-1]))
    gains = single_loop_gains(nominal.gains)
    critical: list[float] = []
    for k in loops:
        critical += nominal.loops[k].gain_crossovers[:, 0].tolist()
        closed = np.abs(gains[:, k] / (1 + gains[:, k]))
        highest = int(np.argmax(closed))
        if closed[highest] > _MIN_CRITICAL_SIZE:
            critical.append(float(nominal.freq_hz[highest]))
    outside = tuple(sorted({each for each in critical if not low <= each <= high}))
    return RobustTest(
        weight,
        peak,
        float(freq[best]),
        (low, high),
        holds=peak < 1,
        outside=outside,
        robustly_stable=False if peak >= 1 else None if outside else True,
        wanted_band=(
            min([low, *(each / 2 for each in outside if each < low)]),
            max([high, *(each * 2 for each in outside if each > high)]),
        ),
    )
