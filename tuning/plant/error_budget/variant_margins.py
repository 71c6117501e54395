"""Stability of a budget's loops in variants of the machine: with known masses, in other poses."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, InputError, Real, UsageError
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.control_loops.stability import growing_pole, instability_sentence
from tuning.plant.control_loops.margin_values import AllMargins
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.variant_model import VariantModel


@dataclass(frozen=True, eq=False)
class VariantMargins:
    """Stability of all loops in one variant.

    Args:
        variant: its name, such as ``loaded.xml`` or ``ty_ty = 0.05``.
        pole: that grows fastest [rad/s]; None if the loops are stable.
        unstable_samples: number of machines of the posterior that are unstable.
        samples: number of machines of the posterior.
        margins: None if the loops are unstable.
    """

    variant: str
    pole: complex | None
    unstable_samples: int
    samples: int
    margins: AllMargins | None

    def sentence(self, loops: str) -> str | None:
        """Return that the loops are unstable here; None if they are stable.

        Args:
            loops: their names.
        """
        if self.pole is not None:
            return instability_sentence("the machine", loops, self.variant, self.pole)
        if self.unstable_samples:
            return (
                f"the machine ({self.variant}) with {loops} closed is unstable in "
                f"{self.unstable_samples} of {self.samples} machines of the posterior"
            )
        return None


def variant_margins(
    variants: VariantModel,
    definition: BudgetDefinition,
    posterior: PosteriorOfModel | None = None,
    thetas: Real | None = None,
) -> tuple[VariantMargins, ...]:
    """Compute the stability of a budget's loops in each variant.

    Args:
        variants: of the machine.
        definition: with loops.
        posterior: of the parameters; None for none.
        thetas: machines of the posterior, as its own model has them; (n_sample, n_theta).

    Raises:
        InputError: a variant lacks a port of a loop.
    """
    drawn = np.zeros((0, len(variants.theta)))
    if posterior is not None and thetas is not None:
        drawn = variants.thetas(posterior, thetas)
    return tuple(_margins_of(variants, name, definition, drawn) for name in variants.names)


def _margins_of(
    variants: VariantModel, name: str, definition: BudgetDefinition, drawn: Real
) -> VariantMargins:
    """Return the stability in one variant."""
    plant = LoopPlant.of(variants.model.in_variant(name), definition)
    try:
        poles: Complex = plant.poles(variants.theta, is_closed=True)
    except UsageError as error:
        raise InputError(f"{name}: {error}") from error
    pole = growing_pole(poles)
    unstable = [growing_pole(plant.poles(theta, is_closed=True)) is not None for theta in drawn]
    margins = None
    if pole is None:
        open_poles = plant.poles(variants.theta, is_closed=False)
        margins = plant.margins(variants.theta, open_poles, poles)
    return VariantMargins(name, pole, sum(unstable), len(drawn), margins)
