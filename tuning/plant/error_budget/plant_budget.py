r"""The budget of a machine beside that of another one, with its interval and what to touch.

Interval of the rms errors, from the covariance of the fit, by one adjoint solve an error.

A mean square J = sum_f E S E^H changes with the FRFs by dJ = 2 Re sum L dH R S E^H, with L and R of
``loop_algebra``: its cotangent is conj(L' (R S E^H)'). The adjoint method turns it into the
derivatives of J by all parameters. To first order log rms = log(J) / 2 has the variance g' P g, g
its gradient and P the covariance.

The discrepancy of the model is a relative error e of its forces (``model_discrepancy``), with an
error dE of unknown phase at each line. If that had one sign over all lines that matter, log rms
would have the deviation e / sqrt(2) sum_f S |E| sd(dE) / J, which is added to the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, InputError, Real, capitalise
from mbmodel import Model
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.control_loops.stability import growing_pole
from tuning.plant.control_loops.stability_margins import AllMargins
from tuning.plant.error_budget.budget import ErrorBudget, error_budget
from tuning.plant.error_budget.budget_remarks import budget_sentences
from tuning.plant.error_budget.closed_loop_states import loop_states, refuse_unstable
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_margins import (
    PlantMargins,
    VariantMargins,
    plant_margins,
    variant_margins,
)
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.machine_files import FittedMachine, open_loops
from tuning.plant.error_budget.plant_curves import PlantCurves, plant_curves
from tuning.plant.error_budget.source_spectra import image_sentences
from tuning.plant.variant_model import VariantModel


@dataclass(frozen=True, eq=False)
class RmsInterval:
    """Interval of each error.

    Args:
        rms: of the fitted model [m or rad]; (n_error,).
        by_parameters: standard deviation of the logarithm of the rms by the parameters;
            (n_error,).
        by_model_error: by the discrepancy of the model; (n_error,).
    """

    rms: Real
    by_parameters: Real
    by_model_error: Real

    @property
    def deviation(self) -> Real:
        """Standard deviation of the logarithm of the rms; (n_error,)."""
        return np.hypot(self.by_parameters, self.by_model_error)

    def ends(self) -> tuple[Real, Real]:
        """Return both ends of the 95 % interval [m or rad]; (n_error,) each."""
        spread = np.exp(NORMAL_QUANTILE_95 * self.deviation)
        return self.rms / spread, self.rms * spread


def log_rms_gradient(budget: ErrorBudget) -> Real:
    """Return the derivative of log rms by every parameter in SI; (n_error, n_parameter)."""
    response = budget.response
    correlated = (budget.scaled @ budget.definition.coherence).conj()
    rows = []
    for error, mean_square in enumerate(budget.rms**2):
        drive = (response.right @ (budget.weights * correlated[:, error])[:, :, None])[:, :, 0]
        cotangent = (response.left[:, error, :, None] * drive[:, None, :]).conj()
        gradient = budget.linearised.gradient(cotangent)
        rows.append(gradient / mean_square if mean_square else 0 * gradient)
    return np.array(rows)


def rms_interval(budget: ErrorBudget, posterior: PosteriorOfModel) -> RmsInterval:
    """Return the interval of each error.

    Args:
        budget: of the posterior's model at its nominal values.
        posterior: of the parameters.
    """
    by_parameter = (log_rms_gradient(budget) * posterior.rates)[:, posterior.varies]
    by_coordinate = by_parameter @ posterior.membership
    covariance = posterior.posterior.covariance
    variance = np.einsum("zi,ij,zj->z", by_coordinate, covariance, by_coordinate)
    return RmsInterval(
        budget.rms,
        np.sqrt(np.maximum(variance, 0.0)),
        posterior.posterior.discrepancy * _discrepancy_slope(budget),
    )


def _discrepancy_slope(budget: ErrorBudget) -> Real:
    """Return the deviation of log rms per unit of e; (n_error,)."""
    response = budget.response
    deviation = discrepancy_motion(budget.linearised, response.left, response.right)
    shift = np.einsum("fes,fes,fs->e", np.abs(budget.scaled), deviation, budget.weights)
    mean_square = np.where(budget.rms > 0, budget.rms, 1.0) ** 2
    return np.asarray(shift / mean_square / np.sqrt(2))


def stable_poles_of_samples(budget: ErrorBudget, thetas: Real) -> list[Complex]:
    """Return the closed-loop poles of machines of the posterior [rad/s]; (n_pole,) each.

    Args:
        thetas: parameters of each machine [SI]; (n_sample, n_theta).

    Raises:
        InputError: a machine is unstable with the loops; the worst pole is named.
    """
    definition, model = budget.definition, budget.linearised.model
    poles = [loop_states(model, theta, definition, budget.ports).poles() for theta in thetas]
    growing = [each for each in poles if growing_pole(each) is not None]
    if growing:
        worst = max(growing, key=lambda each: float(each.real.max()))
        refuse_unstable(worst, definition.loops, samples=(len(growing), len(poles)))
    return poles


STEP_OF_A_TOUCH = 0.1  # relative change of a stiffness or damping whose effect is stated


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
        fitted: the machine, its loops opened.
        before: of another machine, such as the nominal one; None for none.
        before_failure: why the counterpart has no budget; empty if it has one.
        interval: of the rms errors; None without a posterior.
        sample_poles: closed-loop poles of each machine of the posterior [rad/s]; n_sample.
        variants: machines of tests with models or poses of their own; None for none.
    """

    budget: ErrorBudget
    fitted: FittedMachine
    before: ErrorBudget | None = None
    before_failure: str = ""
    interval: RmsInterval | None = None
    sample_poles: Sequence[Complex] = ()
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
        fitted, lines = self.fitted, self.budget.linearised
        thetas = () if fitted.thetas is None else fitted.thetas
        samples = list(zip(thetas, self.sample_poles, strict=True))
        plant = LoopPlant.of(lines.model, self.budget.definition)
        return plant_margins(plant, lines.theta, fitted.posterior, samples, fitted.held_out)

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
        fitted = self.fitted
        return variant_margins(self.variants, definition, fitted.posterior, fitted.thetas)

    def curves(self) -> PlantCurves:
        """Return the FRFs of the budget with their bands."""
        return plant_curves(self.budget, self.before, self.fitted.posterior, self.fitted.thetas)

    def sentences(self) -> list[str]:
        """Return what the budget leaves out or rests on, such as images of sampled loops."""
        definition = self.budget.definition
        loops = ", ".join(loop.name for loop in definition.loops)
        unstable = [each.sentence(loops) for each in self.variant_margins]
        return [
            *definition.remarks,
            *budget_sentences(self.budget),
            *image_sentences(self.budget),
            *([] if self.margins is None else self.margins.sentences()),
            *(f"{capitalise(text)}." for text in unstable if text),
        ]


def plant_budget(
    fitted: FittedMachine,
    definition: BudgetDefinition,
    before: Model | None = None,
    variants: VariantModel | None = None,
) -> PlantBudget:
    """Compute the budget of a machine at its nominal values.

    The definition holds all loops that are closed: those of the machine itself are opened.

    Args:
        fitted: the machine.
        before: another machine with the same labels; None for none.
        variants: machines of tests with models or poses of their own; None for none.

    Raises:
        InputError: the machine, or some machine of the posterior, is unstable with the loops.
    """
    fitted = fitted.open_loops()
    budget = error_budget(fitted.model, fitted.model.drawn, definition)
    counterpart, failure = None, ""
    if before is not None:
        try:
            counterpart = error_budget(open_loops(before), before.drawn, definition)
        except InputError as error:
            failure = str(error)
    interval, poles = None, []
    if fitted.posterior is not None and fitted.thetas is not None:
        interval = rms_interval(budget, fitted.posterior)
        poles = stable_poles_of_samples(budget, fitted.thetas)
    return PlantBudget(budget, fitted, counterpart, failure, interval, poles, variants)
