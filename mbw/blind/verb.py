"""``mbw blind``: scores of the diagnosis on withheld truth, for one machine or random ones.

``mbw blind --smallest``: predict smallest sizes, and confirm some of them by drawn cases.

Which effects, places and sizes a blind test draws, from the options of the command.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import typer

from diagnosis import load_catalogue
from diagnosis.next_test.smallest_sizes import SmallestSize
from identification.words import UsageError
from mbw.blind.case import BlindCase
from mbw.blind.chosen_cases import (
    BlindOptions,
    check_model,
    check_places,
    run_all,
    run_chosen,
    run_prediction,
)
from mbw.blind.further import run_further
from mbw.blind.grading import count_found, describe_discarded_draws, write_grades
from mbw.blind.page import GRADES, PAGE, render_sizes
from mbw.blind.request import Shard, build_request, prepare_folder
from mbw.blind.running import choose_workers
from mbw.blind.smallest import (
    SMALLEST_FILES,
    Confirmation,
    choose_places,
    describe_unpredicted,
    describe_unproposed,
    predict,
    size_table,
    write,
)
from mbw.blind.user_test import read_test, title_of
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.option_texts import read_assignment
from mbw.output_folder import OutputFolder, ResultOptions
from truth import Choice
from truth.effects.other_packages import known_effects
from truth.grade import tables, to_json


def run(  # noqa: PLR0913  # one for each option
    model: str,
    outputs: ResultOptions,
    *,
    cases: int,
    seed: int,
    jobs: int,
    cluster: str | None,
    executor: str | None,
    shard: str | None,
    band: tuple[float, float] | None,
    effect: list[str],
    place: list[str],
    ratio: list[float],
    size: str | None,
    dirt: float,
    smallest: bool,
    further: bool,
    confirm: int,
) -> None:
    """Run the verb with the values of its options, as ``mbw.blind.options`` describes them."""
    part = None if shard is None else Shard.read(shard, cases)
    workers = choose_workers(jobs, cluster, executor)
    choice = read_choice(effect, place, ratio, size, dirt)
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
    run_drawn(BlindOptions(model, cases, seed, workers, outputs, band, part, choice))


def run_drawn(options: BlindOptions) -> Path:
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
        drawn: cases that were drawn.
        outputs: options of the result.
    """
    report = write_grades(output, drawn, title)
    write_json(to_json(report), outputs.json)
    if outputs.has_tables:
        typer.echo(tables(report).rstrip())
    out = output.path.absolute()
    SCREEN.say(describe_discarded_draws(drawn))
    SCREEN.say(f"grades in {out / GRADES}")
    SCREEN.say(f"pictures in {(out / PAGE).as_uri()}")


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

    def compute(output: OutputFolder) -> str:
        for sentence in describe_unpredicted(options.choice):
            SCREEN.say(sentence)
        test = read_test(Path(options.model), options.band)
        sizes = predict(test, options.choice)
        for sentence in describe_unproposed(sizes, options.choice):
            SCREEN.say(sentence)
        folder = output.path.absolute()
        confirmed = [
            _confirm(options, row, folder / f"confirm_{number}", options.seed + number)
            for number, row in enumerate(choose_places(sizes, confirm))
        ]
        rows: dict[str, Sequence[object]] = {"sizes": sizes, "confirmed": confirmed}
        table = size_table(sizes, confirmed)
        return write(
            output,
            options.model,
            SMALLEST_FILES,
            "smallest sizes",
            rows,
            table,
            render=render_sizes,
        )

    return run_prediction(options, "smallest", SMALLEST_FILES[0], compute)


def _confirm(options: BlindOptions, row: SmallestSize, out: Path, seed: int) -> Confirmation:
    """Draw and diagnose cases with an effect of its predicted smallest size.

    Args:
        row: effect, place and size.
        out: folder of these cases; an interrupted test continues.
    """
    value = row.value or 0.0
    choice = Choice((row.effect,), (row.location,), (), (row.parameter, value), options.choice.dirt)
    found_cases, interval = count_found(
        run_chosen(options, seed, choice, out, further=""), row.effect
    )
    return Confirmation(row.effect, row.location, row.parameter, value, found_cases, interval)


def read_choice(
    effects: Sequence[str],
    places: Sequence[str],
    ratios: Sequence[float],
    size: str | None,
    dirt: float,
) -> Choice:
    """Return the choice of the options.

    Args:
        effects: names of effects; empty for the whole deck.
        places: locations such as ``joint:ty``.
        ratios: survival ratios.
        size: ``parameter=value`` of the answer, such as ``mass=5``.
        dirt: part of the motion that small imperfections leave, in per cent.

    Raises:
        UsageError: an effect is unknown, or an option needs an effect.
    """
    for name in effects:
        if name not in known_effects() or name == "none":
            choices = ", ".join(effect for effect in known_effects() if effect != "none")
            raise UsageError(f"--effect {name!r} is unknown: choose from {choices}")
    if not effects and (places or ratios or size):
        raise UsageError("--place, --ratio and --size need an effect: name it by --effect")
    if ratios and size:
        raise UsageError("--ratio and --size exclude each other: give one of them")
    if not all(0 < ratio < math.inf for ratio in ratios):
        raise UsageError("--ratio: give a survival ratio of more than 0, such as 2")
    form = "parameter=value, such as mass=5"
    stated = None if size is None else read_assignment("--size", size, form)
    return Choice(tuple(effects), tuple(places), tuple(ratios), stated, dirt)
