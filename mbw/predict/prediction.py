"""What a model says by itself: its modes as rows of a table, and as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field

from identification.words import Complex, Dof, Real
from mbmodel import Energy, Machine, Model, Modes, energy, model_modes, shapes_at

_SMALLEST_SHARE = 0.001
_ZERO = 1e-9  # pole over the largest below which only rounding is left
_WIDEST = 26

Finite = Annotated[float, Field(allow_inf_nan=False)]
Shares = dict[str, Finite]


class ModeRow(BaseModel):
    """One pole or pair of poles; shares below 0.001 are left out.

    Args:
        frequency: |s| / 2 pi [Hz].
        damping: ratio; null of a motion at rest.
        real, imaginary: of the pole s [rad/s].
        name: of a motion at rest, such as ``rigid tx``; else null.
        strain, dissipation: share of each joint coordinate or tendon.
        strain_by_stage, dissipation_by_stage: the same summed.
        kinetic: share of each direction of each body.
        kinetic_by_body: the same summed.
        shape_real, shape_imaginary: motion at the file's ``shape_labels``, modal mass 1 kg.
    """

    frequency: Finite
    damping: Finite | None
    real: Finite
    imaginary: Finite
    name: str | None
    strain: Shares
    strain_by_stage: Shares
    dissipation: Shares
    dissipation_by_stage: Shares
    kinetic: Shares
    kinetic_by_body: Shares
    shape_real: list[Finite]
    shape_imaginary: list[Finite]


class ModesFile(BaseModel):
    """``mbw predict --json``."""

    model: str
    remarks: list[str]
    bodies: list[str]
    coordinates: list[str]
    shape_labels: list[str]
    modes: list[ModeRow]


@dataclass(frozen=True, eq=False)
class Prediction:
    """A model's modes, where they store and lose energy, and how they move.

    Args:
        model: as drawn.
        modes: of it.
        energy: shares of each mode.
        labels: of the rows of ``shapes``: axes of the points, then of the centres of mass.
        shapes: motion in each mode; (n_label, n_mode).
    """

    model: Model
    modes: Modes
    energy: Energy
    labels: tuple[Dof, ...]
    shapes: Complex

    @property
    def machine(self) -> Machine:
        """What the model is of."""
        return self.model.machine

    @property
    def damping_words(self) -> list[str]:
        """Damping of each mode in per cent, or what there is to say instead."""
        poles = self.modes.poles
        zero = _ZERO * np.abs(poles).max(initial=0.0)
        words = []
        for pole, ratio in zip(poles.tolist(), self.modes.damping.tolist(), strict=True):
            if abs(pole) <= zero:
                words.append("at rest")
            elif pole.imag > 0:
                words.append(f"{round(100 * ratio, 3) + 0.0:.3f}")  # no minus before zero
            else:
                words.append("overdamped" if pole.real < 0 else "unstable")
        return words

    @property
    def remarks(self) -> list[str]:
        """What a user must know of the model, one sentence each."""
        poles = self.modes.poles
        growing = np.flatnonzero(poles.real > _ZERO * np.abs(poles).max(initial=0.0)) + 1
        found = [f"{text[:1].upper()}{text[1:]}." for text in self.machine.remarks]
        if growing.size:
            which = ", ".join(map(str, growing))
            found.append(
                f"Unstable: mode {which} grows, so the frequency responses are of a steady motion "
                "that never comes to be."
            )
        return found


def predicted(model: Model) -> Prediction:
    """Modes of a model as drawn, with their energy and their shapes at points and bodies."""
    theta, layout = model.drawn, model.machine.layout
    found = model_modes(model, theta)
    points = tuple(Dof.of(point, axis) for point in layout.points for axis in range(3))
    labels = points + layout.body_dofs()
    shapes = shapes_at(model, theta, found, labels)
    return Prediction(model, found, energy(model, theta, found), labels, shapes)


def modes_file(prediction: Prediction) -> ModesFile:
    """All of it, for other programs."""
    machine = prediction.machine
    return ModesFile(
        model=machine.name,
        remarks=prediction.remarks,
        bodies=list(machine.layout.bodies),
        coordinates=list(machine.coordinates),
        shape_labels=[str(label) for label in prediction.labels],
        modes=[_row(prediction, number) for number in range(len(prediction.modes.poles))],
    )


def _row(prediction: Prediction, number: int) -> ModeRow:
    found, shares = prediction.modes, prediction.energy
    pole, shape = complex(found.poles[number]), prediction.shapes[:, number]
    rests = prediction.damping_words[number] == "at rest"
    return ModeRow(
        frequency=float(found.freq_hz[number]),
        damping=None if rests else float(found.damping[number]),
        real=pole.real,
        imaginary=pole.imag,
        name=found.names[number] or None,
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
    """Those that count, the largest first."""
    order = np.argsort(-np.abs(values), kind="stable")
    return {names[k]: float(values[k]) for k in order if abs(float(values[k])) >= _SMALLEST_SHARE}


def _by_owner(table: Mapping[str, Real], number: int) -> Shares:
    return _shares(list(table), np.array([row[number] for row in table.values()]))


@dataclass(frozen=True)
class Leading:
    """The largest shares of a mode, as (name, share) or None.

    Args:
        spring: by strain: the one to touch.
        body: by kinetic energy: what moves.
        damper: by dissipation: the one that works.
    """

    spring: tuple[str, float] | None
    body: tuple[str, float] | None
    damper: tuple[str, float] | None


def leading(prediction: Prediction) -> list[Leading]:
    """Spring, body and damper of each mode."""
    shares, bodies = prediction.energy, prediction.energy.by_body()
    moving = np.array(list(bodies.values()))
    return [
        Leading(
            _largest(shares.springs, shares.strain[:, number]),
            _largest(list(bodies), moving[:, number]),
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
    """The modes as lines of text: frequency, damping, and what each is made of."""
    head = ["spring, of strain energy", "body, of kinetic", "damper, of dissipation"]
    cells = []
    for name, lead in zip(prediction.modes.names, leading(prediction), strict=True):
        spring = name or _cell(lead.spring)
        cells.append([spring, _cell(lead.body), _cell(lead.damper)])
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


def _cell(lead: tuple[str, float] | None) -> str:
    if lead is None:
        return "-"
    name, share = lead
    if len(name) > _WIDEST:
        name = f"{name[:8]}~{name[9 - _WIDEST :]}"  # its end tells the direction
    return f"{100 * share:3.0f} % {name}"
