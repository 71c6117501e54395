"""``mbw blind``: scores of the diagnosis on withheld truth, for one machine or random ones."""

from collections.abc import Sequence
from pathlib import Path

import typer

from diagnosis import load_catalogue
from identification.words import UsageError
from mbw.band import check_band
from mbw.blind.case_files import BlindCase
from mbw.blind.choice_options import read_choice
from mbw.blind.chosen_cases import BlindOptions, check_model, check_places, run_all
from mbw.blind.further import run_further
from mbw.blind.grading import describe_discarded_draws, write_grades
from mbw.blind.page import GRADES, PAGE
from mbw.blind.request import Shard, build_request, prepare_folder
from mbw.blind.running import choose_workers
from mbw.blind.smallest_run import run_smallest
from mbw.blind.user_test import title_of
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder, ResultOptions
from truth.grade import tables, to_json


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
    further: bool,
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
    if smallest and further:
        raise UsageError("--smallest and --further exclude each other: give one of them")
    unused = {"--shard": shard, "--ratio": ratio, "--size": size}
    if smallest or further or confirm:
        for name in (name for name, value in unused.items() if value):
            raise UsageError(f"{name} is for drawn cases, and not for a prediction: leave it out")
    if further:
        run_further(BlindOptions(model, cases, seed, workers, outputs, band, None, choice), confirm)
        return
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
    check_model(options.model, options.band)
    check_places(options)
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
        drawn = run_all(options, out)
        grade_cases(output, drawn, title_of(Path(options.model)), options.outputs)
    return out


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
