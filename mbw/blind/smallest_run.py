"""``mbw blind --smallest``: predict smallest sizes, and confirm some of them by drawn cases."""

from pathlib import Path

import typer

from identification.words import InputError
from mbw.blind.case_files import TREES
from mbw.blind.chosen_cases import BlindOptions, check_model, run_chosen
from mbw.blind.grading import rate_found
from mbw.blind.smallest import SMALLEST_JSON, Confirmation, choose_places, predict, write
from mbw.blind.user_test import read_test
from mbw.files import write_json
from mbw.messages import SCREEN
from truth import Choice, SmallestSize


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
    check_model(options.model, options.band)
    with options.outputs.open("blind", Path(options.model), "smallest", ()) as output:
        sizes = predict(read_test(Path(options.model), options.band), options.choice)
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
    rate = rate_found(run_chosen(options, seed, choice, out, further=""), row.effect)
    hits = round(rate.rate * rate.n) if rate.n and rate.rate is not None else 0
    return Confirmation(
        row.effect,
        row.location,
        row.parameter,
        value,
        (hits, rate.n),
        (rate.low or 0.0, 1.0 if rate.high is None else rate.high),
    )
