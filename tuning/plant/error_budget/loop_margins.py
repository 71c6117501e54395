"""Stability margins of control loops: of a machine, its posterior, and its model error.

Stability of a budget's loops in variants of the machine: with known masses, in other poses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, InputError, Real, UsageError, sampling_period
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.control_loops.stability import growing_pole, instability_sentence
from tuning.files.plant_folder import HeldOutResult
from tuning.plant.control_loops.stability_margins import AllMargins
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_plant import LoopPlant
from tuning.plant.error_budget.reference_step import ReferenceStep, reference_steps
from tuning.plant.error_budget.robust_stability import (
    RobustTest,
    floor_deviations,
    floor_tests,
    held_out_tests,
)
from tuning.plant.uncertainty.multiplicative_error import MultiplicativeError, held_out_loop_error
from tuning.plant.variant_model import VariantModel


@dataclass(frozen=True, eq=False)
class PlantMargins:
    """Margins of the loops around a plant.

    Args:
        names: of the loops; n_loop.
        nominal: margins of the machine.
        samples: those of machines of the posterior; empty without one.
        robust: tests of each loop; n_loop.
        robust_at_once: tests of all loops at once.
        held_out: error of the plant of each loop; None where the tuning knows nothing of it.
        steps: response of each loop to a step of its reference; None if it follows none.
        period_s: sampling period of the loops [s]; 0 if they are continuous.
        by_floor: deviations of the margins of each loop by the model-error floor; empty without it.
    """

    names: tuple[str, ...]
    nominal: AllMargins
    samples: tuple[AllMargins, ...]
    robust: tuple[tuple[RobustTest, ...], ...]
    robust_at_once: tuple[RobustTest, ...]
    held_out: tuple[MultiplicativeError | None, ...]
    steps: tuple[ReferenceStep | None, ...]
    period_s: float
    by_floor: tuple[dict[str, float], ...] = ()

    def __repr__(self) -> str:
        """Return the margins of each loop in a line."""
        pairs = zip(self.names, self.nominal.loops, strict=True)
        return "\n".join(f"{name}: {margins!r}" for name, margins in pairs)

    def sentences(self) -> list[str]:
        """Return sentences on loops without gain, and on those that have none at 0 Hz."""
        texts = []
        for name, loop, step in zip(self.names, self.nominal.loops, self.steps, strict=True):
            if not loop.modulus.is_finite:
                texts.append(f"Loop {name} has no gain, so that it has no margins.")
            elif loop.crossover.is_finite and step is None:
                texts.append(
                    f"The gain of loop {name} vanishes at 0 Hz, so that it does not follow a step "
                    "of its reference: overshoot and times are not defined."
                )
        return texts

    def worst_sample(self, loop: int) -> int:
        """Return the number of the sample with the smallest modulus margin of a loop."""
        return int(np.argmin([each.loops[loop].modulus.value for each in self.samples]))


def plant_margins(
    plant: LoopPlant,
    theta: Real,
    posterior: PosteriorOfModel | None = None,
    samples: Sequence[tuple[Real, Complex]] = (),
    tuning: HeldOutResult | None = None,
) -> PlantMargins:
    """Compute the margins of loops that are stable.

    Args:
        theta: its parameters in SI; (n_theta,).
        posterior: of the parameters, with the model-error floor; None for none.
        samples: parameters (n_theta,) and closed-loop poles (n_pole,) of machines of the
            posterior.
        tuning: whose held-out error the plants have; None for none.
    """
    open_poles = plant.poles(theta, is_closed=False)
    nominal = plant.margins(theta, open_poles, plant.poles(theta, is_closed=True))
    drawn = tuple(plant.margins(each, open_poles, poles) for each, poles in samples)
    loops = plant.definition.loops
    held_out = tuple(
        None if tuning is None else held_out_loop_error(tuning, loop) for loop in loops
    )
    robust, at_once = held_out_tests(plant, theta, nominal, held_out)
    by_floor: tuple[dict[str, float], ...] = ()
    if posterior is not None and (discrepancy := posterior.posterior.discrepancy):
        by_floor = floor_deviations(plant, theta, nominal, discrepancy)
        lines = None if tuning is None else tuning.freq_hz[tuning.freq_hz > 0]
        tested = None if lines is None else (float(lines[0]), float(lines[-1]))
        tests = floor_tests(plant, theta, nominal, discrepancy, tested)
        robust = [[*known, test] for known, test in zip(robust, tests, strict=False)]
        at_once.append(tests[-1])
    return PlantMargins(
        tuple(loop.name for loop in loops),
        nominal,
        drawn,
        tuple(map(tuple, robust)),
        tuple(at_once),
        held_out,
        reference_steps(plant, theta, nominal),
        sampling_period(loops),
        by_floor,
    )


@dataclass(frozen=True, eq=False)
class ClosedLoops:
    """Stability of loops, with margins where they are stable.

    Args:
        margins: over the stable machines of the posterior; None if the loops are unstable.
        unstable_samples: number of machines of the posterior that are unstable.
        samples: number of all machines of the posterior.
    """

    margins: PlantMargins | None
    unstable_samples: int
    samples: int


def closed_loops(
    plant: LoopPlant,
    theta: Real,
    posterior: PosteriorOfModel | None = None,
    thetas: Real | None = None,
    tuning: HeldOutResult | None = None,
) -> ClosedLoops:
    """Compute the margins of loops that may be unstable.

    Args:
        theta (n_theta,), posterior, tuning: as for ``plant_margins``.
        thetas: machines of the posterior [SI]; (n_sample, n_theta).
    """
    drawn = [] if thetas is None else [(each, plant.poles(each, is_closed=True)) for each in thetas]
    stable = [(each, poles) for each, poles in drawn if growing_pole(poles) is None]
    margins = None
    if growing_pole(plant.poles(theta, is_closed=True)) is None:
        margins = plant_margins(plant, theta, posterior, stable, tuning)
    return ClosedLoops(margins, len(drawn) - len(stable), len(drawn))


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
