"""FRFs of a budget for a Bode plot, with bands: errors per source, and plants of loops."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from mbmodel import Evaluator, FrfRequest, Model
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.plant.error_budget.budget import ErrorBudget
from tuning.plant.error_budget.closed_loop_states import LoopAliases
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_algebra import close_loops, map_ports

_CURVE_LINES = 400  # evenly spaced in the logarithm of frequency
# Distances from a resonance in half widths, at which there are further lines.
_LINES_NEAR_RESONANCES = np.array([-4.0, -2.0, -1.0, -0.4, 0.0, 0.4, 1.0, 2.0, 4.0])


@dataclass(frozen=True, eq=False)
class CurvePort:
    """Names of one FRF of a budget.

    Args:
        label: such as ``top / floor``.
        unit: such as ``m per m/s^2``.
    """

    label: str
    unit: str


@dataclass(frozen=True, eq=False)
class PlantCurves:
    """FRFs of the machine, before it was tuned, and their bands.

    Args:
        ports: names; n_curve.
        freq_hz: [Hz]; (n_freq,).
        values: FRFs; (n_freq, n_curve).
        before: those of another machine, such as the nominal one; None without it.
        magnitude: standard deviation of the logarithm of the magnitude; None without a posterior;
            (n_freq, n_curve).
        phase: standard deviation of the phase [rad]; None without a posterior; (n_freq, n_curve).
    """

    ports: tuple[CurvePort, ...]
    freq_hz: Real
    values: Complex
    before: Complex | None
    magnitude: Real | None
    phase: Real | None


def plant_curves(
    budget: ErrorBudget,
    before: ErrorBudget | None,
    posterior: PosteriorOfModel | None,
    thetas: Real | None,
) -> PlantCurves:
    """Compute the FRFs of a budget.

    Args:
        before: of the machine before it was tuned; None for none.
        posterior: of the parameters; None for no bands.
        thetas: samples of the posterior; (n_sample, n_theta).
    """
    definition = budget.definition
    poles = [budget.states.poles(), *([before.states.poles()] if before else [])]
    freq = _curve_lines(definition.band, np.concatenate(poles))
    model = budget.linearised.model
    values = _responses(model, budget.linearised.theta, definition, freq)
    counterpart = None
    if before is not None:
        counterpart = _responses(before.linearised.model, before.linearised.theta, definition, freq)
    magnitude = phase = None
    if posterior is not None and thetas is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = np.array(
                [_responses(model, theta, definition, freq) / values for theta in thetas]
            )
            logs = np.log(ratios)
        error = posterior.posterior.discrepancy / np.sqrt(2)
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = error * _discrepancy(model, budget, freq) / np.abs(values)
        floor = np.nan_to_num(floor)
        magnitude = np.hypot(np.nan_to_num(logs.real).std(axis=0), floor)
        phase = np.hypot(np.nan_to_num(logs.imag).std(axis=0), floor)
    return PlantCurves(_curve_ports(definition), freq, values, counterpart, magnitude, phase)


def _curve_lines(band: tuple[float, float], poles: Complex) -> Real:
    """Return lines of a plot that shows every resonance; (n_freq,)."""
    oscillating = poles[poles.imag > 0]
    natural, decay = oscillating.imag / (2 * np.pi), np.abs(oscillating.real) / (2 * np.pi)
    near = (natural[:, None] + decay[:, None] * _LINES_NEAR_RESONANCES).ravel()
    near = near[(near > band[0]) & (near < band[1])]
    return np.unique(np.append(np.geomspace(*band, _CURVE_LINES), near))


def _responses(model: Model, theta: Real, definition: BudgetDefinition, freq: Real) -> Complex:
    """Return errors per source with loops closed, then plants with loops open."""
    ports = map_ports(definition)
    request = FrfRequest(freq, ports.outputs, ports.inputs, "receptance")
    frfs = Evaluator(model, request).at(theta).values
    aliases = LoopAliases.of(model, theta, definition, ports).at(request.laplace)
    errors = close_loops(definition, ports, frfs, request.laplace, aliases).errors
    plants = np.einsum("lo,foi,il->fl", ports.measured, frfs, ports.controls, optimize=True)
    derivatives = np.array([loop.measured.derivative for loop in definition.loops], int)
    plants = plants * request.laplace[:, None] ** derivatives
    return np.hstack([errors.reshape(len(freq), -1), plants])


def _discrepancy(model: Model, budget: ErrorBudget, freq: Real) -> Real:
    """Return the deviation of each column of ``_responses`` per unit of the discrepancy."""
    definition = budget.definition
    ports = map_ports(definition)
    request = FrfRequest(freq, ports.outputs, ports.inputs, "receptance")
    lines = Evaluator(model, request).at(budget.linearised.theta)
    aliases = LoopAliases.of(model, lines.theta, definition, ports).at(request.laplace)
    response = close_loops(definition, ports, lines.values, request.laplace, aliases)
    errors = discrepancy_motion(lines, response.left, response.right)
    count = (len(freq), 1, 1)
    plants = discrepancy_motion(
        lines, np.tile(ports.measured, count), np.tile(ports.controls, count)
    )
    derivatives = np.array([loop.measured.derivative for loop in definition.loops], int)
    open_loop = np.einsum("fll->fl", plants) * np.abs(request.laplace[:, None]) ** derivatives
    return np.hstack([errors.reshape(len(freq), -1), open_loop])


def _curve_ports(definition: BudgetDefinition) -> tuple[CurvePort, ...]:
    """Return the names of the columns of ``_responses``."""
    rows = [
        CurvePort(f"{error.name} / {source.name}", f"{error.unit} per {source.unit}")
        for error in definition.errors
        for source in definition.sources
    ]
    rows += [
        CurvePort(
            f"plant of {loop.name}: {loop.measured} / {loop.input}",
            f"{loop.measured.unit} per {loop.input_unit}",
        )
        for loop in definition.loops
    ]
    return tuple(rows)
