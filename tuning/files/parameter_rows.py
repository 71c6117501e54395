"""Rows of tuned.json about parameters, unknown gains and fit, and reasons not to trust them."""

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.words import NominalGain, Real
from mbmodel import Model
from tuning.assessment.gap import Gap, is_gap_visible
from tuning.assessment.parameter_confidence import ParameterConfidence, rank_pulls
from tuning.campaign_tuning import CampaignTuning
from tuning.checks.export_faults import name_exchanged_channels
from tuning.control_loops.stability import tuned_loop_remarks
from tuning.files.schema import ChannelGainRow, FitRow, LevelGap, ParameterRow, StartRow
from tuning.fitting.fitter import Fit
from tuning.fitting.machine_fit import PLAUSIBLE_PULL_SIGMA
from tuning.misfit.batch import predict
from tuning.parametrisation.parametrisation import Parametrisation

_MAX_NAMES_IN_SENTENCE = 5  # in one sentence or row
# Part of the mean square of the gap that pulled tolerances may leave if they explain it: a tenth of
# the error. With a sensor reversed or exchanged, others were pulled and left 4 to 16 %.
_MAX_LEFT_GAP = 0.01
_MIN_START_FACTOR = 1.2  # between parameters of two starts, to be reported


def parameter_rows(
    model: Model,
    model_fit: Fit,
    confidence: ParameterConfidence | None,
    *,
    bounded: Fit,
    unbounded: Fit | None,
) -> list[ParameterRow]:
    """Return one row for each parameter that varied, with its value in the tuned model.

    Args:
        model_fit: fit whose parameters are reported.
        confidence: confidence in the parameters; None if interrupted before.
        bounded: fit with tolerances within their bounds.
        unbounded: fit that shows the pulls of tolerances; None if none does.
    """
    parametrisation = model_fit.parametrisation
    values, at_bound = model_fit.theta, bounded.at_bound
    ends = (
        None
        if confidence is None
        else (*confidence.interval(), confidence.parameter_deviation(), confidence.unidentifiable)
    )
    rows = []
    for k, (parameter, location) in enumerate(zip(model.parameters, model.locations, strict=True)):
        if not parametrisation.free[k]:
            continue
        is_tolerance = bool(parametrisation.is_tolerance[parametrisation.coordinate_of[k]])
        rows.append(
            ParameterRow(
                name=parameter.name,
                location=location,
                unit=parameter.unit,
                drawn=parameter.drawn,
                tuned=float(values[k]),
                at_bound=bool(at_bound[k]),
                low=None if ends is None else finite_or_none(ends[0][k]),
                high=None if ends is None else finite_or_none(ends[1][k]),
                deviation=None if ends is None else float(ends[2][k]),
                prior=float(parametrisation.scale[k]) if is_tolerance else None,
                pull=float(unbounded.x[unbounded.parametrisation.coordinate_of[k]])
                if is_tolerance and unbounded is not None
                else None,
                seen=ends is None or not ends[3][k],
            )
        )
    return rows


def finite_or_none(value: float) -> float | None:
    """Return a finite value, or None."""
    return float(value) if np.isfinite(value) else None


def fit_row(tuned: CampaignTuning, gap: LevelGap) -> FitRow:
    """Return how the search ended, and the reasons not to trust its result.

    Args:
        gap: gap at the place where FRFs counted.
    """
    fit = tuned.fit
    doubts = _doubts(tuned, gap)
    return FitRow(
        **search_fields(fit, tuned.confidence),
        trusted=fit.converged and not doubts,
        doubts=doubts,
        algorithm=tuned.algorithm,
        ends=_starts(fit) if len(fit.start_costs) > 1 else [],
    )


def search_fields(fit: Fit, confidence: ParameterConfidence | None) -> dict[str, Any]:
    """Return the fields of ``FitRow`` that say how a search ended."""
    return {
        "outcome": fit.outcome,
        "converged": fit.converged,
        "advice": fit.advice,
        "evaluations": fit.evaluations,
        "cost": finite_or_none(fit.cost),
        "chi_square": None if confidence is None else confidence.chi_square,
        "starts": len(fit.start_costs),
        "agreeing_starts": fit.agreeing_starts,
    }


def _doubts(tuned: CampaignTuning, gap: LevelGap) -> list[str]:
    """Return reasons not to trust the result, one sentence each; none if it is to be trusted."""
    fit = tuned.fit
    doubts = []
    if tuned.interrupted:
        doubts.append("it was interrupted")
    campaign_folder = tuned.session.source.parent
    excess = (gap.held_out or gap.tuned).excess
    values = len(tuned.session.campaign.freq_hz) * gap.channels
    # A model that lacks nothing exceeds 1 on held-out lines by what its parameters took there.
    taken = 1 + 2 * fit.parametrisation.size / max(values, 1)
    if excess is not None and is_gap_visible(excess**2 / taken - 1):
        doubts.append(
            f"something may be missing: run mbw diagnose {shlex.quote(str(campaign_folder))}"
        )
    doubts += _pull_doubts(tuned)
    is_at_bound = (
        fit.parametrisation.coordinates_at_bound(fit.x) & fit.parametrisation.has_user_bounds
    )
    if (
        tuned.confidence is not None
    ):  # unidentifiable parameters may lie anywhere; they are reported elsewhere
        is_at_bound &= ~tuned.confidence.is_undetermined
    if is_at_bound.any():
        names = [fit.parametrisation.names[k] for k in np.flatnonzero(is_at_bound)]
        doubts.append(f"at a bound: {', '.join(names[:_MAX_NAMES_IN_SENTENCE])}")
    if len(fit.start_costs) > 1 and fit.agreeing_starts == 1:
        doubts.append(f"only one of {len(fit.start_costs)} starts ended at this minimum")
    return doubts + tuned_loop_remarks(tuned.session.model, tuned.model_fit.theta)


def _pull_doubts(tuned: CampaignTuning) -> list[str]:
    """Return a sentence on tolerances that are pulled beyond what is plausible; none without any.

    What explains the data is named: exchanged channels of a sensor, or the tolerances, if the fit
    without their bounds leaves next to nothing. Many tolerances make up for much of any fault.
    """
    fit, unbounded = tuned.fit, tuned.unbounded_fit
    strongest = rank_pulls(unbounded.parametrisation, unbounded.x)[:_MAX_NAMES_IN_SENTENCE]
    implausible = [
        f"{name} by {abs(x):.1f}" for name, x in strongest if abs(x) > PLAUSIBLE_PULL_SIGMA
    ]
    if not implausible:
        return []
    sensors = tuned.sensors
    if exchanged := name_exchanged_channels(sensors.bounded, sensors.campaign):
        return [exchanged]
    gap = sensors.gap(sensors.bounded)
    left = sensors.gap(predict(tuned.session.model, unbounded.theta, sensors.campaign))
    is_left = left.excess is None or is_gap_visible(_gap_size(left))
    if fit is not unbounded and is_left and _gap_size(left) > _MAX_LEFT_GAP * _gap_size(gap):
        return [
            "tolerances have implausible pulls, but a gap remains with them too: they rather make "
            "up for another fault"
        ]
    return [f"tolerances have implausible pulls [standard deviations]: {', '.join(implausible)}"]


def _gap_size(gap: Gap) -> float:
    """Return the mean square of a gap beyond the noise, or of the error where no noise is known."""
    return (gap.error or 0.0) ** 2 if gap.excess is None else gap.excess**2 - 1


def _starts(fit: Fit) -> list[StartRow]:
    """Return where each start ended, and its parameters that lie farthest from the best start."""
    best = int(np.argmin(fit.start_costs))
    names = np.array([parameter.name for parameter in fit.parametrisation.parameters])
    parametrisation = fit.parametrisation
    sizes = np.array([parameter.positive for parameter in parametrisation.parameters], bool)
    free_sizes = (
        sizes
        & parametrisation.free
        & ~np.append(parametrisation.is_tolerance, True)[parametrisation.coordinate_of]
    )
    rows = []
    for cost, theta in zip(fit.start_costs, fit.start_thetas, strict=True):
        factor: Real = theta[free_sizes] / fit.start_thetas[best][free_sizes]
        order = np.argsort(-np.abs(np.log(factor)))[:_MAX_NAMES_IN_SENTENCE]
        rows.append(
            StartRow(
                cost=cost if np.isfinite(cost) else None,
                agrees=bool(cost <= fit.agreement_cost),
                farthest={
                    str(names[free_sizes][k]): float(factor[k])
                    for k in order
                    if not 1 / _MIN_START_FACTOR < factor[k] < _MIN_START_FACTOR
                },
            )
        )
    return rows


def channel_gain_rows(
    nominal: Sequence[NominalGain],
    parametrisation: Parametrisation,
    theta: Real,
    interval: tuple[Real, Real] | None,
) -> list[ChannelGainRow]:
    """Return one row for each gain: its nominal value times the fitted factor.

    Args:
        nominal: gains by which the FRFs were divided.
        parametrisation: parametrisation of the fit.
        theta: fitted parameters [SI]; (n_parameter,).
        interval: both ends of their 95 % intervals; None if unknown.
    """
    index = {parameter.name: k for k, parameter in enumerate(parametrisation.parameters)}
    rows = []
    for gain in nominal:
        k, late = index[gain.parameter], index.get(gain.delay_parameter)
        ends = None
        if interval is not None and parametrisation.free[k]:
            low, high = sorted(gain.value * float(end[k]) for end in interval)
            ends = low, high
        rows.append(
            ChannelGainRow(
                location=gain.location,
                dof=gain.direction,
                gain=gain.value * float(theta[k]),
                interval=ends,
                is_product=gain.is_product,
                delay=None if late is None else gain.delay_s + float(theta[late]),
            )
        )
    return rows
