"""``mbw blind --smallest``: predict smallest sizes, and confirm some of them by drawn cases."""

from pathlib import Path

from diagnosis.next_test.smallest_sizes import SmallestSize
from mbw.blind.chosen_cases import BlindOptions, run_chosen, run_prediction
from mbw.blind.grading import count_found
from mbw.blind.smallest import (
    SMALLEST_JSON,
    Confirmation,
    choose_places,
    describe_unpredicted,
    describe_unproposed,
    predict,
    write,
)
from mbw.blind.user_test import read_test
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder
from truth import Choice


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
        return write(output, options.model, sizes, confirmed)

    return run_prediction(options, "smallest", SMALLEST_JSON, compute)


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
    found_cases, interval = count_found(
        run_chosen(options, seed, choice, out, further=""), row.effect
    )
    return Confirmation(row.effect, row.location, row.parameter, value, found_cases, interval)
