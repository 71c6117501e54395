"""Rows of tuned.json about parameters, and whether they are to be trusted."""

import numpy as np

from identification.words import Real
from tuning.assessment.parameter_confidence import PLAUSIBLE, UNSEEN, pulls
from tuning.campaign_tuning import Tuned
from tuning.files.schema import FitRow, LevelGap, ParameterRow, StartRow
from tuning.fitting.fitter import Fit

# Of a model that the noise alone limits; lines that were held out cost a little more, what the
# parameters have learnt from each value.
_HIGHEST_EXCESS = 1.1
_FEW = 5
_FAR = 1.2  # a factor between two starts that is worth telling


def parameter_rows(tuned: Tuned) -> list[ParameterRow]:
    """One row for each parameter that varied, as the tuned model has it."""
    model, chosen, sure = tuned.session.model, tuned.model_fit, tuned.sure
    varies, free = chosen.freedom, tuned.free
    values, at_bound = chosen.theta, tuned.fit.at_bound
    ends = None if sure is None else (*sure.interval(), sure.parameter_deviation(), sure.unknown)
    asked = tuned.residuals[-1] == "log"  # modes alone say nothing of tolerances
    rows = []
    for k, (parameter, location) in enumerate(zip(model.parameters, model.locations, strict=True)):
        if not varies.free[k]:
            continue
        has_prior = bool(varies.has_prior[varies.member[k]])
        rows.append(
            ParameterRow(
                name=parameter.name,
                location=location,
                unit=parameter.unit,
                drawn=parameter.drawn,
                tuned=float(values[k]),
                at_bound=bool(at_bound[k]),
                low=None if ends is None else _finite(ends[0][k]),
                high=None if ends is None else _finite(ends[1][k]),
                deviation=None if ends is None else float(ends[2][k]),
                prior=float(varies.scale[k]) if has_prior else None,
                pull=float(free.x[free.freedom.member[k]]) if has_prior and asked else None,
                seen=ends is None or not ends[3][k],
            )
        )
    return rows


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def fit_row(tuned: Tuned, gap: LevelGap) -> FitRow:
    """How the search went, and what speaks against its result."""
    found = tuned.fit
    doubts = _doubts(tuned, gap)
    return FitRow(
        outcome=found.outcome,
        converged=found.converged,
        trusted=found.converged and not doubts,
        doubts=doubts,
        advice=found.advice,
        algorithm=tuned.algorithm,
        evaluations=found.evaluations,
        cost=found.cost if np.isfinite(found.cost) else None,
        chi_square=None if tuned.sure is None else tuned.sure.chi_square,
        starts=len(found.costs),
        agreeing_starts=found.agree,
        ends=_starts(found) if len(found.costs) > 1 else [],
    )


def _doubts(tuned: Tuned, gap: LevelGap) -> list[str]:
    """Sentences, none if the result is to be trusted."""
    found, free = tuned.fit, tuned.free
    doubts = []
    if tuned.interrupted:
        doubts.append("it was interrupted")
    excess = (gap.held_out or gap.tuned).excess
    values = len(tuned.session.campaign.freq_hz) * gap.channels
    highest = _HIGHEST_EXCESS * np.sqrt(1 + 2 * found.freedom.size / max(values, 1))
    if excess is not None and excess > highest:
        doubts.append(f"the model misses {excess:.3g} times the noise: something is not modelled")
    strongest = pulls(free.freedom, free.x)[:_FEW]
    far = [f"{name} by {abs(x):.1f}" for name, x in strongest if abs(x) > PLAUSIBLE]
    if far:
        doubts.append(f"tolerances are pulled by many standard deviations: {', '.join(far)}")
    loose = found.freedom.reached(found.x) & found.freedom.is_stated
    if tuned.sure is not None:  # what the data do not tell may lie anywhere, and is said elsewhere
        loose &= tuned.sure.deviation <= UNSEEN
    if loose.any():
        names = [found.freedom.names[k] for k in np.flatnonzero(loose)]
        doubts.append(f"at a bound: {', '.join(names[:_FEW])}")
    if len(found.costs) > 1 and found.agree == 1:
        doubts.append(f"only one of {len(found.costs)} starts ended there")
    return doubts


def _starts(found: Fit) -> list[StartRow]:
    best = int(np.argmin(found.costs))
    names = np.array([one.name for one in found.freedom.parameters])
    varies = found.freedom
    sizes = np.array([one.positive for one in varies.parameters], bool)
    open_ones = sizes & varies.free & ~np.append(varies.has_prior, True)[varies.member]
    rows = []
    for cost, theta in zip(found.costs, found.ends, strict=True):
        factor: Real = theta[open_ones] / found.ends[best][open_ones]
        order = np.argsort(-np.abs(np.log(factor)))[:_FEW]
        rows.append(
            StartRow(
                cost=cost if np.isfinite(cost) else None,
                agrees=bool(cost <= found.agreed),
                farthest={
                    str(names[open_ones][k]): float(factor[k])
                    for k in order
                    if not 1 / _FAR < factor[k] < _FAR
                },
            )
        )
    return rows
