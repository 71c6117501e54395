"""Tuning of a model to a table of modes: regularised least squares towards the nominal model.

Stiffness and damping vary by their logarithms under normal priors about the nominal values; masses
and all else stay, unless a prior is stated for them. Stages with a falling tolerated error of the
frequencies find the minimum from afar: a wide one first settles which mode belongs to which row.
A search without these stages runs too, and the better end counts.

At the minimum the posterior covariance of x is (N + 1)^-1 with the normal equations N of the table
(Laplace approximation): its standard deviations are stated, so that its misfit does not inflate
them. The standard deviation of a coordinate over that of its prior, 1, says how far the table
determines it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.readers.mode_table import ModeTable
from identification.words import InputError, Mask, Real, Tolerance
from mbmodel import Machine, Model, as_drawn, body_parts, spring_parts
from tuning.assessment.parameter_confidence import ParameterConfidence
from tuning.fitting.fitter import MAX_COST_DIFFERENCE, Fit, fit_table
from tuning.misfit.mode_table_misfit import (
    MAX_FREQUENCY_RATIO,
    ModeTableMisfit,
    TableMatch,
    TableStage,
)
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import UserSpecification, match_pattern, parametrise
from tuning.solvers.nlopt_solver import Minimum

# Standard deviations of the logarithms about the nominal model: stiffness is known to a factor of
# 2 in two of three cases, damping to a factor of 2.7.
STIFFNESS_PRIOR_SD, DAMPING_PRIOR_SD = 0.7, 1.0
DETERMINED_RATIO = 0.5  # posterior over prior: a parameter below is determined by the table
# Tolerated errors of log-frequency, stage after stage. Neither schedule is better on all tables:
# the long one keeps distant rows from pulling first, the direct one holds near rows from the start.
_SCHEDULES: tuple[tuple[float, ...], ...] = (
    (0.3, 0.2, 0.14, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01, 0.0),
    (0.0,),
)
_MIN_GAIN_NATS = 1e-14  # of the last stage: rounding ends it, at the same digits on any computer
_ROUGH_GAIN_NATS = 1e-3  # of the stages before
DEFAULT_MAX_STARTS = 12  # where some row stays beyond its deviation; the station needs ten
_REACHED_SD = 1.0  # of a row's frequency and damping: it is reached within
_HOP_SDS = (0.2, 0.4)  # of a coordinate: random steps away from the best end so far
_HOP_SCHEDULES: tuple[tuple[float, ...], ...] = ((0.0,), (0.03, 0.0))
_SPRING_PLACES = ("joint:", "tendon:")


class TableConfidence(ParameterConfidence):
    """Confidence in parameters that a table of modes determines, with the covariance (N + D)^-1."""

    @cached_property
    def covariance(self) -> Real:
        """Covariance of the coordinates; (n_x, n_x)."""
        information = self.normal.dense() + np.diag(self.prior_precision)
        return np.asarray(np.linalg.inv(information), np.float64)

    @cached_property
    def is_undetermined(self) -> Mask:
        """Whether the table leaves at least half of each prior's standard deviation; (n_x,)."""
        return np.asarray(self.deviation >= DETERMINED_RATIO, np.bool_)


@dataclass(frozen=True, eq=False)
class ModeTableTuning:
    """A model tuned to a table of modes.

    Args:
        model: machine and the Parts that vary.
        table: rows that were fitted.
        fit: best end of all starts; the nominal model is x = 0.
        confidence: confidence in the parameters.
        before: modes of the nominal model, matched with the rows that count.
        after: modes of the tuned model, matched with these rows.
    """

    model: Model
    table: ModeTable
    fit: Fit
    confidence: TableConfidence
    before: TableMatch
    after: TableMatch


def tune_to_modes(
    machine: Machine,
    table: ModeTable,
    priors: Sequence[tuple[str, float]] = (),
    *,
    complete_below_hz: float | None = None,
    starts: int | None = None,
    seed: int = 0,
    begin: Mapping[str, float] | None = None,
) -> ModeTableTuning:
    """Tune a machine's stiffness and damping to a table of modes.

    Args:
        table: modes to reach.
        priors: patterns of parameters' names with the standard deviation of their prior, of the
            logarithm for sizes, else in SI; 0 fixes; later ones override earlier ones.
        complete_below_hz: frequency below which the table has all modes of the machine; None if
            it may lack some.
        starts: number of starts: the nominal model, then random steps from the best end so far;
            None for as many as it takes until every row is reached, at most
            ``DEFAULT_MAX_STARTS``.
        begin: values of parameters near a minimum, by name, at which the first start begins instead
            of the nominal model.

    Raises:
        InputError: a row names a body that the machine lacks, no row can be reached, or a pattern
            fits no parameter.
    """
    bodies = machine.layout.bodies
    for mode in table.modes:
        if mode.body and mode.body not in bodies:
            raise InputError(
                f"{table.source}, row {mode.line}: {machine.source.name} has no body "
                f"{mode.body!r}: name one of {', '.join(bodies)}"
            )
    model, varies = parametrise_for_table(machine, priors)
    nominal, every_row = np.zeros(varies.size), TableStage(table.modes)
    counted = ModeTableMisfit(model, varies, every_row).rows_in_reach(nominal)
    if not counted.any():
        raise InputError(
            f"{table.source}: no row has a mode of {machine.source.name} within a factor of "
            f"{MAX_FREQUENCY_RATIO:g} in frequency: check that frequencies are in Hz and belong to "
            "this machine"
        )
    last = TableStage(table.modes, 0.0, counted, complete_below_hz, _MIN_GAIN_NATS)
    fit = _fit_from_starts(model, varies, last, starts, seed, begin)
    misfit = ModeTableMisfit(model, varies, last)
    residuals, normal = misfit.linearised_residuals(fit.x)[1], misfit.quadratic_model(fit.x)[2]
    chi_square = float((residuals**2).mean()) if len(residuals) else 0.0
    return ModeTableTuning(
        model,
        table,
        fit,
        TableConfidence(varies, fit.x, normal, chi_square),
        misfit.match(nominal),
        misfit.match(fit.x),
    )


def _fit_from_starts(
    model: Model,
    varies: Parametrisation,
    last: TableStage,
    starts: int | None,
    seed: int,
    begin: Mapping[str, float] | None,
) -> Fit:
    """Return the best end of all starts.

    After the nominal model, each start is a random step away from the best end so far (basin
    hopping, Wales and Doye 1997): which mode serves which row makes many minima, and good ones lie
    near each other. An interrupt ends the search, and the best end so far counts.

    Args:
        last: last stage of each start.
        starts: number of starts; None for as many as it takes to reach every row.
        begin: values of parameters near a minimum; None to begin at the nominal model.
    """
    generator, misfit = np.random.default_rng(seed), ModeTableMisfit(model, varies, last)

    def run(x: Real, floors: Sequence[float]) -> Minimum:
        rough = (
            replace(last, model_error_floor=floor, min_gain_nats=_ROUGH_GAIN_NATS)
            for floor in floors[:-1]
        )
        return fit_table(model, varies, x, [*rough, last])

    first, schedules = np.zeros(varies.size), _SCHEDULES[0 if begin is None else -1 :]
    if begin is not None:
        values = [begin.get(each.name, each.drawn) for each in varies.parameters]
        first = varies.coordinates(np.array(values))
    ends = [_lowest(tried := [run(first, floors) for floors in schedules])]
    best, evaluations = ends[0], sum(end.evaluations for end in tried)
    for number in range(1, starts or DEFAULT_MAX_STARTS):
        is_enough = starts is None and misfit.reaches_all_rows(best.x, _REACHED_SD)
        if is_enough or ends[-1].outcome == "interrupted":
            break
        step = _HOP_SDS[number % 2] * generator.standard_normal(varies.size)
        end = run(best.x + step, _HOP_SCHEDULES[number // 2 % 2])
        ends.append(replace(end, value=np.inf) if end.outcome == "interrupted" else end)
        best, evaluations = _lowest(ends), evaluations + end.evaluations
    stopped = ends[-1] if ends[-1].outcome == "interrupted" else best
    return Fit(
        varies,
        best.x,
        cost=best.value,
        evaluations=evaluations,
        outcome=stopped.outcome,
        advice=stopped.advice,
        start_costs=tuple(end.value for end in ends),
        agreement_cost=best.value * (1 + MAX_COST_DIFFERENCE),
        start_thetas=np.array([varies.theta(end.x) for end in ends]),
        last_stage=None,
    )


def _lowest(ends: Sequence[Minimum]) -> Minimum:
    """Return the end with the lowest finite misfit."""
    return min(ends, key=lambda end: end.value if np.isfinite(end.value) else np.inf)


def parametrise_for_table(
    machine: Machine, priors: Sequence[tuple[str, float]]
) -> tuple[Model, Parametrisation]:
    """Return the model and the coordinates of the parameters that have a prior.

    Args:
        priors: patterns with standard deviations; see ``tune_to_modes``.

    Raises:
        InputError: a pattern fits no parameter, or nothing varies.
    """
    springs = as_drawn(machine)
    model = Model(machine, (*spring_parts(machine), *body_parts(machine)))
    names = [parameter.name for parameter in model.parameters]
    deviations = {
        each.name: STIFFNESS_PRIOR_SD if each.name.endswith(".stiffness") else DAMPING_PRIOR_SD
        for each in springs.parameters
    }
    for pattern, deviation in priors:
        for index in match_pattern(pattern, names, "--prior"):
            deviations[names[index]] = deviation
    varied = {name: deviation for name, deviation in deviations.items() if deviation > 0}
    if not varied:
        raise InputError(
            f"{machine.source}: no parameter varies: give a joint stiffness or damping, or a prior "
            "above 0"
        )
    if all(model.locations[names.index(name)].startswith(_SPRING_PLACES) for name in varied):
        model = springs
    fixed = [parameter.name for parameter in model.parameters if parameter.name not in varied]
    specification = UserSpecification(fix=fixed, prior=varied)
    return model, parametrise(model, Tolerance(), specification).lift_bounds()
