"""``mbw predict``: modes, FRFs and state space of a model."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import typer

from identification.words import UsageError
from mbmodel import COMBINED_NAME, STAGE_COPY_NAME, FrfRequest
from mbmodel.geometry.surfaces import machine_geometry
from mbw.files import check_json_target, write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from mbw.predict.additions import parse_additions
from mbw.predict.frf_files import print_frf, write_state_space
from mbw.predict.machines import MachineRequest, Machines, load_machines
from mbw.predict.outcome import Outcome, predict_outcome
from mbw.predict.page import PAGE, render
from mbw.predict.requests import PredictRequest, frf_request
from mbw.predict.spring_laws import parse_laws

_FOLDER_SUFFIX = "predicted"  # end of the default folder's name


@dataclass(frozen=True)
class PredictOutputs:
    """Outputs of a prediction.

    Args:
        modes: whether the table of modes is asked for.
        check: whether the state space is compared with the FRFs.
        frf: whether FRFs are written as CSV to stdout.
        statespace: file of the state space, .npz or .mat; None for none.
        options: where page and JSON are written.
    """

    modes: bool
    check: bool
    frf: bool
    statespace: Path | None
    options: ResultOptions

    @property
    def has_data_on_stdout(self) -> bool:
        """Whether stdout holds CSV or JSON, so that sentences would spoil it."""
        return self.frf or self.options.has_json_on_stdout

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
    check: bool,
    frf: bool,
    inputs: list[str],
    outputs: list[str],
    quantity: str,
    band: tuple[float, float] | None,
    lines: int,
    statespace: Path | None,
    spin: list[str],
    mount: Path | None,
    at: str | None,
    add_mass: list[str],
    loss_factor: list[str],
    delay: list[str],
    maxwell: list[str],
    key: str | None,
    out: Path | None,
    pictures: bool,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.predict.options`` describes them."""
    request = PredictRequest(tuple(inputs), tuple(outputs), quantity, band, lines)
    options = ResultOptions(out, json, overwrite, pictures)
    additions, laws = parse_additions(mount, at, add_mass), parse_laws(loss_factor, delay, maxwell)
    machine_request = MachineRequest(model, tuple(spin), key, additions, laws)
    run(machine_request, request, PredictOutputs(modes, check, frf, statespace, options))


def run(machine_request: MachineRequest, request: PredictRequest, targets: PredictOutputs) -> None:
    """Write files first and data to stdout last, so that a closed pipe loses no file.

    Args:
        machine_request: the machine, its state, and what is put on it.
        request: inputs, outputs and frequency lines.
        targets: outputs of the command.

    Raises:
        UsageError: a label, a spin or a target cannot be used.
        InputError: the model cannot be read or linearised, or a file cannot be written.
    """
    _check(targets)
    is_needed = targets.frf or targets.statespace is not None
    with load_machines(machine_request) as machines:
        frfs = frf_request(machines.model.machine, request, is_needed=is_needed)
        with _open_output(machine_request, targets.options) as output:
            outcome = predict_outcome(
                machines,
                machine_request.additions,
                request,
                frfs,
                has_page=targets.options.pictures,
                has_check=targets.check,
            )
            for remark in outcome.remarks:
                SCREEN.say(remark)
            _write_data(machines, outcome, frfs, targets)
            if output is not None:
                with output.write() as place:
                    machines.write_combined(place, output.path)
                    if targets.options.pictures:
                        geometry = machine_geometry(outcome.machine)
                        text = render(outcome, geometry, machines.rates)
                        (place / PAGE).write_text(text, encoding="utf-8")
        if targets.options.has_json_on_stdout:
            typer.echo(outcome.json())
        if targets.table:
            typer.echo("\n".join(outcome.table()))
        for line in outcome.check_lines():
            (SCREEN.say if targets.has_data_on_stdout else typer.echo)(line)
        if targets.frf and frfs is not None:
            print_frf(machines.model, frfs)
        if output is not None:
            _say_where(output.path, machines, targets.options)


def _write_data(
    machines: Machines, outcome: Outcome, frfs: FrfRequest | None, targets: PredictOutputs
) -> None:
    """Write JSON and state space to their files."""
    options = targets.options
    if options.json is not None and not options.has_json_on_stdout:
        write_json(outcome.json(), options.json)
    if targets.statespace is not None and frfs is not None:
        write_state_space(machines.model, frfs, targets.statespace)


def _say_where(folder: Path, machines: Machines, options: ResultOptions) -> None:
    """Say where the files of the result are."""
    if machines.combined is not None:
        SCREEN.say(f"combined machine: {folder / COMBINED_NAME}")
    if options.pictures:
        SCREEN.say(f"pictures: open {(folder / PAGE).resolve().as_uri()}")


def _open_output(
    request: MachineRequest, options: ResultOptions
) -> AbstractContextManager[OutputFolder | None]:
    """Return the folder of page and combined machine; None if neither shall be written."""
    if not (options.pictures or request.additions):
        return nullcontext()
    names = (PAGE, COMBINED_NAME, STAGE_COPY_NAME) if request.additions else (PAGE,)
    if options.out is not None:
        request.refuse_overwriting(options.out)
    return options.open("predict", request.path, _FOLDER_SUFFIX, names)


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
