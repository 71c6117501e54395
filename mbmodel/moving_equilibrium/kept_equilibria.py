"""The last equilibria of a model and the slopes through them, which tests of one fit share."""

from typing import Generic

import numpy as np

from identification.words import Condition, Mask, Real
from mbmodel.moving_equilibrium.posed_machine import (
    ModelT,
    is_static,
    model_at_rest,
    static_parameters,
)
from mbmodel.moving_equilibrium.slopes import equilibrium_slopes
from mbmodel.parts import Change

_N_KEPT = 4  # a fit returns to the point before the last step, and to the nominal values


class KeptEquilibria(Generic[ModelT]):
    """Models at rest and slopes through the equilibrium, the last ones of each.

    Args:
        model: whose machine has its statics.
    """

    def __init__(self, model: ModelT) -> None:
        self._model = model
        self._rests: dict[bytes, ModelT] = {}
        self._slopes: dict[tuple[bytes, bytes, tuple[float, ...]], list[tuple[Change, ...]]] = {}

    def at_rest(self, theta: Real) -> ModelT:
        """Return the model at its static equilibrium; itself at the nominal values.

        Args:
            theta: parameters in SI; (n_parameter,).

        Raises:
            ConvergenceError: the machine has no equilibrium at theta.
        """
        model = self._model
        values = static_parameters(model, theta)
        if np.array_equal(values, static_parameters(model, model.drawn)):
            return model
        key = values.tobytes()
        if key not in self._rests:
            _drop_oldest(self._rests)
            self._rests[key] = model_at_rest(model, theta)
        return self._rests[key]

    def slopes(
        self, theta: Real, condition: Condition | None, chosen: Mask
    ) -> list[tuple[Change, ...]]:
        """Return what each Part's parameters change through the equilibrium.

        Args:
            theta: parameters in SI; (n_parameter,).
            chosen: parameters of interest; (n_parameter,).
        """
        model = self._model
        moving = tuple(
            mask & is_static(part)
            for part, mask in zip(model.parts, model.split_parameters(chosen), strict=True)
        )
        if not any(mask.any() for mask in moving):
            return [() for _ in model.parts]
        key = (
            theta.tobytes(),
            np.concatenate(moving).tobytes(),
            model.acting_fractions(condition),
        )
        if key not in self._slopes:
            _drop_oldest(self._slopes)
            pose = self.at_rest(theta).machine.pose
            self._slopes[key] = equilibrium_slopes(model, theta, condition, moving, pose)
        return self._slopes[key]


def _drop_oldest(kept: dict) -> None:  # type: ignore[type-arg]  # of any keys and values
    """Make room for one more."""
    while len(kept) >= _N_KEPT:
        del kept[next(iter(kept))]
