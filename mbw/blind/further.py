"""``mbw blind --further``: which further hammer point, sensor or level helps most.

Every further test is ranked by the smallest sizes that it makes findable, as the diagnosis predicts
them. The best ones are confirmed, if that is wanted: machines with one fault, of a size
between the smallest ones of both tests, are tested without and with the further test.

Page of further tests: their ranking, and where they act on the machine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.next_test.further_gains import FurtherGain, compare_sizes, rank_gains
from diagnosis.next_test.smallest_sizes import SmallestSize
from identification.words import InputError, Layout
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.blind.chosen_cases import BlindOptions, run_chosen, run_prediction
from mbw.blind.grading import count_found
from mbw.blind.page import PLACES_SCRIPTS, find_points, size_text
from mbw.blind.smallest import describe_unpredicted, predict, write
from mbw.blind.user_test import read_test
from mbw.messages import SCREEN
from mbw.output_folder import OutputFolder
from mbw.page.html import fill_template, read_fragment
from mbw.page.picture import picture_data
from truth import Choice, list_further_tests
from truth.campaign.further_tests import FORCE, HITS

FURTHER_FILES = "further.json", "further.html", "further.txt"
_BEYOND = 1.2  # of the smallest size after, where no size is found before


@dataclass(frozen=True)
class FurtherConfirmation:
    """A further test that drawn cases confirm: the same machines, without it and with it.

    Args:
        name: of the further test.
        effect: of the fault.
        location: of the fault.
        parameter: of the answer, by which its size is stated.
        value: its size.
        found_before: cases in which effect and place were right without it, and their number.
        found_after: the same with it.
        interval_before: 95 % interval of the rate without it (Wilson).
        interval_after: 95 % interval of the rate with it (Wilson).
    """

    name: str
    effect: str
    location: str
    parameter: str
    value: float
    found_before: tuple[int, int]
    found_after: tuple[int, int]
    interval_before: tuple[float, float]
    interval_after: tuple[float, float]


def run_further(options: BlindOptions, confirm: int) -> Path:
    """Rank further tests, and confirm the best of them by drawn cases.

    Args:
        options: model or campaign, chosen effects and places, and cases of each confirmation.
        confirm: how many further tests are confirmed.

    Returns:
        The folder of the result.

    Raises:
        InputError: the model cannot be used, or there are only random machines.
    """

    def compute(output: OutputFolder) -> str:
        for sentence in describe_unpredicted(options.choice):
            SCREEN.say(sentence)
        gains = rank_further(Path(options.model), options.band, options.choice)
        folder = output.path.absolute()
        helpful = [
            gain for gain in gains if gain.most is not None and gain.name not in (HITS, FORCE)
        ]
        confirmed = [
            _confirm(options, gain, folder / f"confirm_{number}", options.seed + number)
            for number, gain in enumerate(helpful[:confirm])
        ]
        rows: dict[str, Sequence[object]] = {"gains": gains, "confirmed": confirmed}
        table = further_table(gains, confirmed)
        return write(
            output, options.model, FURTHER_FILES, "further tests", rows, table, render=render
        )

    return run_prediction(options, "further", FURTHER_FILES[0], compute)


def rank_further(path: Path, band: tuple[float, float] | None, choice: Choice) -> list[FurtherGain]:
    """Return all further tests of a model or campaign, the most helpful first.

    Args:
        path: MJCF of a machine, or the user's campaign.
        band: lowest and highest frequency [Hz] of a campaign; None for the lines with coherence.
        choice: effects and places that count; empty for all.

    Raises:
        InputError: the model or the campaign cannot be used.
    """
    test = read_test(path, band)
    before = predict(test, choice)
    further = list_further_tests(test.station, test.repeated.protocol)
    gains = []
    with SCREEN.progress() as progress:
        bar = progress.add_task("further tests", total=len(further))
        for further_test in further:
            after = predict(test.with_protocol(further_test.protocol), choice)
            gains.append(compare_sizes(further_test.name, before, after))
            progress.update(bar, advance=1, description=further_test.name)
    return rank_gains(gains)


def _confirm(options: BlindOptions, gain: FurtherGain, out: Path, seed: int) -> FurtherConfirmation:
    """Draw and diagnose cases with the fault that gains most, without and with a further test."""
    old, new = gain.most, gain.most_after
    if old is None or new is None:
        raise InputError(f"{gain.name} helps no effect that has a size: choose others by --effect")
    value = _size_between(old, new)
    choice = Choice((new.effect,), (new.location,), (), (new.parameter, value), options.choice.dirt)
    (found_before, interval_before), (found_after, interval_after) = (
        count_found(run_chosen(options, seed, choice, out / folder, further), new.effect)
        for folder, further in (("before", ""), ("after", gain.name))
    )
    return FurtherConfirmation(
        gain.name,
        new.effect,
        new.location,
        new.parameter,
        value,
        found_before,
        found_after,
        interval_before,
        interval_after,
    )


def _size_between(old: SmallestSize, new: SmallestSize) -> float:
    """Return a size that the further test finds and the test as it is does not, as predicted."""
    smallest = new.value or 0.0
    return float((old.value * smallest) ** 0.5) if old.value else _BEYOND * smallest


def further_table(gains: Sequence[FurtherGain], confirmed: Sequence[FurtherConfirmation]) -> str:
    """Return further tests as text, the most helpful first."""
    lines = ["what a further test would show, predicted, the most helpful first", ""]
    for gain in gains:
        text = (
            f"{gain.name}: {gain.findable} of {gain.compared} faults of usual size are found "
            f"({gain.findable_before} as it is); smallest sizes are {gain.shrink:.2g} of those "
            "as it is"
        )
        old, new = gain.most, gain.most_after
        if old is not None and new is not None and new.value is not None:
            place = f"{new.effect} at {new.location}"
            text += f"; most for {place}: smallest size {new.parameter} {size_text(new.value)}"
            text += ", as it is none" if old.value is None else f", as it is {size_text(old.value)}"
        lines.append(text)
    lines += [""] if confirmed else []
    for row in confirmed:
        lines.append(
            f"confirmed: {row.name}, {row.effect} at {row.location}, {row.parameter} "
            f"{size_text(row.value)}: found in "
            f"{_rate_text(row.found_before, row.interval_before)} as it is, and in "
            f"{_rate_text(row.found_after, row.interval_after)} with it"
        )
    return "\n".join(lines) + "\n"


def _rate_text(hits: tuple[int, int], interval: tuple[float, float]) -> str:
    return f"{hits[0]} of {hits[1]} cases (95 %: {interval[0]:.0%} to {interval[1]:.0%})"


def render(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    layout: Layout,
    geometry: MachineGeometry,
    title: str,
) -> str:
    """Return the HTML page.

    Args:
        rows: content of further.json.
    """
    gains = rows["gains"]
    no_shapes = np.zeros((0, 6 * len(layout.bodies)), complex)
    data = {
        "places": [_place(gain, layout) for gain in gains],
        "confirmed": list(rows["confirmed"]),
        "picture": picture_data(layout, geometry, no_shapes),
    }
    return fill_template(
        "blind/further.html",
        data,
        scripts=[*PLACES_SCRIPTS, "blind/further.js"],
        title=escape(f"What helps most: {title}"),
        subtitle="further hammer points, sensors, hits and forces, ranked by what they show",
        lead=escape(_describe_best(gains)),
        places=read_fragment("blind/further_picture.html"),
    )


def _describe_best(gains: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence on the most helpful further test."""
    best = gains[0]
    return (
        f"Of {len(gains)} further tests {best['name']} helps most: nine tests of ten find "
        f"{best['findable']} of {best['compared']} faults of usual size with it, and "
        f"{best['findable_before']} as it is; smallest sizes are {best['shrink']:.2g} of those as "
        "it is."
    )


def _place(gain: Mapping[str, Any], layout: Layout) -> dict[str, object]:
    """Return a further test with its points in the picture; none of more hits or force."""
    kind, _, site = str(gain["name"]).rpartition(" ")
    location = f"{'sensor' if kind == 'sensor' else 'hammer'}:{site}"
    bodies, points = find_points(location, layout) if site in layout.points else ([], [])
    return {"name": gain["name"], "bodies": bodies, "points": points, "gain": dict(gain)}
