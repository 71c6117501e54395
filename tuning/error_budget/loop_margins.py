r"""Stability margins of the loops of a budget: of the machine, its posterior and its model error.

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
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Real
from mbmodel import Evaluator, FrfRequest, Linearised, Model, PosteriorOfModel
from mbmodel.uncertainty.model_discrepancy import discrepancy_motion
from tuning.assessment.multiplicative_error import MultiplicativeError, held_out_loop_error
from tuning.control_loops.loop_gain_lines import LoopGainOf, first_lines, sensitivity
from tuning.control_loops.scaled_singular_values import scaled_singular_values
from tuning.control_loops.stability_margins import AllMargins, stability_margins
from tuning.error_budget.budget import ErrorBudget
from tuning.error_budget.closed_loop_states import loop_states
from tuning.error_budget.definition import BudgetDefinition
from tuning.error_budget.loop_algebra import (
    PortMap,
    controller_response,
    loop_gains,
    map_ports,
    measured_rows,
)
from tuning.files.result import TuningResult

_RANGE = 10.0  # of lines below the slowest and above the fastest pole, and of the band
_MIN_RELATIVE_POLE = 1e-7  # of the fastest pole: slower ones are poles at 0 Hz
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


@dataclass(frozen=True, eq=False)
class BudgetMargins:
    """Margins of the loops of a budget.

    Args:
        names: of the loops; n_loop.
        nominal: margins of the machine.
        samples: those of machines of the posterior; empty without one.
        robust: tests of each loop; n_loop.
        robust_at_once: tests of all loops at once.
        held_out: error of the plant of each loop; None where the tuning knows nothing of it.
    """

    names: tuple[str, ...]
    nominal: AllMargins
    samples: tuple[AllMargins, ...]
    robust: tuple[tuple[RobustTest, ...], ...]
    robust_at_once: tuple[RobustTest, ...]
    held_out: tuple[MultiplicativeError | None, ...]

    def __repr__(self) -> str:
        """Return the margins of each loop in a line."""
        pairs = zip(self.names, self.nominal.loops, strict=True)
        return "\n".join(f"{name}: {margins!r}" for name, margins in pairs)

    def worst_sample(self, loop: int) -> int:
        """Return the number of the sample with the smallest modulus margin of a loop."""
        return int(np.argmin([each.loops[loop].modulus.value for each in self.samples]))


@dataclass(frozen=True, eq=False)
class LoopPlant:
    """FRFs between the ports of the loops of a machine.

    Args:
        model: machine and Parts, without the loops.
        definition: loops alone.
        ports: their labels.
    """

    model: Model
    definition: BudgetDefinition
    ports: PortMap

    @classmethod
    def of(cls, model: Model, definition: BudgetDefinition) -> "LoopPlant":
        """Return the plant of a budget's loops around a machine."""
        loops = replace(definition, errors=(), sources=())
        return cls(model, loops, map_ports(loops))

    def poles(self, theta: Real, *, is_closed: bool) -> Complex:
        """Return the poles with all loops closed or open [rad/s]; (n_pole,)."""
        definition = self.definition if is_closed else replace(self.definition, loops=())
        return loop_states(self.model, theta, definition, self.ports).poles()

    def margins(self, theta: Real, open_poles: Complex, closed_poles: Complex) -> AllMargins:
        """Return the margins at some parameters, where the loops are stable.

        Args:
            theta: (n_theta,).
            open_poles: with all loops open, of a machine near this one [rad/s]; (n_pole,).
            closed_poles: with all loops closed [rad/s]; (n_pole,).
        """
        lines = _lines(self.definition.band, open_poles, closed_poles)
        return stability_margins(self.gain_at(theta), lines)

    def lines(self, theta: Real, freq_hz: Real) -> Linearised:
        """Return the FRFs at some parameters and lines."""
        request = FrfRequest(freq_hz, self.ports.outputs, self.ports.inputs, "receptance")
        return Evaluator(self.model, request).at(theta)

    def gain_at(self, theta: Real) -> LoopGainOf:
        """Return the loop gains GK at some parameters as a function of frequency."""

        def gain_of(freq_hz: Real) -> Complex:
            lines = self.lines(theta, freq_hz)
            return loop_gains(self.definition, self.ports, lines.values, lines.request.laplace)

        return gain_of


def budget_margins(
    budget: ErrorBudget,
    posterior: PosteriorOfModel | None = None,
    samples: Sequence[tuple[Real, Complex]] = (),
    tuning: TuningResult | None = None,
) -> BudgetMargins:
    """Compute the margins of the loops of a budget, which are stable.

    Args:
        budget: with loops.
        posterior: of the parameters, with the model-error floor; None for none.
        samples: parameters (n_theta,) and closed-loop poles (n_pole,) of machines of the
            posterior.
        tuning: whose held-out error the plants have; None for none.
    """
    plant = LoopPlant.of(budget.linearised.model, budget.definition)
    theta = budget.linearised.theta
    open_poles = plant.poles(theta, is_closed=False)
    nominal = plant.margins(theta, open_poles, budget.states.poles())
    drawn = tuple(plant.margins(each, open_poles, poles) for each, poles in samples)
    loops = plant.definition.loops
    held_out = tuple(
        None if tuning is None else held_out_loop_error(tuning, loop) for loop in loops
    )
    robust, at_once = _held_out_tests(plant, theta, nominal, held_out)
    if posterior is not None and posterior.posterior.discrepancy:
        tests = _floor_tests(plant, theta, nominal, posterior.posterior.discrepancy)
        robust = [[*known, test] for known, test in zip(robust, tests, strict=False)]
        at_once.append(tests[-1])
    return BudgetMargins(
        tuple(loop.name for loop in loops),
        nominal,
        drawn,
        tuple(map(tuple, robust)),
        tuple(at_once),
        held_out,
    )


def _lines(band: tuple[float, float], open_poles: Complex, closed_poles: Complex) -> Real:
    """Return lines to begin with, from far below to far above all poles and the band [Hz]."""
    poles = np.concatenate([open_poles, closed_poles])
    sizes = np.abs(poles) / (2 * np.pi)
    sizes = sizes[sizes > _MIN_RELATIVE_POLE * sizes.max(initial=0.0)]
    low = min(band[0], float(sizes.min(initial=band[0]))) / _RANGE
    return first_lines(low, max(band[1], float(sizes.max(initial=0.0))) * _RANGE, poles)


def _held_out_tests(
    plant: LoopPlant,
    theta: Real,
    nominal: AllMargins,
    errors: Sequence[MultiplicativeError | None],
) -> tuple[list[list[RobustTest]], list[RobustTest]]:
    """Return |W T| of each loop, and of all, W the held-out error of each plant."""
    robust: list[list[RobustTest]] = [[] for _ in errors]
    known = {k: error for k, error in enumerate(errors) if error is not None}
    if not known:
        return robust, []
    lines = next(iter(known.values())).freq_hz
    inside = (nominal.freq_hz > lines[0]) & (nominal.freq_hz < lines[-1])
    freq = np.unique(np.concatenate([nominal.freq_hz[inside], lines]))
    closed = np.eye(len(errors)) - sensitivity(plant.gain_at(theta)(freq))
    weighted = np.zeros_like(closed)
    for k, error in known.items():
        weighted[:, k] = np.interp(freq, lines, error.quantile)[:, None] * closed[:, k]
        robust[k].append(_peak(HELD_OUT, freq, np.abs(weighted[:, k, k])))
    is_whole = len(known) == len(errors)
    at_once = [_peak(HELD_OUT, freq, scaled_singular_values(weighted))] if is_whole else []
    return robust, at_once


def _floor_tests(
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
