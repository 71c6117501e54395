"""Modes of a model with their energy shares, as rows of a table and as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, ConvergenceError, Dof, Real
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
from mbw.predict.schema import PredictedModeRow, PredictedModesFile, Shares

_MIN_LISTED_SHARE = 0.001  # share of energy; smaller ones are left out of the JSON
_MAX_ZERO_POLE = 1e-9  # size of a pole over the largest; smaller ones are rounding errors of zero
_MAX_NAME_LENGTH = 26  # characters of a name in the table


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
        sentences = [f"{text[:1].upper()}{text[1:]}." for text in texts]
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


def modes_file(prediction: Prediction) -> PredictedModesFile:
    """Return the content of the JSON file."""
    machine = prediction.machine
    return PredictedModesFile(
        model=machine.name,
        remarks=prediction.remarks,
        bodies=list(machine.layout.bodies),
        coordinates=list(machine.coordinates),
        shape_labels=[str(label) for label in prediction.labels],
        modes=[_row(prediction, number) for number in range(len(prediction.modes.poles))],
    )


def _row(prediction: Prediction, number: int) -> PredictedModeRow:
    modes, shares = prediction.modes, prediction.energy
    pole, shape = complex(modes.poles[number]), prediction.shapes[:, number]
    is_zero = prediction.is_at_rest(number)
    return PredictedModeRow(
        frequency=float(modes.freq_hz[number]),
        damping=None if is_zero else float(modes.damping[number]),
        real=pole.real,
        imaginary=pole.imag,
        name=modes.names[number] or None,
        strain=_shares(shares.springs, shares.strain[:, number]),
        strain_by_stage=_by_owner(shares.by_stage(shares.strain), number),
        dissipation=_shares(shares.springs, shares.dissipation[:, number]),
        dissipation_by_stage=_by_owner(shares.by_stage(shares.dissipation), number),
        kinetic=_shares(shares.motions, shares.kinetic[:, number]),
        kinetic_by_body=_by_owner(shares.by_body(), number),
        shape_real=shape.real.tolist(),
        shape_imaginary=shape.imag.tolist(),
    )


def _shares(names: Sequence[str], values: Real) -> Shares:
    """Return the shares above the least one, the largest first."""
    order = np.argsort(-np.abs(values), kind="stable")
    return {names[k]: float(values[k]) for k in order if abs(float(values[k])) >= _MIN_LISTED_SHARE}


def _by_owner(table: Mapping[str, Real], number: int) -> Shares:
    return _shares(list(table), np.array([row[number] for row in table.values()]))


@dataclass(frozen=True)
class LargestShares:
    """Largest shares of a mode, as (name, share) or None.

    Args:
        spring: joint or tendon with the largest share of the strain energy.
        body: body with the largest share of the kinetic energy.
        damper: joint or tendon with the largest share of the dissipation.
    """

    spring: tuple[str, float] | None
    body: tuple[str, float] | None
    damper: tuple[str, float] | None


def largest_shares(prediction: Prediction) -> list[LargestShares]:
    """Return spring, body and damper with the largest shares of each mode."""
    shares, bodies = prediction.energy, prediction.energy.by_body()
    kinetic = np.array(list(bodies.values()))
    return [
        LargestShares(
            _largest(shares.springs, shares.strain[:, number]),
            _largest(list(bodies), kinetic[:, number]),
            _largest(shares.springs, shares.dissipation[:, number]),
        )
        for number in range(len(prediction.modes.poles))
    ]


def _largest(names: Sequence[str], values: Real) -> tuple[str, float] | None:
    if not len(values):
        return None
    largest = int(np.argmax(values))
    return (names[largest], float(values[largest])) if values[largest] > 0 else None


def table(prediction: Prediction) -> list[str]:
    """Return the modes as lines of text: frequency, damping ratio and largest energy shares."""
    head = ["spring, of strain energy", "body, of kinetic", "damper, of dissipation"]
    cells = []
    for name, shares in zip(prediction.modes.names, largest_shares(prediction), strict=True):
        spring = name or _cell(shares.spring)
        cells.append([spring, _cell(shares.body), _cell(shares.damper)])
    widths = [max(len(row[k]) for row in [head, *cells]) for k in range(3)]
    lines = [_line("mode", "frequency/Hz", "damping/%", head, widths)]
    frequencies = prediction.modes.freq_hz.tolist()
    rows = zip(frequencies, prediction.damping_words, cells, strict=True)
    for number, (frequency, damping, row) in enumerate(rows, start=1):
        lines.append(_line(f"{number:4d}", f"{frequency:.3f}", damping, row, widths))
    return lines


def _line(number: str, frequency: str, damping: str, cells: list[str], widths: list[int]) -> str:
    padded = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
    return f"{number}  {frequency:>12}  {damping:>10}  {padded}".rstrip()


def _cell(name_and_share: tuple[str, float] | None) -> str:
    if name_and_share is None:
        return "-"
    name, share = name_and_share
    if len(name) > _MAX_NAME_LENGTH:
        name = f"{name[:8]}~{name[9 - _MAX_NAME_LENGTH :]}"  # keep its end: the direction
    return f"{100 * share:3.0f} % {name}"
