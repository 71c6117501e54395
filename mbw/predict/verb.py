"""``mbw predict``: modes, FRFs and state space of a model."""

import csv
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
import typer

from identification.words import (
    DERIVATIVE_ORDER,
    MAX_FREQUENCY_HZ,
    MIN_FREQUENCY_HZ,
    Dof,
    Input,
    InputError,
    Quantity,
    Real,
    UsageError,
)
from mbmodel import (
    Evaluator,
    FrfRequest,
    Machine,
    Model,
    Modes,
    as_drawn,
    load_machine,
    parse_input,
    state_space,
)
from mbmodel.geometry.surfaces import machine_geometry
from mbw.files import check_json_target, write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from mbw.predict.curves import Curves, drive_points, requested_curves
from mbw.predict.page import PAGE, render
from mbw.predict.prediction import Prediction, modes_file, predict, table
from mbw.site_kinds import hammer_sites, sensor_sites
from mbw.spin_rates import parse_spin_rates

_DEFAULT_BAND_HZ = (0.0, 200.0)
_MIN_SHOWN_FREQUENCY = 0.1  # of the default band's upper limit; a mode above it is shown well
_MAX_BAND_MODES = 12  # modes that a band above or below the default one includes


@dataclass(frozen=True)
class PredictRequest:
    """Inputs, outputs and frequency lines of FRFs or of a state space.

    Args:
        inputs, outputs: labels; empty for all hammer points and all accelerometers.
        quantity: quantity of the outputs.
        band: lowest and highest frequency [Hz]; None for 0..200 Hz, on the page for the band that
            holds the modes.
        lines: number of frequency lines.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    quantity: str
    band: tuple[float, float] | None
    lines: int


@dataclass(frozen=True)
class PredictOutputs:
    """Outputs of a prediction.

    Args:
        modes: whether the table of modes is asked for.
        frf: whether FRFs are written as CSV to stdout.
        statespace: file of the state space, .npz or .mat; None for none.
        options: where page and JSON are written.
    """

    modes: bool
    frf: bool
    statespace: Path | None
    options: ResultOptions

    @property
    def table(self) -> bool:
        """Whether the table of modes is printed: if asked for, or if no other data are."""
        has_data = self.frf or self.statespace is not None
        is_wanted = self.modes or not (has_data or SCREEN.quiet)
        return is_wanted and not self.options.has_json_on_stdout


def run_options(  # noqa: PLR0913  # one for each option
    model: Path,
    *,
    modes: bool,
    frf: bool,
    inputs: list[str],
    outputs: list[str],
    quantity: str,
    band: tuple[float, float] | None,
    lines: int,
    statespace: Path | None,
    spin: list[str],
    key: str | None,
    out: Path | None,
    pictures: bool,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.predict.options`` describes them."""
    request = PredictRequest(tuple(inputs), tuple(outputs), quantity, band, lines)
    options = ResultOptions(out, json, overwrite, pictures)
    run(model, request, PredictOutputs(modes, frf, statespace, options), spin, key)


def run(
    path: Path,
    request: PredictRequest,
    targets: PredictOutputs,
    spin: Sequence[str] = (),
    key: str | None = None,
) -> None:
    """Write files first and data to stdout last, so that a closed pipe loses no file.

    Args:
        path: MJCF of the machine.
        request: inputs, outputs and frequency lines.
        targets: outputs of the command.
        spin: texts ``JOINT=RATE`` of hinges that spin at a constant rate [rad/s].
        key: name of the keyframe that gives pose and controls; None for ``home`` if there is one.

    Raises:
        UsageError: a label, a spin or a target cannot be used.
        InputError: the model cannot be read or linearised, or a file cannot be written.
    """
    _check(targets)
    rates = parse_spin_rates(spin)
    model = as_drawn(load_machine(path, rates, key))
    frf_request = _frf_request(model.machine, request, targets)
    options = targets.options
    with _open_output(path, options) as output:
        prediction = predict(model)
        for remark in prediction.remarks:
            SCREEN.say(remark)
        if options.json is not None and not options.has_json_on_stdout:
            write_json(modes_file(prediction).model_dump_json(indent=1), options.json)
        if targets.statespace is not None and frf_request is not None:
            _write_state_space(model, frf_request, targets.statespace)
        if output is not None:
            with output.write() as place:
                text = _page(prediction, request, frf_request, rates)
                (place / PAGE).write_text(text, encoding="utf-8")
    if options.has_json_on_stdout:
        typer.echo(modes_file(prediction).model_dump_json(indent=1))
    if targets.table:
        typer.echo("\n".join(table(prediction)))
    if targets.frf and frf_request is not None:
        _print_frf(model, frf_request)
    if output is not None:
        SCREEN.say(f"pictures: open {(output.path / PAGE).resolve().as_uri()}")


def _open_output(path: Path, options: ResultOptions) -> AbstractContextManager[OutputFolder | None]:
    """Return the folder of the page; None if no page shall be written."""
    if not options.pictures:
        return nullcontext()
    return options.open("predict", path, "predicted", (PAGE,))


def _check(targets: PredictOutputs) -> None:
    """Refuse unusable targets before the computation starts."""
    if targets.statespace is not None and targets.statespace.suffix not in (".npz", ".mat"):
        raise UsageError(f"{targets.statespace}: the state space is written as .npz or .mat")
    json, out = targets.options.json, targets.options.out
    if json is not None:
        check_json_target(json)
        if str(json) == "-" and targets.frf:
            raise UsageError("--json - and --frf both go to stdout: name a file for the JSON")
    if out is not None and out.is_file():
        raise UsageError(f"--out {out} is a file: name a folder for the pictures")


def _frf_request(
    machine: Machine, request: PredictRequest, targets: PredictOutputs
) -> FrfRequest | None:
    """Return the request of FRFs, or None if no output needs labels."""
    low, high = request.band or _DEFAULT_BAND_HZ
    if not 0 <= low < high:
        raise UsageError(f"the band {low:g}..{high:g} Hz is empty: give LOW below HIGH")
    if not MIN_FREQUENCY_HZ <= high <= MAX_FREQUENCY_HZ:
        raise UsageError(
            f"the band ends at {high:g} Hz, where no machine has modes: give HIGH in Hz, from "
            f"{MIN_FREQUENCY_HZ:g} to {MAX_FREQUENCY_HZ:g}"
        )
    quantity = _quantity(request)
    is_needed = targets.frf or targets.statespace is not None
    if not (is_needed or request.inputs or request.outputs):
        return None
    layout = machine.layout
    inputs: tuple[Input, ...] = tuple(parse_input(machine, text) for text in request.inputs)
    outputs = tuple(Dof.parse(text) for text in request.outputs)
    frf_request = FrfRequest(
        np.linspace(low, high, request.lines),
        outputs or _axes(sensor_sites(layout)),
        inputs or _axes(hammer_sites(layout) or sensor_sites(layout)),
        quantity,
    )
    Evaluator(as_drawn(machine), frf_request)  # refuses unknown labels before anything is written
    return frf_request


def _quantity(request: PredictRequest) -> Quantity:
    if request.quantity not in DERIVATIVE_ORDER:
        raise UsageError(
            f"{request.quantity!r} is no quantity: write one of {', '.join(DERIVATIVE_ORDER)}"
        )
    return request.quantity


def _axes(points: Sequence[str]) -> tuple[Dof, ...]:
    if not points:
        raise UsageError("the model has no site: name --input and --output, such as body:+tx")
    return tuple(Dof.of(point, axis) for point in points for axis in range(3))


def _print_frf(model: Model, request: FrfRequest) -> None:
    frf = Evaluator(model, request).at(model.drawn).frf()
    writer = csv.writer(sys.stdout, lineterminator="\n")
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in ("Re", "Im")]
    writer.writerow(["frequency/Hz", *names])
    rows = frf.values.reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, rows, strict=True):
        parts = [repr(float(p)) for value in row for p in (value.real, value.imag)]
        writer.writerow([f"{frequency:.9g}", *parts])


def _write_state_space(model: Model, request: FrfRequest, target: Path) -> None:
    system = state_space(model, model.drawn, request)
    arrays = {name: getattr(system, name) for name in "ABCD"}
    labels = {
        "states": system.state_labels,
        "inputs": [str(dof) for dof in request.inputs],
        "outputs": [str(dof) for dof in request.outputs],
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


def _page(
    prediction: Prediction,
    request: PredictRequest,
    frf_request: FrfRequest | None,
    rates: Mapping[str, float],
) -> str:
    spins = ", ".join(f"{joint} spins at {rate:g} rad/s" for joint, rate in rates.items())
    curves = _curves(prediction, request, frf_request)
    return render(prediction, machine_geometry(prediction.machine), curves, spins)


def _curves(
    prediction: Prediction, request: PredictRequest, frf_request: FrfRequest | None
) -> Curves:
    model, modes = prediction.model, prediction.modes
    if frf_request is not None:
        return requested_curves(model, modes, frf_request)
    return drive_points(model, modes, _lines(modes, request), _quantity(request))


def _lines(modes: Modes, request: PredictRequest) -> Real:
    """Return frequency lines in the user's band; else in 0..200 Hz, or in a band with modes."""
    band = request.band
    if band is None:
        natural, highest = modes.freq_hz[modes.oscillates], _DEFAULT_BAND_HZ[1]
        is_inside = ((natural > _MIN_SHOWN_FREQUENCY * highest) & (natural < highest)).any()
        if is_inside or not natural.size:
            band = _DEFAULT_BAND_HZ
        else:
            band = (0.0, 1.5 * float(np.sort(natural)[:_MAX_BAND_MODES][-1]))
    return np.linspace(*band, request.lines)
