"""The budget of a machine beside that of another one, with its interval and what to touch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.words import Complex, InputError, Real
from mbmodel import Model, with_loops
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.files.plant_folder import HeldOutResult
from tuning.plant.control_loops.margin_values import AllMargins
from tuning.plant.error_budget.budget import ErrorBudget, error_budget
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_margins import PlantMargins, plant_margins
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.plant_curves import PlantCurves, plant_curves
from tuning.plant.error_budget.rms_interval import (
    RmsInterval,
    log_rms_gradient,
    rms_interval,
    stable_poles_of_samples,
)
from tuning.plant.error_budget.variant_margins import VariantMargins, variant_margins
from tuning.plant.variant_model import VariantModel

STEP_OF_A_TOUCH = 0.1  # relative change of a stiffness or damping whose effect is stated
POSTERIOR_MACHINES = 60  # for bands and stability: a deviation is right to 9 %
MACHINE_SEED = 1


@dataclass(frozen=True)
class Touch:
    """Effect of one spring or damper on an error.

    Args:
        parameter: such as ``tilt_ry.stiffness``.
        change: of the rms for 10 % more of it [m or rad].
    """

    parameter: str
    change: float


@dataclass(frozen=True, eq=False)
class PlantBudget:
    """Budget of a machine, and what stands beside it.

    Args:
        budget: of the machine.
        before: of another machine, such as the nominal one; None for none.
        before_failure: why the counterpart has no budget; empty if it has one.
        interval: of the rms errors; None without a posterior.
        posterior: of the parameters; None for none.
        thetas: samples of the posterior; None for none.
        sample_poles: closed-loop poles of each sample [rad/s]; n_sample.
        tuning: whose held-out error the plants of the loops have; None if not known.
        variants: machines of tests with models or poses of their own; None for none.
    """

    budget: ErrorBudget
    before: ErrorBudget | None = None
    before_failure: str = ""
    interval: RmsInterval | None = None
    posterior: PosteriorOfModel | None = None
    thetas: Real | None = None
    sample_poles: Sequence[Complex] = ()
    tuning: HeldOutResult | None = None
    variants: VariantModel | None = None

    @cached_property
    def touches(self) -> tuple[tuple[Touch, ...], ...]:
        """For each error the springs and dampers, the strongest first."""
        model = self.budget.linearised.model
        slopes = log_rms_gradient(self.budget) * model.drawn
        changes = self.budget.rms[:, None] * ((1 + STEP_OF_A_TOUCH) ** slopes - 1)
        names = [parameter.name for parameter in model.parameters]
        rows = []
        for values in changes:
            order = np.argsort(-np.abs(values), kind="stable")
            rows.append(
                tuple(
                    Touch(names[k], float(values[k]))
                    for k in order
                    if names[k].endswith((".stiffness", ".damping")) and values[k]
                )
            )
        return tuple(rows)

    @cached_property
    def margins(self) -> PlantMargins | None:
        """Stability margins of the loops; None without any."""
        if not self.budget.definition.loops:
            return None
        thetas = () if self.thetas is None else self.thetas
        samples = list(zip(thetas, self.sample_poles, strict=True))
        lines = self.budget.linearised
        plant = LoopPlant.of(lines.model, self.budget.definition)
        return plant_margins(plant, lines.theta, self.posterior, samples, self.tuning)

    @cached_property
    def margins_before(self) -> AllMargins | None:
        """Stability margins of the other machine; None without one, or without loops."""
        if self.before is None or not self.budget.definition.loops:
            return None
        lines = self.before.linearised
        plant = LoopPlant.of(lines.model, self.before.definition)
        poles = self.before.states.poles()
        return plant.margins(lines.theta, plant.poles(lines.theta, is_closed=False), poles)

    @cached_property
    def variant_margins(self) -> tuple[VariantMargins, ...]:
        """Stability of the loops in each variant of the machine; empty without any."""
        definition = self.budget.definition
        if self.variants is None or not definition.loops:
            return ()
        return variant_margins(self.variants, definition, self.posterior, self.thetas)

    def curves(self) -> PlantCurves:
        """Return the FRFs of the budget with their bands."""
        return plant_curves(self.budget, self.before, self.posterior, self.thetas)


def open_loops(model: Model) -> Model:
    """Return a model without the loops that are closed around its machine."""
    return replace(model, machine=with_loops(model.machine, ())) if model.loops else model


def plant_budget(
    model: Model,
    definition: BudgetDefinition,
    before: Model | None = None,
    posterior: PosteriorOfModel | None = None,
) -> PlantBudget:
    """Compute the budget of a machine at its nominal values.

    The definition holds all loops that are closed: those of the machine itself are opened.

    Args:
        model: of the machine; that of the posterior if there is one.
        definition: errors, sources and loops.
        before: another machine with the same labels; None for none.
        posterior: of the parameters; None for no intervals.

    Raises:
        InputError: the machine, or some machine of the posterior, is unstable with the loops.
    """
    model = open_loops(model)
    if posterior is not None:
        posterior = replace(posterior, model=open_loops(posterior.model))
    budget = error_budget(model, model.drawn, definition)
    counterpart, failure = None, ""
    if before is not None:
        try:
            counterpart = error_budget(open_loops(before), before.drawn, definition)
        except InputError as error:
            failure = str(error)
    if posterior is None:
        return PlantBudget(budget, counterpart, failure)
    thetas = posterior.sample(POSTERIOR_MACHINES, MACHINE_SEED)
    return PlantBudget(
        budget,
        counterpart,
        failure,
        rms_interval(budget, posterior),
        posterior,
        thetas,
        stable_poles_of_samples(budget, thetas),
    )
