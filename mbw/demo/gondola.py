"""``mbw demo gondola``: the balloon gondola of the second seed, from shapes to matched modes.

A finite-element model of the outer frame, a campaign of impacts with unmeasured force on 21
channels with clocks of their own, and the match of both. The tested structure differs from the
model, and its truth is read last.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from identification.impacts import read_impacts
from mbw.assets import asset_path
from mbw.match import place, verb
from mbw.match.result import MATCH_JSON, PAGE
from mbw.match.schema import MatchFile, MatchRow
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions

_WEIGHED_KG = "272+-5"  # what scales say of the tested frame, and their tolerance
_WIDTH_HZ = 0.3  # of the sliding average of amplitudes, as mbw match has it
_SAME_MODE = 0.02  # relative difference of two frequencies of one mode, at most


def run(outputs: ResultOptions, band: tuple[float, float] | None = None) -> None:
    """Check the places, match the modes, write the page, and grade the match by the answer.

    Args:
        outputs: where the match is written.
        band: lowest and highest frequency [Hz]; None for the band of the campaign.
    """
    outputs = replace(outputs, out=outputs.out or Path("mbw-demo-gondola"))
    shapes, folder = asset_path("gondola/shapes.vtu"), asset_path("gondola/campaign")
    campaign = read_impacts(folder)
    SCREEN.say("1. places of the sensors: which simulated modes they tell apart")
    request = place.PlacementRequest(None, band or campaign.band, None)
    sites = folder / "sites.csv"
    place.run(verb.SimulatedShapes(shapes), request, sites, replace(outputs, json=None))
    SCREEN.say(f"\n2. {len(campaign.records)} impacts, force not measured: modes and their match")
    simulated = verb.SimulatedShapes(shapes, mass=_WEIGHED_KG)
    matched = verb.run(simulated, folder, outputs, _WIDTH_HZ, band)
    result = MatchFile.model_validate_json((matched / MATCH_JSON).read_text("utf-8"))
    SCREEN.say("\n3. damping by three methods, amplitude by two")
    for line in damping_lines(result):
        SCREEN.say(f"  {line}")
    answer = tomllib.loads((folder / "answer.toml").read_text("utf-8"))
    SCREEN.say("\n4. grading by the answer, which no step has read so far")
    for line in grade_match(result, answer):
        SCREEN.say(f"  {line}")
    SCREEN.say(f"\nopen {(matched / PAGE).resolve().as_uri()}")


def damping_lines(result: MatchFile) -> list[str]:
    """Return damping ratios by poles, half-power width and circle, and amplitudes C (table 3)."""
    lines = ["mode/Hz  poles/%  3 dB/%  circle/%  C by least squares and by the peak differ by/%"]
    for row in result.modes:
        half_power = [hand.damping for hand in row.by_hand]
        apart = [abs(hand.maximum / hand.least_squares - 1) for hand in row.by_hand]
        lines.append(
            f"{row.frequency:7.2f}  {100 * row.damping:7.2f}  {_percent(half_power):>6}  "
            f"{_percent(_circle_dampings(row)):>8}  {_percent(apart)}"
        )
    return lines


def _circle_dampings(row: MatchRow) -> list[float]:
    """Return the dampings by circles at the channels of the half-power method."""
    channels = {hand.channel for hand in row.by_hand}
    circles = [circle for circle in row.circles if circle.channel in channels]
    return [circle.damping for circle in circles if circle.damping is not None]


def _percent(values: list[float]) -> str:
    """Return the median of some ratios in per cent."""
    return f"{100 * median(values):.2f}" if values else "-"


def grade_match(result: MatchFile, answer: Mapping[str, Any]) -> list[str]:
    """Return lines that compare a match with the truth.

    Args:
        result: the match.
        answer: modes of the tested structure, as in ``answer.toml``.
    """
    lines = []
    for true in answer["mode"]:
        rows = [
            row for row in result.modes if abs(row.frequency / true["frequency"] - 1) < _SAME_MODE
        ]
        if not rows:
            lines.append(f"{true['frequency']:.2f} Hz: not measured{_frame(true)}")
            continue
        row = min(rows, key=lambda row: abs(row.frequency - true["frequency"]))
        pair = "no simulated mode" if row.simulated is None else f"simulated mode {row.simulated}"
        right = "right" if row.simulated == true.get("simulated") else "wrong"
        lines.append(
            f"{row.frequency:.2f} Hz, true {true['frequency']:.2f}; damping "
            f"{100 * row.damping:.2f} %, true {100 * true['damping']:.2f}; {pair}, {right}"
        )
    if result.mass is not None:
        lines.append(f"mass: {result.mass:.1f} kg simulated, true {answer['mass']:.1f}")
    return lines


def _frame(true: Mapping[str, Any]) -> str:
    return "" if "simulated" in true else "; it is a mode of an inner frame, which the model lacks"
