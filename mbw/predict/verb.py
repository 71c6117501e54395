"""``mbw predict``: modes, FRFs and state space of a model.

FRFs of a model as CSV, with the bands of a tuning.
"""

import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import typer

from identification.words import Real, UsageError
from identification.words.csv_cells import write_csv
from mbmodel import COMBINED_NAME, STAGE_COPY_NAME, Evaluator, FrfRequest, Model
from mbmodel.geometry.surfaces import machine_geometry
from mbw.any_campaign import find_model
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from mbw.plant.closed_margins import MARGINS_MAT, MARGINS_NPZ
from mbw.plant.page import PLANT_PAGE
from mbw.plant.task import BudgetRequest, PlantStudy, study_plant
from mbw.predict.machines import MachineRequest, Machines, load_machines, parse_additions
from mbw.predict.outcome import Outcome, predict_outcome
from mbw.predict.page import PAGE, render
from mbw.predict.plant import FOLDER_NAMES, PlantResult, compute_plant
from mbw.predict.plant_request import PlantRequest
from mbw.predict.poses import has_ranges, parse_grid, predict_poses
from mbw.predict.requests import DEFAULT_BAND_HZ, PredictRequest, frf_request
from mbw.predict.spring_laws import parse_laws
from tuning.files.plant_folder import plant_doubts

_FOLDER_SUFFIX = "predicted"  # end of the default folder's name


@dataclass(frozen=True)
class PredictOutputs:
    """Outputs of a prediction.

    Args:
        modes: whether the table of modes is asked for.
        check: whether the state space is compared with the FRFs.
        frf: whether FRFs are written as CSV to stdout.
        plant: state space and uncertainty of the plant.
        options: where page and JSON are written.
        study: error budget and struts.
    """

    modes: bool
    check: bool
    frf: bool
    plant: PlantRequest
    options: ResultOptions
    study: BudgetRequest

    @property
    def has_data_on_stdout(self) -> bool:
        """Whether stdout holds CSV or JSON, so that sentences would spoil it."""
        return self.frf or self.options.has_json_on_stdout

    @property
    def table(self) -> bool:
        """Whether the table of modes is printed: if asked for, or if no other data are."""
        has_data = self.frf or self.plant.has_output or self.study.is_wanted
        is_wanted = self.modes or not (has_data or SCREEN.quiet)
        return is_wanted and not self.options.has_json_on_stdout


def run(  # noqa: PLR0913  # one for each option
    model: Path,
    *,
    key: str | None,
    spin: list[str],
    poses: list[str],
    mount: Path | None,
    at: str | None,
    add_mass: list[str],
    loss_factor: list[str],
    delay: list[str],
    maxwell: list[str],
    closed: list[str],
    request: PredictRequest,
    targets: PredictOutputs,
) -> None:
    """Predict a machine, or a grid of its poses.

    Args:
        model: MJCF, folder of a fit, or campaign.
        key: keyframe that the user states.
        spin: texts ``JOINT=RATE``, or with a range of rates.
        poses: texts of ranges of poses; empty for a single pose.
        mount, at, add_mass: stage and masses that are put on the machine, as texts.
        loss_factor, delay, maxwell: laws of springs, as texts.
        closed: names of the loops of the test that are closed.
        request: inputs, outputs and frequency lines.
        targets: outputs of the command.

    Raises:
        UsageError: a label, a spin or a target cannot be used.
        InputError: the model cannot be read or linearised, or a file cannot be written.
    """
    additions, laws = parse_additions(mount, at, add_mass), parse_laws(loss_factor, delay, maxwell)
    mjcf, loops_source, key = find_model(model, key)
    if not has_ranges(poses, spin):
        machine = MachineRequest(
            mjcf, tuple(spin), key, additions, laws, loops_source, tuple(closed)
        )
        predict_pose(machine, request, targets)
        return
    study = targets.study
    targets.plant.check()
    further = (additions, laws, closed, study.before, study.struts, targets.check, targets.frf)
    if any(further) or targets.plant.has_output:
        raise UsageError(
            "a grid of poses has modes, FRFs and state spaces between --input and --output, "
            "and the margins of --budget: predict a single pose with the further options"
        )
    points = parse_grid(poses, spin)
    predict_poses(mjcf, points, request, study.budget, key, targets.options)


def predict_pose(
    machine_request: MachineRequest, request: PredictRequest, targets: PredictOutputs
) -> None:
    """Write files first and data to stdout last, so that a closed pipe loses no file."""
    _check(targets)
    if machine_request.closed and targets.study.struts:
        raise UsageError(
            "--struts damps the machine with its loops open: predict it without --closed"
        )
    is_needed = targets.frf or targets.plant.needs_ports
    with load_machines(machine_request) as machines:
        frfs = frf_request(machines.model.machine, request, is_needed=is_needed)
        with _open_output(machine_request, targets) as output:
            outcome = predict_outcome(
                machines,
                machine_request.additions,
                request,
                frfs,
                has_page=targets.options.pictures,
                has_check=targets.check,
            )
            outcome = replace(outcome, doubts=tuple(plant_doubts(machine_request.path)))
            for remark in outcome.remarks:
                SCREEN.say(remark)
            plant = compute_plant(machines, machine_request, frfs, targets.plant)
            outcome = _add_interval(outcome, frfs, plant)
            study = study_plant(
                machines.model,
                machine_request.path,
                targets.study,
                request.band or DEFAULT_BAND_HZ,
                machine_request.read_variants,
            )
            plant.rows.update(study.rows())
            _write_files(machines, outcome, (plant, study), targets, output)
            outcome = replace(outcome, plant_rows=plant.rows)
        if targets.options.has_json_on_stdout:
            typer.echo(outcome.json())
        if targets.table:
            typer.echo("\n".join(outcome.table()))
        for sentence in plant.sentences:
            SCREEN.say(sentence)
        for line in [*outcome.check_lines(), *study.lines()]:
            (SCREEN.say if targets.has_data_on_stdout else typer.echo)(line)
        if targets.frf and frfs is not None:
            print_frf(machines.model, frfs, plant.interval if targets.plant.bands else None)
        if output is not None:
            _say_where(output.path, machines, targets)


def _add_interval(outcome: Outcome, frfs: FrfRequest | None, plant: PlantResult) -> Outcome:
    """Return the outcome whose curves have the intervals of the plant, if there are any."""
    curves = outcome.curves
    if curves is None or frfs is None:
        return outcome
    ends = plant.find_interval_at(curves.freq_hz)
    if ends is None:
        return outcome
    return replace(outcome, curves=curves.with_interval(frfs, ends))


def _write_files(
    machines: Machines,
    outcome: Outcome,
    plant_and_study: tuple[PlantResult, PlantStudy],
    targets: PredictOutputs,
    output: OutputFolder | None,
) -> None:
    """Write the folder of the result, the files that the user names, and the JSON last."""
    plant, study = plant_and_study
    if output is not None:
        with output.write() as place:
            machines.write_combined(place, output.path)
            plant.write_into(place)
            if targets.options.pictures:
                geometry = machine_geometry(outcome.machine)
                text = render(outcome, geometry, machines.rates)
                (place / PAGE).write_text(text, encoding="utf-8")
                study.write_into(place)
    plant.write_named_files()
    if targets.options.json is not None and not targets.options.has_json_on_stdout:
        write_json(replace(outcome, plant_rows=plant.rows).json(), targets.options.json)


def _say_where(folder: Path, machines: Machines, targets: PredictOutputs) -> None:
    """Say where the files of the result are."""
    if machines.combined is not None:
        SCREEN.say(f"combined machine: {folder / COMBINED_NAME}")
    targets.options.say_page(folder / PAGE)
    if targets.options.pictures and targets.study.budget is not None:
        SCREEN.say(f"error budget: open {(folder / PLANT_PAGE).resolve().as_uri()}")


def _open_output(
    request: MachineRequest, targets: PredictOutputs
) -> AbstractContextManager[OutputFolder | None]:
    """Return the folder of page, combined machine, bands and samples; None without any of them."""
    options = targets.options
    if not (options.pictures or request.additions or targets.plant.has_folder):
        return nullcontext()
    names: tuple[str, ...] = (PAGE, PLANT_PAGE, MARGINS_NPZ, MARGINS_MAT, *FOLDER_NAMES)
    if request.additions:
        names = (*names, COMBINED_NAME, STAGE_COPY_NAME)
    if options.out is not None:
        request.refuse_overwriting(options.out)
    return options.open("predict", request.path, _FOLDER_SUFFIX, names)


def _check(targets: PredictOutputs) -> None:
    """Refuse unusable targets before the computation starts."""
    targets.plant.check()
    targets.study.check()
    json, out = targets.options.json, targets.options.out
    if str(json) == "-" and targets.frf:
        raise UsageError("--json - and --frf both go to stdout: name a file for the JSON")
    if out is not None and out.is_file():
        raise UsageError(f"--out {out} is a file: name a folder for the pictures")


def print_frf(model: Model, request: FrfRequest, interval: tuple[Real, Real] | None = None) -> None:
    """Print FRFs as CSV to stdout.

    Args:
        model: at its nominal parameters.
        request: lines, outputs and inputs.
        interval: ends of the 95 % interval of each magnitude, two more columns each;
            (n_freq, n_out, n_in).
    """
    frf = Evaluator(model, request).at(model.drawn).frf()
    columns = [frf.values.real, frf.values.imag]
    parts = ["Re", "Im"]
    if interval is not None:
        columns += interval
        parts += ["low |H|", "high |H|"]
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in parts]
    write_csv(sys.stdout, [["frequency/Hz", *names]])
    rows = np.stack(columns, axis=-1).reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, rows.tolist(), strict=True):
        write_csv(sys.stdout, [[f"{frequency:.9g}", *map(repr, row)]])
