"""``mbw blind``: scores of the diagnosis on withheld truth, for one machine or random ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import typer

from diagnosis import load_catalogue
from identification.words import InputError, WorkbenchError
from mbmodel import load_machine
from mbw.band import check_band
from mbw.blind.case import TREES, BlindCase
from mbw.blind.choice_options import read_choice
from mbw.blind.grading import describe_discarded_draws, rate_found, write_grades
from mbw.blind.page import GRADES, PAGE
from mbw.blind.request import Shard, build_request, prepare_folder
from mbw.blind.running import choose_workers, run_cases
from mbw.blind.smallest import SMALLEST_JSON, Confirmation, choose_places, predict, write
from mbw.blind.user_test import is_campaign, read_user_test
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from truth import WHOLE_DECK, Choice, SmallestSize, why_as_drawn
from truth.grade import tables, to_json
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


def run_options(  # noqa: PLR0913  # one for each option
    model: str,
    *,
    cases: int,
    out: Path | None,
    seed: int,
    jobs: int,
    cluster: str | None,
    executor: str | None,
    shard: str | None,
    band: tuple[float, float] | None,
    effect: list[str] | None,
    place: list[str] | None,
    ratio: list[float] | None,
    size: str | None,
    dirt: float,
    smallest: bool,
    confirm: int,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.blind.options`` describes them."""
    check_band(band)
    part = None if shard is None else Shard.read(shard, cases)
    workers = choose_workers(jobs, cluster, executor)
    choice = read_choice(effect, place, ratio, size, dirt)
    outputs = ResultOptions(out, json, overwrite)
    if smallest or confirm:
        options = BlindOptions(model, cases, seed, workers, outputs, band, None, choice)
        run_smallest(options, confirm)
        return
    run(BlindOptions(model, cases, seed, workers, outputs, band, part, choice))


def run(options: BlindOptions) -> Path:
    """Draw, diagnose and grade all cases; continue an interrupted test with the same options.

    Returns:
        The folder of the test.

    Raises:
        InputError: the model cannot be read, or the folder holds another test.
        WorkbenchError: no case could be drawn; InputError if the model is the reason.
    """
    load_catalogue()  # refuses an invalid effect of another package before anything is drawn
    _check_model(options.model, options.band)
    request = build_request(
        options.model,
        options.seed,
        options.band,
        shard=options.shard,
        cases=options.cases,
        choice=options.choice,
    )
    with options.outputs.open("blind", Path(options.model), "blind", ()) as output:
        out = output.path.absolute()
        prepare_folder(request, out, overwrite=options.outputs.overwrite)
        drawn = _run(options, out)
        grade_cases(output, drawn, Path(options.model).stem, options.outputs)
    return out


def _check_model(model: str, band: tuple[float, float] | None) -> None:
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
            f"the drawing is {model} itself, and true machines vary about it ({reason}: drawings "
            "of other machines are made of plain models alone)"
        )


def run_smallest(options: BlindOptions, confirm: int) -> Path:
    """Predict the smallest sizes that the test shows, and confirm some of them by drawn cases.

    Args:
        options: model or campaign, chosen effects and places, and cases at each place.
        confirm: places at which the prediction is confirmed.

    Returns:
        The folder of the result.

    Raises:
        InputError: the model cannot be used, or there are only random machines.
    """
    if options.model == TREES:
        raise InputError("--smallest needs one machine: name an MJCF or a campaign")
    _check_model(options.model, options.band)
    with options.outputs.open("blind", Path(options.model), "smallest", ()) as output:
        sizes = predict(options.model, options.band, options.choice)
        folder = output.path.absolute()
        confirmed = [
            _confirm(options, row, folder / f"confirm_{number}", options.seed + number)
            for number, row in enumerate(choose_places(sizes, confirm))
        ]
        table = write(output, options.model, sizes, confirmed)
        if options.outputs.json is not None:
            write_json((folder / SMALLEST_JSON).read_text("utf-8"), options.outputs.json)
    if not (SCREEN.quiet or options.outputs.has_json_on_stdout):
        typer.echo(table.rstrip())
    return folder


def _confirm(options: BlindOptions, row: SmallestSize, out: Path, seed: int) -> Confirmation:
    """Draw and diagnose cases with an effect of its predicted smallest size.

    Args:
        options: of the whole test; its cases are those of this place.
        row: effect, place and size.
        out: folder of these cases; an interrupted test continues.
        seed: of these cases.
    """
    value = row.value or 0.0
    choice = Choice((row.effect,), (row.location,), (), (row.parameter, value), options.choice.dirt)
    out.mkdir(parents=True, exist_ok=True)
    prepare_folder(
        build_request(options.model, seed, options.band, choice=choice),
        out,
        overwrite=options.outputs.overwrite,
    )
    parts = replace(options, seed=seed, choice=choice, shard=None)
    rate = rate_found(_run(parts, out), row.effect)
    hits = round(rate.rate * rate.n) if rate.n and rate.rate is not None else 0
    return Confirmation(
        row.effect,
        row.location,
        row.parameter,
        value,
        (hits, rate.n),
        (rate.low or 0.0, 1.0 if rate.high is None else rate.high),
    )


def grade_cases(
    output: OutputFolder, drawn: Sequence[BlindCase], title: str, outputs: ResultOptions
) -> None:
    """Write the grades, and print them with their place.

    Args:
        output: folder of the test.
        drawn: cases that were drawn.
        title: name of the model.
        outputs: options of the result.
    """
    report = write_grades(output, drawn, title)
    if outputs.json is not None:
        write_json(to_json(report), outputs.json)
    if not (SCREEN.quiet or outputs.has_json_on_stdout):
        typer.echo(tables(report).rstrip())
    out = output.path.absolute()
    SCREEN.say(describe_discarded_draws(drawn))
    SCREEN.say(f"grades in {out / GRADES}")
    SCREEN.say(f"pictures in {(out / PAGE).as_uri()}")


def _run(options: BlindOptions, out: Path) -> list[BlindCase]:
    """Run all cases; return those that were drawn."""
    model = options.model if options.model == TREES else str(Path(options.model).absolute())
    shard = options.shard or Shard(1, 1)
    cases = [
        BlindCase(model, options.seed, number, out, options.band, options.choice)
        for number in shard.numbers(options.cases)
    ]
    failed = [outcome for outcome in run_cases(cases, options.workers) if outcome.error]
    drawn = [case for case in cases if case.sealed.is_file()]
    if not drawn:
        sentence = f"none of {len(cases)} cases could be drawn: {failed[0].error}"
        raise InputError(sentence) if failed[0].is_refused else WorkbenchError(sentence)
    return drawn
