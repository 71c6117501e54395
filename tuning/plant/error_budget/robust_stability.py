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

Deviations of stability margins by the model-error floor.

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

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.plant.control_loops.loop_gain_lines import LoopGainOf, sensitivity, single_loop_gains
from tuning.plant.control_loops.scaled_singular_values import scaled_singular_values
from tuning.plant.control_loops.stability_margins import AllMargins, LoopMargins, Margin
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


_STEP = 1e-5  # relative, of the frequency of a slope


def floor_deviations(
    plant: LoopPlant, theta: Real, nominal: AllMargins, discrepancy: float
) -> tuple[dict[str, float], ...]:
    """Return the deviations of the margins of each loop by a relative error of all forces.

    Args:
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
