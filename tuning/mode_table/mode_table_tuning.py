"""Tuning of a model to a table of modes: regularised least squares towards the nominal model.

Stiffness and damping vary by their logarithms under normal priors about the nominal values; masses
and all else stay, unless a prior is stated for them. Stages with a falling tolerated error of the
frequencies find the minimum from afar: a wide one first settles which mode belongs to which row.
A search without these stages runs too, and the better end counts.

At the minimum the posterior covariance of x is (N + 1)^-1 with the normal equations N of the table
(Laplace approximation). The standard deviation of a coordinate over that of its prior, 1, says how
far the table determines it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.readers.mode_table import ModeTable
from identification.words import InputError, Mask, Real, Tolerance
from mbmodel import Machine, Model, as_drawn, body_parts, spring_parts
from tuning.mode_table.mode_table_misfit import (
    MAX_FREQUENCY_RATIO,
    ModeTableMisfit,
    TableMatch,
)
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import (
    UserSpecification,
    match_pattern,
    parametrise,
)
from tuning.solvers.gauss_newton import Box, gauss_newton
from tuning.solvers.nlopt_solver import Minimum

# Standard deviations of the logarithms about the nominal model: stiffness is known to a factor of
# 2 in two of three cases, damping to a factor of 2.7.
STIFFNESS_PRIOR_SD, DAMPING_PRIOR_SD = 0.7, 1.0
DETERMINED_RATIO = 0.5  # posterior over prior: a parameter below is determined by the table
# Tolerated errors of log-frequency, stage after stage. Neither schedule is better on all tables:
# the long one keeps distant rows from pulling first, the direct one holds near rows from the start.
_SCHEDULES = ((0.3, 0.2, 0.14, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01, 0.0), (0.0,))
_MAX_STEP_SIGMA = (
    1.0  # of a coordinate [prior standard deviations]: modes change order within a few
)
_MIN_GAIN_NATS = 1e-14  # of the last stage: rounding ends it, at the same digits on any computer
_ROUGH_GAIN_NATS = 1e-3  # of the stages before
_MAX_STEPS = 200
DEFAULT_MAX_STARTS = 12  # where some row stays beyond its deviation; the station needs ten
_REACHED_SD = 1.0  # of a row's frequency and damping: it is reached within
_HOP_SDS = (0.2, 0.4)  # of a coordinate: random steps away from the best end so far
_HOP_SCHEDULES = ((0.0,), (0.03, 0.0))
AGREEMENT_FACTOR = 1.02  # of the best cost: starts that end below agree


@dataclass(frozen=True, eq=False)
class ModeTableTuning:
    """A model tuned to a table of modes.

    Args:
        model: machine and the Parts that vary.
        table: rows that were fitted.
        parametrisation: coordinates x; the nominal model is x = 0.
        counted: rows that had a mode of the model within reach; (n_row,).
        minimum: best end of all starts, with the evaluations of all.
        costs: of the ends of all starts.
        before: modes of the nominal model, matched with the rows that count.
        after: modes of the tuned model, likewise matched.
        covariance: posterior covariance of x; (n_x, n_x).
        chi_square: mean squared weighted residual of the table.
    """

    model: Model
    table: ModeTable
    parametrisation: Parametrisation
    counted: Mask
    minimum: Minimum
    costs: tuple[float, ...]
    before: TableMatch
    after: TableMatch
    covariance: Real
    chi_square: float

    @property
    def theta(self) -> Real:
        """Parameters of the tuned model [SI]; (n_parameter,)."""
        return self.parametrisation.theta(self.minimum.x)

    @property
    def posterior_ratio(self) -> Real:
        """Posterior over prior standard deviation of each coordinate; (n_x,)."""
        ratio: Real = np.sqrt(np.diag(self.covariance))
        return ratio


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
        machine: nominal machine.
        table: modes to reach.
        priors: patterns of parameters' names with the standard deviation of their prior, of the
            logarithm for sizes, else in SI; 0 fixes; later ones override earlier ones.
        complete_below_hz: frequency below which the table has all modes of the machine; None if
            it may lack some.
        starts: number of starts: the nominal model, then random steps from the best end so far;
            None for as many as it takes until every row is reached, at most
            ``DEFAULT_MAX_STARTS``.
        seed: seed of the random starts.
        begin: values of parameters near a minimum, by name, at which the first start begins instead
            of the nominal model.

    Raises:
        InputError: a row names a body that the machine lacks, no row can be reached, or a pattern
            fits no parameter.
    """
    _check_bodies(machine, table)
    model, parametrisation = parametrise_for_table(machine, priors)
    nominal = np.zeros(parametrisation.size)
    counted = ModeTableMisfit(model, table.modes, parametrisation).rows_in_reach(nominal)
    if not counted.any():
        raise InputError(
            f"{table.source}: no row has a mode of {machine.source.name} within a factor of "
            f"{MAX_FREQUENCY_RATIO:g} in frequency: check that frequencies are in Hz and belong to "
            "this machine"
        )
    floors = dict.fromkeys(floor for schedule in _SCHEDULES for floor in schedule)
    misfits = {
        floor: ModeTableMisfit(
            model,
            table.modes,
            parametrisation,
            floor=floor,
            counted=counted,
            complete_below_hz=complete_below_hz,
        )
        for floor in floors
    }
    first = None if begin is None else _coordinates(parametrisation, begin)
    best, costs = _search_from_starts(misfits, parametrisation, starts, seed, first)
    last = misfits[0.0]
    _, residuals, slopes = last.linearised_residuals(best.x)
    covariance = np.asarray(
        np.linalg.inv(slopes.T @ slopes + np.eye(parametrisation.size)), np.float64
    )
    return ModeTableTuning(
        model,
        table,
        parametrisation,
        counted,
        best,
        costs,
        last.pair_modes(nominal),
        last.pair_modes(best.x),
        covariance,
        float((residuals**2).mean()) if len(residuals) else 0.0,
    )


def _search_from_starts(
    misfits: Mapping[float, ModeTableMisfit],
    parametrisation: Parametrisation,
    starts: int | None,
    seed: int,
    first: Real | None,
) -> tuple[Minimum, tuple[float, ...]]:
    """Return the best end of all starts, with the evaluations of all, and the cost of each end.

    After the nominal model, each start is a random step away from the best end so far (basin
    hopping, Wales and Doye 1997): which mode serves which row makes many minima, and good ones lie
    near each other. An interrupt ends the search, and the best end so far counts.

    Args:
        misfits: misfit by tolerated error.
        parametrisation: coordinates x.
        starts: number of starts; None for as many as it takes to reach every row.
        seed: seed of the random starts.
        first: x of the first start, near a minimum; None for the nominal model.
    """

    def search(start: Real, floors: Sequence[float]) -> Minimum:
        return _search([misfits[floor] for floor in floors], start, parametrisation)

    generator = np.random.default_rng(seed)
    start = np.zeros(parametrisation.size) if first is None else first
    schedules = _SCHEDULES if first is None else _SCHEDULES[-1:]
    ends: list[Minimum] = []
    for number in range(starts or DEFAULT_MAX_STARTS):
        enough = starts is None and ends
        if enough and misfits[0.0].reaches_all_rows(_lowest(ends).x, _REACHED_SD):
            break
        if not number:
            by_schedule = [search(start, floors) for floors in schedules]
            tried = sum(end.evaluations for end in by_schedule)
            best = replace(_lowest(by_schedule), evaluations=tried)
            ends.append(best)
        else:
            step = _HOP_SDS[number % 2] * generator.standard_normal(parametrisation.size)
            ends.append(search(best.x + step, _HOP_SCHEDULES[number // 2 % 2]))
            best = _lowest([best, ends[-1]])
        if ends[-1].outcome == "interrupted":
            best = replace(best, outcome="interrupted", advice=ends[-1].advice)
            break
    evaluations = sum(end.evaluations for end in ends)
    return replace(best, evaluations=evaluations), tuple(end.value for end in ends)


def _coordinates(parametrisation: Parametrisation, values: Mapping[str, float]) -> Real:
    """Return the x of some parameters' values; the others stay nominal."""
    theta = np.array(
        [values.get(parameter.name, parameter.drawn) for parameter in parametrisation.parameters]
    )
    return parametrisation.coordinates(theta)


def _lowest(ends: Sequence[Minimum]) -> Minimum:
    """Return the end with the lowest finite misfit."""
    return min(ends, key=lambda end: end.value if np.isfinite(end.value) else np.inf)


def _search(
    stages: Sequence[ModeTableMisfit], start: Real, parametrisation: Parametrisation
) -> Minimum:
    """Return the end of the last stage, which begins where the one before ended."""
    size = parametrisation.size
    box = Box(
        parametrisation.lower, parametrisation.upper, np.ones(size), np.full(size, _MAX_STEP_SIGMA)
    )
    x, evaluations = start, 0
    for misfit in stages:
        is_last = misfit is stages[-1]
        minimum = gauss_newton(
            misfit,
            x,
            box,
            min_gain_nats=_MIN_GAIN_NATS if is_last else _ROUGH_GAIN_NATS,
            tolerance=0.0,
            max_steps=_MAX_STEPS,
            exact_curvature=True,
        )
        x, evaluations = minimum.x, evaluations + minimum.evaluations
        if minimum.outcome in ("interrupted", "failed"):
            break
    return replace(minimum, value=stages[-1].value(x), evaluations=evaluations)


def _check_bodies(machine: Machine, table: ModeTable) -> None:
    """Refuse a row that names a body which the machine lacks."""
    bodies = machine.layout.bodies
    for mode in table.modes:
        if mode.body and mode.body not in bodies:
            raise InputError(
                f"{table.source}, row {mode.line}: {machine.source.name} has no body "
                f"{mode.body!r}: name one of {', '.join(bodies)}"
            )


def parametrise_for_table(
    machine: Machine, priors: Sequence[tuple[str, float]]
) -> tuple[Model, Parametrisation]:
    """Return the model and the coordinates of the parameters that have a prior.

    Args:
        machine: nominal machine.
        priors: patterns with standard deviations; see ``tune_to_modes``.

    Raises:
        InputError: a pattern fits no parameter, or nothing varies.
    """
    model = Model(machine, (*spring_parts(machine), *body_parts(machine)))
    names = [parameter.name for parameter in model.parameters]
    deviations = {
        parameter.name: STIFFNESS_PRIOR_SD
        if parameter.name.endswith(".stiffness")
        else DAMPING_PRIOR_SD
        for parameter in as_drawn(machine).parameters
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
        model = as_drawn(machine)
    fixed = [parameter.name for parameter in model.parameters if parameter.name not in varied]
    specification = UserSpecification(fix=fixed, prior=varied)
    return model, parametrise(model, Tolerance(), specification).lift_bounds()


_SPRING_PLACES = ("joint:", "tendon:")
