"""``mbw blind --smallest``: what the test shows of each effect at each place, predicted.

The diagnosis predicts them (``diagnosis.next_test.smallest_sizes``). Drawn cases confirm them at
the places that matter most, if they are wanted.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from diagnosis.effects import load_catalogue
from diagnosis.effects.proven_by_data import PROVEN
from diagnosis.next_test.smallest_sizes import SmallestSize, predict_smallest_sizes
from identification.readers.result_files import FORMAT
from identification.words import InputError, first_by_key, group_by_key
from mbmodel import load_machine
from mbmodel.geometry.surfaces import machine_geometry
from mbw.blind.page import size_text
from mbw.blind.user_test import UserTest, find_model, title_of
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder
from truth import (
    Choice,
    TruthError,
    compare_with_usual,
    draw_case,
    find_place,
    write_campaign,
)
from truth.effects import NONLINEAR
from truth.effects.other_packages import known_effects
from truth.effects.outside import OUTSIDE
from tuning import open_session

# Effects without a linear prediction: laws of joints, and what data checks prove before any fit.
_UNPREDICTED = frozenset((*OUTSIDE, *PROVEN, *NONLINEAR, "sensor_swap", "flexible_body"))
_INSTRUMENTS = "sensor", "hammer"  # their effects need a tolerance
SMALLEST_FILES = "smallest.json", "smallest.html", "smallest.txt"


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


def predict(test: UserTest, choice: Choice) -> list[SmallestSize]:
    """Return the smallest sizes of all effects at all places in a test.

    The test is drawn once, for the noise of its FRFs, and the diagnosis predicts what it would
    find. A size that no drawn machine can have is none.

    Args:
        test: a machine and how it is tested.
        choice: effects and places; empty for all.

    Raises:
        InputError: no effect has a place, or the machine cannot be tested.
    """
    try:
        for place in choice.places:
            find_place(place, test.station)
        with TemporaryDirectory() as folder:
            case = draw_case(test.station, 0, 0, Choice(("none",)), test.repeated)
            write_campaign(case.campaign, Path(folder), overwrite=True, sealed=True)
            session = open_session(Path(folder))
            sizes = predict_smallest_sizes(session, choice.effects, choice.places)
        compared = (_compare_with_usual(row, test) for row in sizes)
        sizes = [row for row in compared if row is not None]
    except TruthError as error:
        raise InputError(str(error)) from error
    if not sizes:
        raise InputError(
            f"{test.station.name}: no effect that was chosen has a place in this machine: choose "
            "others by --effect and --place"
        )
    return sizes


def _compare_with_usual(row: SmallestSize, test: UserTest) -> SmallestSize | None:
    """Return a size over the one that is usually drawn, or none that no machine can have.

    Returns:
        None if no drawn machine has the effect there; effects that are never drawn stay.
    """
    if row.value is None or row.effect not in known_effects():
        return row
    cause, size = (row.effect, row.location, row.dof), (row.parameter, row.value)
    of_usual = compare_with_usual(test.station, test.repeated, cause, size)
    if of_usual is None:
        return None
    if not np.isfinite(of_usual):
        return replace(row, parameter="", value=None, is_found=False)
    return replace(row, of_usual=of_usual)


def describe_unpredicted(choice: Choice) -> list[str]:
    """Return a sentence for each chosen effect that has no prediction."""
    return [
        f"{effect} has no prediction: test it by drawn cases, without --smallest and --further"
        for effect in choice.effects
        if effect in _UNPREDICTED
    ]


def describe_unproposed(sizes: Sequence[SmallestSize], choice: Choice) -> list[str]:
    """Return a sentence for each effect on an instrument that no diagnosis of a test proposes.

    Args:
        choice: effects and places; empty for all.
    """
    predicted = {row.effect for row in sizes} | _UNPREDICTED
    return [
        f"{effect}: the test states no tolerance for it, so that no diagnosis proposes it: state "
        "one under [tolerance] in campaign.toml"
        for effect in choice.effects or load_catalogue()
        if effect.startswith(_INSTRUMENTS) and effect not in predicted
    ]


def choose_places(sizes: Sequence[SmallestSize], count: int) -> list[SmallestSize]:
    """Return the places that matter most: where a usual size is only just found.

    One place of each effect: that whose smallest size is nearest to a usual one. Effects without a
    direction come first, since a drawn case has any direction, and its size is the largest of all.
    Where causes are confounded, a case tells little of a size: these places come last.

    Args:
        count: how many places.
    """
    sites = group_by_key(((row.effect, row.location), row) for row in sizes)
    largest = [
        max(rows, key=lambda row: row.of_usual or 0.0)
        for rows in sites.values()
        if all(row.is_found and row.value is not None and row.of_usual for row in rows)
    ]
    first = first_by_key((row.effect, row) for row in sorted(largest, key=_rank_place))
    return list(first.values())[:count]


def _rank_place(row: SmallestSize) -> tuple[bool, bool, float]:
    """Return what orders places: confounded, with a direction, distance from a usual size."""
    return bool(row.confused), bool(row.dof), abs(float(np.log(row.of_usual or 1.0)))


def write(
    output: OutputFolder,
    model: str,
    names: tuple[str, str, str],
    what: str,
    rows: Mapping[str, Sequence[Any]],
    table: str,
    *,
    render: Callable[..., str],
) -> str:
    """Write rows, page and table of a prediction, and say where they are; return the table.

    Args:
        model: MJCF of a machine, or the user's campaign.
        names: names of the JSON file, the page and the text.
        what: what the JSON file holds, for the message.
        rows: records of each key of the JSON file.
        render: makes the page of rows, layout, geometry and title.
    """
    machine = load_machine(find_model(Path(model)))
    content = {name: [asdict(row) for row in records] for name, records in rows.items()}
    page = render(content, machine.layout, machine_geometry(machine), title_of(Path(model)))
    text = json.dumps({"format": FORMAT, **content}, indent=1) + "\n"
    with output.write() as place:
        for name, written in zip(names, (text, page, table), strict=True):
            (place / name).write_text(written, encoding="utf-8")
    folder = output.path.absolute()
    SCREEN.say(f"{what} in {folder / names[0]}")
    SCREEN.say(f"pictures in {(folder / names[1]).as_uri()}")
    return table


def size_table(sizes: Sequence[SmallestSize], confirmed: Sequence[Confirmation]) -> str:
    """Return the sizes as text: one row for each effect and place, the weakest first."""
    lines = ["smallest size that nine tests of ten find, predicted; SI units", ""]
    for row in sorted(sizes, key=lambda row: (row.is_found, -(row.of_usual or 0.0))):
        place = f"{row.effect} at {row.location} {row.dof}".rstrip()
        if not row.is_found:
            size = "not found at any plausible size"
        elif row.value is None:
            size = "found"
        else:
            size = f"{row.parameter} {size_text(row.value)}"
            size += "" if row.of_usual is None else f", {row.of_usual:.2g} of a usual size"
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
