"""``mbw blind --smallest``: what the test shows of each effect at each place, predicted.

The sizes are predicted from the linear information of the test and from the weights of the
diagnosis, and confirmed by drawn cases at the places that matter most, if they are wanted.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from diagnosis.effects.proven_by_data import PROVEN
from diagnosis.inference.calibration import load_calibration
from diagnosis.settings import SETTINGS
from identification.readers.result_files import FORMAT
from identification.words import InputError
from mbmodel import load_machine
from mbmodel.geometry.surfaces import machine_geometry
from mbw.blind.size_text import size_text
from mbw.blind.smallest_page import render
from mbw.blind.user_test import UserTest, find_model, title_of
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder
from truth import (
    Choice,
    SmallestSize,
    TruthError,
    Weighing,
    find_place,
    find_signatures,
    linearise_test,
    list_without_tolerance,
    named_size,
    predict_smallest,
)
from truth.campaign.linearised_test import MAX_VALUES, LinearisedTest
from truth.effects import NONLINEAR
from truth.effects.other_packages import known_effects
from truth.effects.outside import OUTSIDE

# Effects without a slope that predicts odds: what only data checks prove, and exchanged channels.
_UNPREDICTED = frozenset((*OUTSIDE, *PROVEN, *NONLINEAR, "sensor_swap"))
SMALLEST_JSON, SMALLEST_PAGE, SMALLEST_TEXT = "smallest.json", "smallest.html", "smallest.txt"


@dataclass(frozen=True)
class Confirmation:
    """A predicted size that drawn cases confirm.

    Args:
        effect: its name.
        location: as in an answer.
        parameter: of the answer, by which the size is stated.
        value: the predicted smallest size.
        found_cases: cases in which effect and place were right, and their number.
        interval: 95 % interval of the rate (Wilson).
    """

    effect: str
    location: str
    parameter: str
    value: float
    found_cases: tuple[int, int]
    interval: tuple[float, float]


def predict(test: UserTest, choice: Choice, max_values: int = MAX_VALUES) -> list[SmallestSize]:
    """Return the smallest sizes of all effects at all places in a test.

    Args:
        test: a machine and how it is tested.
        choice: effects and places; empty for all.
        max_values: complex values of the signatures, about.

    Raises:
        InputError: no effect has a place, or the machine cannot be tested.
    """
    try:
        places = tuple(find_place(place, test.station) for place in choice.places)
        linear = linearise_test(
            test.station, test.repeated.protocol, test.repeated.tolerance, max_values
        )
        schedule = SETTINGS.schedule
        factor = max(1, round(linear.values / schedule.enough_values))
        stride = schedule.thin(linear.lines, factor).stride
        effects = {name: draw for name, draw in known_effects().items() if name not in _UNPREDICTED}
        signatures, information = find_signatures(linear.thin(stride), effects, [])
    except TruthError as error:
        raise InputError(str(error)) from error
    weighing = _describe_weighing(linear, stride)
    chosen = replace(choice, places=places)
    sizes = predict_smallest(signatures, information, weighing, chosen)
    if not sizes:
        raise InputError(
            f"{test.station.name}: no effect that was chosen has a place in this machine: choose "
            "others by --effect and --place"
        )
    return [named_size(row, test.station) for row in sizes]


def _describe_weighing(test: LinearisedTest, stride: int) -> Weighing:
    """Return how the diagnosis weighs fits to every so manyth line.

    Args:
        test: all lines of it.
        stride: of the lines that a fit sees; the posterior counts twice as many.
    """
    constants = load_calibration()
    return Weighing(
        values=test.values,
        fitted_values=test.values / stride,
        counted_values=test.values / max(1, stride // 2),
        error_values=constants.error_values,
        noise_exponent=constants.noise_exponent,
        max_noise_share=constants.max_noise_share,
        hidden=constants.hidden["lines"],
        hidden_width=constants.hidden_width,
        min_closed=SETTINGS.min_closed,
        outlier=SETTINGS.outlier_sigma,
    )


def describe_unpredicted(choice: Choice) -> list[str]:
    """Return a sentence for each chosen effect that has no prediction."""
    return [
        f"{effect} has no prediction: test it by drawn cases, without --smallest and --further"
        for effect in choice.effects
        if effect in _UNPREDICTED
    ]


def describe_without_tolerance(test: UserTest, choice: Choice) -> list[str]:
    """Return a sentence for each effect that no diagnosis of a test proposes."""
    return [
        f"{effect}: the test states no tolerance {field}, so that no diagnosis proposes it: state "
        "one under [tolerance] in campaign.toml"
        for effect, field in list_without_tolerance(test.repeated.tolerance).items()
        if not choice.effects or effect in choice.effects
    ]


def choose_places(sizes: Sequence[SmallestSize], count: int) -> list[SmallestSize]:
    """Return the places that matter most: where a usual size is only just found.

    One place of each effect: that whose smallest size is nearest to a usual one. Effects without a
    direction come first, since a drawn case has any direction, and its size is the largest of all.
    Where causes are confounded, a case tells little of a size: these places come last.

    Args:
        sizes: predicted ones.
        count: how many places.
    """
    sites: dict[tuple[str, str], list[SmallestSize]] = {}
    for row in sizes:
        sites.setdefault((row.effect, row.location), []).append(row)
    largest = [
        max(rows, key=lambda row: row.of_usual or 0.0)
        for rows in sites.values()
        if all(row.is_found and row.value is not None and row.of_usual for row in rows)
    ]
    first: dict[str, SmallestSize] = {}
    for row in sorted(largest, key=_rank_place):
        first.setdefault(row.effect, row)
    return list(first.values())[:count]


def _rank_place(row: SmallestSize) -> tuple[bool, bool, float]:
    """Return what orders places: confounded, with a direction, distance from a usual size."""
    return bool(row.confused), bool(row.dof), abs(float(np.log(row.of_usual or 1.0)))


def write(
    output: OutputFolder,
    model: str,
    sizes: Sequence[SmallestSize],
    confirmed: Sequence[Confirmation],
) -> str:
    """Write sizes, table and page; return the table.

    Args:
        output: folder of the result.
        model: MJCF of a machine, or the user's campaign.
        sizes: predicted ones.
        confirmed: those that drawn cases confirm.
    """
    path = find_model(Path(model))
    machine = load_machine(path)
    table = size_table(sizes, confirmed)
    rows = {
        "sizes": [asdict(row) for row in sizes],
        "confirmed": [asdict(row) for row in confirmed],
    }
    page = render(rows, machine.layout, machine_geometry(machine), title_of(Path(model)))
    with output.write() as place:
        (place / SMALLEST_JSON).write_text(
            json.dumps({"format": FORMAT, **rows}, indent=1) + "\n", encoding="utf-8"
        )
        (place / SMALLEST_TEXT).write_text(table, encoding="utf-8")
        (place / SMALLEST_PAGE).write_text(page, encoding="utf-8")
    SCREEN.say(f"smallest sizes in {output.path.absolute() / SMALLEST_JSON}")
    SCREEN.say(f"pictures in {(output.path.absolute() / SMALLEST_PAGE).as_uri()}")
    return table


def size_table(sizes: Sequence[SmallestSize], confirmed: Sequence[Confirmation]) -> str:
    """Return the sizes as text: one row for each effect and place, the weakest first."""
    lines = ["smallest size that nine tests of ten find, predicted; SI units", ""]
    for row in sorted(sizes, key=lambda row: (row.is_found, -(row.of_usual or 0.0))):
        place = f"{row.effect} at {row.location} {row.dof}".rstrip()
        if not row.is_found:
            size = "not found at any plausible size"
        elif row.of_usual is None:
            size = "found"
        elif row.value is None:
            size = f"{row.of_usual:.2g} of a usual size"
        else:
            size = f"{row.parameter} {size_text(row.value)}, {row.of_usual:.2g} of a usual size"
        confused = f"; confused with {', '.join(row.confused[:3])}" if row.confused else ""
        lines.append(f"{place}: {size}{confused}")
    lines += [""] if confirmed else []
    for case in confirmed:
        hits, count = case.found_cases
        lines.append(
            f"confirmed: {case.effect} at {case.location}, {case.parameter} "
            f"{size_text(case.value)}: found in {hits} of {count} fresh cases "
            f"(95 %: {case.interval[0]:.0%} to {case.interval[1]:.0%})"
        )
    return "\n".join(lines) + "\n"
