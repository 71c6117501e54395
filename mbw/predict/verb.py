"""``mbw predict``: what a model says by itself."""

import csv
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
import typer

from identification.words import ORDER, Dof, Input, InputError, Quantity, Real, UsageError
from mbmodel import (
    Evaluator,
    Machine,
    Model,
    Modes,
    Question,
    as_drawn,
    load_machine,
    parse_input,
    state_space,
)
from mbmodel.geometry.surfaces import looks
from mbw.files import check_json, write_json, write_page
from mbw.messages import SCREEN
from mbw.predict.curves import Curves, asked, drive_points
from mbw.predict.page import render
from mbw.predict.prediction import Prediction, modes_file, predicted, table
from mbw.site_kinds import hammers, sensors

PAGE = "predict.html"
_BAND = (0.0, 200.0)


@dataclass(frozen=True)
class Wish:
    """Which FRFs or state space are wanted.

    Args:
        inputs, outputs: labels; empty for all accelerometers, hammer points at those too.
        quantity: of the outputs.
        band: lowest and highest frequency [Hz]; None for 0..200, in pictures where modes are.
        lines: between them.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    quantity: str
    band: tuple[float, float] | None
    lines: int


@dataclass(frozen=True)
class Targets:
    """What is written, and where.

    Args:
        modes: a table to stdout; also if neither ``frf`` nor ``statespace`` is asked for.
        frf: CSV to stdout.
        statespace: .npz or .mat, or None.
        json: of the modes, ``-`` for stdout, or None.
        pictures: whether the page is written.
        out: its folder; None for ``<model>-predicted``.
    """

    modes: bool
    frf: bool
    statespace: Path | None
    json: Path | None
    pictures: bool
    out: Path | None

    @property
    def table(self) -> bool:
        """Whether the table of modes is printed."""
        other = self.frf or self.statespace is not None
        return (self.modes or not other) and str(self.json) != "-"


def run(path: Path, wish: Wish, targets: Targets, spin: Sequence[str] = ()) -> None:
    """Write files first, then data to stdout, so that a closed pipe costs no file.

    Raises:
        UsageError: labels, spins or targets without sense.
        InputError: a model that cannot be read or linearised, a file that cannot be written.
    """
    _check(targets)
    rates = _rates(spin)
    model = as_drawn(load_machine(path, rates))
    question = _question(model.machine, wish, targets)
    prediction = predicted(model)
    for remark in prediction.remarks:
        SCREEN.say(remark)
    if targets.json is not None and str(targets.json) != "-":
        write_json(modes_file(prediction).model_dump_json(indent=1), targets.json)
    if targets.statespace is not None and question is not None:
        _write_state_space(model, question, targets.statespace)
    page = _write_page(path, prediction, wish, question, targets, rates)
    if str(targets.json) == "-":
        typer.echo(modes_file(prediction).model_dump_json(indent=1))
    if targets.table:
        typer.echo("\n".join(table(prediction)))
    if targets.frf and question is not None:
        _print_frf(model, question)
    if page is not None:
        SCREEN.say(f"pictures: open {page.resolve().as_uri()}")


def _check(targets: Targets) -> None:
    """Refuse targets before the work is done."""
    if targets.statespace is not None and targets.statespace.suffix not in (".npz", ".mat"):
        raise UsageError(f"{targets.statespace}: the state space is written as .npz or .mat")
    if targets.json is not None:
        check_json(targets.json)
        if str(targets.json) == "-" and targets.frf:
            raise UsageError("--json - and --frf both go to stdout: name a file for the JSON")
    if targets.out is not None and targets.out.is_file():
        raise UsageError(f"--out {targets.out} is a file: name a folder for the pictures")


def _rates(texts: Sequence[str]) -> dict[str, float]:
    """Read ``JOINT=RATE``."""
    rates: dict[str, float] = {}
    for text in texts:
        joint, equals, number = text.rpartition("=")
        try:
            rate = float(number)
        except ValueError:
            rate = math.nan
        if not (equals and joint and math.isfinite(rate)):
            raise UsageError(f"--spin {text!r}: write JOINT=RATE in rad/s, such as spindle_rz=6.28")
        if joint in rates:
            raise UsageError(f"--spin names {joint!r} twice: give it one rate")
        rates[joint] = rate
    return rates


def _question(machine: Machine, wish: Wish, targets: Targets) -> Question | None:
    """The question asked in so many words, or None if labels are nowhere needed."""
    low, high = wish.band or _BAND
    if not 0 <= low < high < math.inf:
        raise UsageError(f"the band {low:g}..{high:g} Hz is empty: give LOW below HIGH")
    quantity = _quantity(wish)
    needed = targets.frf or targets.statespace is not None
    if not (needed or wish.inputs or wish.outputs):
        return None
    layout = machine.layout
    inputs: tuple[Input, ...] = tuple(parse_input(machine, text) for text in wish.inputs)
    outputs = tuple(Dof.parse(text) for text in wish.outputs)
    question = Question(
        np.linspace(low, high, wish.lines),
        outputs or _axes(sensors(layout)),
        inputs or _axes(hammers(layout) or sensors(layout)),
        quantity,
    )
    Evaluator(as_drawn(machine), question)  # refuses unknown labels before anything is written
    return question


def _quantity(wish: Wish) -> Quantity:
    if wish.quantity not in ORDER:
        raise UsageError(f"{wish.quantity!r} is no quantity: write one of {', '.join(ORDER)}")
    return wish.quantity


def _axes(points: Sequence[str]) -> tuple[Dof, ...]:
    if not points:
        raise UsageError("the model has no site: name --input and --output, such as body:+tx")
    return tuple(Dof.of(point, axis) for point in points for axis in range(3))


def _print_frf(model: Model, question: Question) -> None:
    frf = Evaluator(model, question).at(model.drawn).frf()
    writer = csv.writer(sys.stdout, lineterminator="\n")
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in ("Re", "Im")]
    writer.writerow(["frequency/Hz", *names])
    rows = frf.values.reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, rows, strict=True):
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
        else:
            texts = {key: np.array(value) for key, value in labels.items()}
            np.savez_compressed(target, allow_pickle=False, **arrays, **texts)
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error


def _write_page(
    path: Path,
    prediction: Prediction,
    wish: Wish,
    question: Question | None,
    targets: Targets,
    rates: Mapping[str, float],
) -> Path | None:
    """Write the page and say where; None if no pictures are wanted."""
    if not targets.pictures:
        return None
    target = (targets.out or Path(f"{path.stem}-predicted")) / PAGE
    turning = ", ".join(f"{joint} spins at {rate:g} rad/s" for joint, rate in rates.items())
    curves = _curves(prediction, wish, question)
    write_page(render(prediction, looks(prediction.machine), curves, turning), target)
    return target


def _curves(prediction: Prediction, wish: Wish, question: Question | None) -> Curves:
    model, found = prediction.model, prediction.modes
    if question is not None:
        return asked(model, found, question)
    return drive_points(model, found, _lines(found, wish), _quantity(wish))


def _lines(modes: Modes, wish: Wish) -> Real:
    """The band that was asked for, else 0..200 Hz if modes are there, else where they are."""
    band = wish.band
    if band is None:
        swinging = modes.freq_hz[modes.oscillates]
        inside = ((swinging > 0.1 * _BAND[1]) & (swinging < _BAND[1])).any()
        if inside or not swinging.size:
            band = _BAND
        else:
            band = (0.0, 1.5 * float(np.sort(swinging)[:12][-1]))
    return np.linspace(*band, wish.lines)
