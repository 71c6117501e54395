"""A model: a machine with its Parts, at the equilibrium and in the variant of each test."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Condition, Integers, Mask, Real
from mbmodel.assembly import Assembly
from mbmodel.machine import Machine
from mbmodel.moving_equilibrium.kept_equilibria import KeptEquilibria
from mbmodel.parts import AddedPart, Change, PartContext, body_parts, joint_parts, spring_parts
from mbmodel.posed_model import PosedModel
from mbmodel.variants.variant_parts import parts_in_variant


@dataclass(frozen=True, eq=False)
class Model(PosedModel):
    """A machine and its Parts, whose equilibrium follows theta and whose tests have variants."""

    def for_test(self, condition: Condition | None) -> "Model":
        """Return the model of a test: that of the machine's variant in which it was made.

        It has the same parameters; without a variant it is the model itself.
        """
        return self.in_variant("" if condition is None else condition.variant)

    def in_variant(self, name: str) -> "Model":
        """Return the model of a variant of the machine, with the same parameters.

        Args:
            name: of the variant; the model itself without one.
        """
        if not name or not self.machine.variants:
            return self
        if name not in self._variants:
            variant = self.machine.variants[name]
            self._variants[name] = Model(
                variant, parts_in_variant(self.machine, variant, self.parts)
            )
        return self._variants[name]

    @cached_property
    def _variants(self) -> dict[str, "Model"]:
        """Models of variants that tests have asked for, by name."""
        return {}

    @cached_property
    def _part_numbers(self) -> Integers:
        """Number of the Part of each parameter; (n_parameter,)."""
        return np.repeat(np.arange(len(self.parts)), [len(part.parameters) for part in self.parts])

    @cached_property
    def _kept_equilibria(self) -> "KeptEquilibria[Model]":
        """Last equilibria, and slopes through them."""
        return KeptEquilibria(self)

    def at_rest(self, theta: Real) -> "Model":
        """Return the model at its static equilibrium; itself if the equilibrium stays.

        Args:
            theta: parameters in SI; (n_parameter,).

        Raises:
            ConvergenceError: the machine has no equilibrium at theta.
        """
        if self.machine.statics is None:
            return self
        return self._kept_equilibria.at_rest(theta)

    def assemble(self, theta: Real, condition: Condition | None = None) -> Assembly:
        """Assemble as the machine of the test, at its equilibrium.

        Args:
            theta [SI] (n_parameter,), condition: as for ``PosedModel.assemble``.

        Raises:
            ConvergenceError: a hung or preloaded machine has no equilibrium at theta.
        """
        posed = self.for_test(condition).at_rest(theta)
        if posed is not self:
            return posed.assemble(theta, condition)
        return super().assemble(theta, condition)

    def without_small_sizes(self, theta: Real) -> Real:
        """Return the parameters without sizes of added Parts that count as nothing.

        Args:
            theta: parameters in SI; (n_parameter,).
        """
        values = zip(self.parts, self.split_parameters(theta), strict=True)
        stated = [
            part.leave_out(value) if isinstance(part, AddedPart) and part.leave_out else value
            for part, value in values
        ]
        return np.concatenate([*stated, np.zeros(0)])

    def slopes(
        self, theta: Real, condition: Condition | None = None, chosen: Mask | None = None
    ) -> list[tuple[Change, ...]]:
        """Return the exact derivatives of every Part's change, in the order of the Parts.

        Args:
            theta: parameters in SI; (n_parameter,).
            chosen: parameters of interest, all if None; (n_parameter,).
        """
        model = self.for_test(condition)
        if model is not self:
            return model.slopes(theta, condition, chosen)
        posed = self.at_rest(theta)
        context = PartContext(posed.machine, condition)
        wanted = np.ones(len(theta), bool) if chosen is None else chosen
        of_parts = self.split_parameters(theta)
        slopes: list[tuple[Change, ...]] = [()] * len(of_parts)
        for number in np.unique(self._part_numbers[wanted]).tolist():
            slopes[number] = posed.parts[number].slopes(of_parts[number], context)
        if self.machine.statics is None:
            return slopes
        added = self._kept_equilibria.slopes(theta, condition, wanted)
        return [(*fixed, *moved) for fixed, moved in zip(slopes, added, strict=True)]


def as_drawn(machine: Machine) -> Model:
    """Return the nominal model ("as drawn"): its Parts are the springs and dampers of the MJCF."""
    return Model(machine, spring_parts(machine))


def machine_model(machine: Machine) -> Model:
    """Return the nominal model with everything of the machine that a fit can vary as Parts.

    Args:
        machine: from a tuned MJCF.
    """
    return Model(machine, (*spring_parts(machine), *body_parts(machine), *joint_parts(machine)))
