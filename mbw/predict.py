"""``mbw predict``: what a model says by itself."""

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
import typer
from pydantic import BaseModel

from identification.words import ORDER, Dof, InputError, Layout, Quantity, UsageError, is_hammer
from mbmodel import Evaluator, Machine, Model, Question, as_drawn, load_machine, modes, state_space
from mbw.tune import write_json


class ModeRow(BaseModel):
    """One pole or pair of poles."""

    frequency: float
    damping: float
    real: float
    imaginary: float


class ModesFile(BaseModel):
    """``mbw predict --json``."""

    model: str
    bodies: list[str]
    coordinates: list[str]
    modes: list[ModeRow]


@dataclass(frozen=True)
class Wish:
    """Which FRFs or state space are wanted.

    Args:
        inputs, outputs: labels; empty for all accelerometers, hammer points at those too.
        quantity: of the outputs.
        band: lowest and highest frequency [Hz].
        lines: between them.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    quantity: str
    band: tuple[float, float]
    lines: int


def run(  # one for each thing that can be written
    path: Path,
    wish: Wish,
    *,
    modes: bool,
    frf: bool,
    statespace: Path | None,
    json: Path | None,
) -> None:
    """Print modes (the default) or FRFs to stdout, write the state space to a file."""
    machine = load_machine(path)
    model = as_drawn(machine)
    if modes or not (frf or statespace):
        _print_modes(model, json)
    if frf or statespace:
        question = _question(machine, wish)
        if statespace is not None:
            _write_state_space(model, question, statespace)
        if frf:
            _print_frf(model, question)


def _print_modes(model: Model, json: Path | None) -> None:
    found = modes(model.matrices(model.drawn))
    rows = [
        ModeRow(frequency=f, damping=z, real=pole.real, imaginary=pole.imag)
        for f, z, pole in zip(
            found.freq_hz.tolist(), found.damping.tolist(), found.poles.tolist(), strict=True
        )
    ]
    machine = model.machine
    if json is not None:
        content = ModesFile(
            model=machine.name,
            bodies=list(machine.layout.bodies),
            coordinates=list(machine.coordinates),
            modes=rows,
        )
        write_json(content.model_dump_json(indent=1), json)
    if json is None or str(json) != "-":
        typer.echo("mode  frequency/Hz  damping/%")
        for number, row in enumerate(rows, start=1):
            note = "" if row.imaginary > 0 else "  (does not oscillate)"
            percent = round(100 * row.damping, 3) + 0.0  # no minus before zero
            typer.echo(f"{number:4d}  {row.frequency:12.3f}  {percent:9.3f}{note}")


def _question(machine: Machine, wish: Wish) -> Question:
    low, high = wish.band
    if not 0 <= low < high:
        raise UsageError(f"the band {low:g}..{high:g} Hz is empty: give LOW below HIGH")
    if wish.quantity not in ORDER:
        raise UsageError(f"{wish.quantity!r} is no quantity: write one of {', '.join(ORDER)}")
    quantity: Quantity = wish.quantity
    layout = machine.layout
    return Question(
        np.linspace(low, high, wish.lines),
        _dofs(wish.outputs, layout, hammers=False),
        _dofs(wish.inputs, layout, hammers=True),
        quantity,
    )


def _dofs(labels: tuple[str, ...], layout: Layout, *, hammers: bool) -> tuple[Dof, ...]:
    if labels:
        return tuple(Dof.parse(label) for label in labels)
    points = [name for name in layout.points if is_hammer(name)] if hammers else []
    points = points or [name for name in layout.points if not is_hammer(name)]
    if not points:
        raise UsageError("the model has no site: name --input and --output, such as body:+tx")
    return tuple(Dof.of(point, axis) for point in points for axis in range(3))


def _print_frf(model: Model, question: Question) -> None:
    frf = Evaluator(model, question).at(model.drawn).frf()
    writer = csv.writer(sys.stdout, lineterminator="\n")
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in ("Re", "Im")]
    writer.writerow(["frequency/Hz", *names])
    table = frf.values.reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, table, strict=True):
        parts = [repr(float(p)) for value in row for p in (value.real, value.imag)]
        writer.writerow([f"{frequency:.9g}", *parts])


def _write_state_space(model: Model, question: Question, target: Path) -> None:
    system = state_space(model, model.drawn, question)
    arrays = {name: getattr(system, name) for name in "ABCD"}
    labels = {
        "states": system.state_labels,
        "inputs": [str(dof) for dof in question.inputs],
        "outputs": [str(dof) for dof in question.outputs],
    }
    try:
        if target.suffix == ".mat":
            cells = {key: np.array(value, object) for key, value in labels.items()}
            scipy.io.savemat(target, {**arrays, **cells})
        elif target.suffix == ".npz":
            texts = {key: np.array(value) for key, value in labels.items()}
            np.savez_compressed(target, allow_pickle=False, **arrays, **texts)
        else:
            raise UsageError(f"{target}: the state space is written as .npz or .mat")
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error
