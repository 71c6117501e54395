"""Modes of a model with their energy shares and shapes."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, ConvergenceError, Dof, capitalise
from mbmodel import (
    EnergyShares,
    Machine,
    Model,
    Modes,
    energy_shares,
    model_modes,
    modes_with_laws,
    shapes_at,
)

_MAX_ZERO_POLE = 1e-9  # size of a pole over the largest; smaller ones are rounding errors of zero


@dataclass(frozen=True, eq=False)
class Prediction:
    """Modes of a model with their energy shares and shapes.

    Args:
        model: nominal model, as the MJCF describes the machine.
        modes: modes of the model.
        energy: energy shares of each mode.
        labels: labels of the rows of ``shapes``: axes of the points, then of the centres of mass.
        shapes: motion in each mode; (n_label, n_mode).
        mode_remarks: sentences on the modes.
    """

    model: Model
    modes: Modes
    energy: EnergyShares
    labels: tuple[Dof, ...]
    shapes: Complex
    mode_remarks: tuple[str, ...] = ()

    @property
    def machine(self) -> Machine:
        """Machine of the model."""
        return self.model.machine

    @property
    def damping_words(self) -> list[str]:
        """Damping ratio of each mode in per cent, or a word for a mode that does not oscillate."""
        poles = self.modes.poles
        zero = _MAX_ZERO_POLE * np.abs(poles).max(initial=0.0)
        words = []
        for pole, ratio in zip(poles.tolist(), self.modes.damping.tolist(), strict=True):
            if abs(pole) <= zero:
                words.append("at rest")
            elif pole.imag > 0:
                words.append(f"{round(100 * ratio, 3) + 0.0:.3f}")  # no minus before zero
            else:
                words.append("overdamped" if pole.real < 0 else "unstable")
        return words

    def is_at_rest(self, number: int) -> bool:
        """Return whether a mode is a motion that nothing resists."""
        return self.damping_words[number] == "at rest"

    @property
    def remarks(self) -> list[str]:
        """Findings on the model, one sentence each."""
        poles = self.modes.poles
        growing = np.flatnonzero(poles.real > _MAX_ZERO_POLE * np.abs(poles).max(initial=0.0)) + 1
        texts = (*self.machine.remarks, *self.mode_remarks)
        sentences = [f"{capitalise(text)}." for text in texts]
        if growing.size:
            which = ", ".join(map(str, growing))
            sentences.append(
                f"Unstable: mode {which} grows, so that the machine never reaches the steady "
                "motion which the FRFs describe."
            )
        return sentences


def predict(model: Model) -> Prediction:
    """Compute the modes of the nominal model, with energy shares and shapes."""
    theta, layout = model.drawn, model.machine.layout
    modes, mode_remarks = _modes(model)
    points = tuple(Dof.of(point, axis) for point in layout.points for axis in range(3))
    labels = points + layout.body_dofs()
    shapes = shapes_at(model, theta, modes, labels)
    energy = energy_shares(model, theta, modes)
    return Prediction(model, modes, energy, labels, shapes, mode_remarks)


def _modes(model: Model) -> tuple[Modes, tuple[str, ...]]:
    """Return the modes with all laws; if one cannot be followed, those without, and a remark."""
    try:
        return modes_with_laws(model, model.drawn), ()
    except ConvergenceError as error:
        remark = f"the modes are those without losses, delays and Maxwell branches, since {error}"
        return model_modes(model, model.drawn), (remark,)
