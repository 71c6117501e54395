"""Options of a blind test, and its cases on the workers that they name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import typer

from identification.words import InputError, WorkbenchError
from mbmodel import load_machine
from mbmodel.mjcf.read import current_reading
from mbw.blind.case import TREES, BlindCase
from mbw.blind.request import Shard, build_request, prepare_folder
from mbw.blind.running import run_cases
from mbw.blind.user_test import is_campaign, read_test, read_user_test
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from truth import WHOLE_DECK, Choice, TruthError, check_choice, why_as_drawn
from tuning.workers.executors import Workers


@dataclass(frozen=True)
class BlindOptions:
    """Options of a blind test.

    Args:
        model: MJCF of a machine, or ``trees`` for random machines.
        cases: number of cases of the whole test.
        seed: seed of the whole test; it determines all answers.
        workers: where the cases run.
        outputs: where the test and its grades are written.
        band: band of the verdicts [Hz]; None for the frequency lines with coherence.
        shard: the part of the cases that is run; None for all.
        choice: effects, places and sizes that are drawn.
    """

    model: str
    cases: int
    seed: int
    workers: Workers
    outputs: ResultOptions
    band: tuple[float, float] | None = None
    shard: Shard | None = None
    choice: Choice = WHOLE_DECK


def check_model(model: str, band: tuple[float, float] | None) -> None:
    """Say how the machine is drawn; refuse a model that has no linear one, as ``predict`` does."""
    if is_campaign(Path(model)):
        read_user_test(Path(model), band)
        SCREEN.say(
            f"the test of {model} is repeated on true machines about its own model, with its "
            "channels, hits, averages, noise and tolerances"
        )
        return
    if model == TREES or not Path(model).is_file():
        return
    if reason := why_as_drawn(Path(model)):
        load_machine(Path(model))
        SCREEN.say(
            f"{model} itself is the nominal model of all cases, and true machines vary about it: "
            f"nominal models of its kind are drawn of plain files alone ({reason})"
        )


def check_places(options: BlindOptions) -> None:
    """Refuse chosen places that the machine lacks, or that lie where an effect cannot.

    Raises:
        InputError: a place is none, or none of an effect.
    """
    if options.model == TREES or not options.choice.places:
        return
    test = read_test(Path(options.model), options.band)
    try:
        check_choice(options.choice, test.station, test.repeated.protocol)
    except TruthError as error:
        raise InputError(str(error)) from error


def run_all(options: BlindOptions, out: Path, further: str | None = None) -> list[BlindCase]:
    """Run all cases; return those that were drawn.

    Args:
        out: its folder.
        further: name of a further test that is added; None for the test as it is.

    Raises:
        InputError: no case could be drawn, for a reason in the model.
        WorkbenchError: no case could be drawn.
    """
    model = options.model if options.model == TREES else str(Path(options.model).absolute())
    shard, without = options.shard or Shard(1, 1), current_reading().without
    cases = [
        BlindCase(model, options.seed, number, out, options.band, options.choice, further, without)
        for number in shard.numbers(options.cases)
    ]
    failed = [outcome for outcome in run_cases(cases, options.workers) if outcome.error]
    drawn = [case for case in cases if case.sealed.is_file()]
    if not drawn:
        sentence = f"none of {len(cases)} cases could be drawn: {failed[0].error}"
        raise InputError(sentence) if failed[0].is_refused else WorkbenchError(sentence)
    return drawn


def run_chosen(
    options: BlindOptions, seed: int, choice: Choice, out: Path, further: str | None = None
) -> list[BlindCase]:
    """Run cases of one effect at one place in a folder of their own; an interrupted one continues.

    Args:
        options: of the whole test; its cases are those of this place.
        seed: of these cases.
        choice: effect, place and size.
        out: folder of these cases.
        further: name of a further test that is added; None for the test as it is.
    """
    out.mkdir(parents=True, exist_ok=True)
    request = build_request(options.model, seed, options.band, choice=choice)
    if further is not None:
        request["further"] = further
    prepare_folder(request, out, overwrite=options.outputs.overwrite)
    return run_all(replace(options, seed=seed, choice=choice, shard=None), out, further)


def run_prediction(
    options: BlindOptions, name: str, file: str, compute: Callable[[OutputFolder], str]
) -> Path:
    """Run a prediction about one machine in a folder of its own, and print its table.

    Args:
        options: of the blind test.
        name: option that asks for the prediction, and end of the folder's name.
        file: its JSON.
        compute: writes all files into the folder, and returns the table.

    Returns:
        The folder of the result.

    Raises:
        InputError: the model cannot be used, or there are only random machines.
    """
    if options.model == TREES:
        raise InputError(f"--{name} needs one machine: name an MJCF or a campaign")
    check_model(options.model, options.band)
    if options.choice.dirt:
        SCREEN.say(
            "the prediction is of machines without other errors: --dirt is at work in the cases of "
            "--confirm alone"
        )
    with options.outputs.open("blind", Path(options.model), name, ()) as output:
        table = compute(output)
        folder = output.path.absolute()
        write_json((folder / file).read_text("utf-8"), options.outputs.json)
    if options.outputs.has_tables:
        typer.echo(table.rstrip())
    return folder
