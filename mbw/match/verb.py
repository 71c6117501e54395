"""``mbw match``: match of measured modes with finite-element modes (few sensors, unknown force).

Mass that a user states on the command line, with its tolerance: ``800``, ``800+-40``.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import typer

from identification.impacts import read_impacts
from identification.matching import match_modes
from identification.shapes import (
    RigidModes,
    ShapeSampling,
    compare_mass,
    read_shapes,
    rigid_modes,
)
from identification.words import InputError, UsageError
from mbw.files import write_json
from mbw.match.page import render
from mbw.match.result import NAMES, PAGE, collect_result, write_result
from mbw.match.schema import MatchFile
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions


@dataclass(frozen=True)
class SimulatedShapes:
    """Source of the simulated shapes and what the user states about them.

    Args:
        shapes: mesh with the shapes as point data.
        frequencies: table of their frequencies; None if the names of the shapes state them.
        mass: text of the structure's mass [kg], such as ``800+-40``; None if it is not known.
        nearest: whether shapes are read at the nearest node, in place of an interpolation.
    """

    shapes: Path
    frequencies: Path | None = None
    mass: str | None = None
    nearest: bool = False


def run(
    simulated: SimulatedShapes,
    campaign: Path,
    outputs: ResultOptions,
    width: float,
    band: tuple[float, float] | None = None,
) -> Path:
    """Match the modes, print a table, write the result and its page.

    Args:
        campaign: folder of the campaign.
        width: width of the sliding average of amplitudes [Hz].
        band: lowest and highest frequency [Hz]; None for the band that campaign.toml states.

    Returns:
        The folder of the result.

    Raises:
        InputError: a file cannot be used, or no mode is elastic.
    """
    sampling: ShapeSampling = "nearest" if simulated.nearest else "interpolated"
    weighed = None if simulated.mass is None else read_mass(simulated.mass)
    impacts = read_impacts(campaign)
    impacts = impacts if band is None else replace(impacts, band=band)
    with outputs.open("match", impacts.path, "matched", NAMES) as output:
        shapes = read_shapes(simulated.shapes, simulated.frequencies)
        for remark in (*impacts.layout.remarks, *shapes.remarks):
            SCREEN.say(remark)
        rigid = rigid_modes(shapes)
        if not rigid.supported.any():
            raise InputError(
                f"{simulated.shapes} has rigid modes alone: give a mesh with elastic modes too"
            )
        with SCREEN.status("clocks, spectra, modes"):
            matched = match_modes(
                shapes.select(rigid.supported), impacts.layout, impacts.spectra(), sampling
            )
            mass = None if weighed is None else compare_mass(rigid, *weighed)
            result = collect_result(shapes, rigid, impacts, matched, width, mass)
        with output.write() as place:
            write_result(result, place)
            (place / PAGE).write_text(render(result), encoding="utf-8")
    write_json(result.summary.model_dump_json(indent=1), outputs.json)
    if outputs.has_tables:
        _print(result.summary)
    _say(result.summary, rigid)
    SCREEN.say(f"match in {output.path}")
    outputs.say_page(output.path / PAGE)
    return output.path


def _print(result: MatchFile) -> None:
    typer.echo(
        "measured/Hz       sd  damping/%  is mode  simulated/Hz  probability   MAC  evidence at"
    )
    for row in result.modes:
        simulated = "-" if row.simulated is None else str(row.simulated)
        frequency = "-" if row.simulated_frequency is None else f"{row.simulated_frequency:.2f}"
        mac = "-" if row.mac is None else f"{row.mac:.2f}"
        typer.echo(
            f"{row.frequency:11.3f}  {row.frequency_sd:7.4f}  {100 * row.damping:9.2f}  "
            f"{simulated:>7}  {frequency:>12}  {row.probability:11.3f}  {mac:>4}  "
            f"{', '.join(row.telling)}"
        )


def _say(result: MatchFile, rigid: RigidModes) -> None:
    if result.mass_check is not None:
        SCREEN.say(result.mass_check.remark)
    elif result.mass is not None:
        SCREEN.say(f"the simulated structure weighs {result.mass:.4g} kg by its rigid modes")
    elif rigid.is_rigid.sum() == 6:
        SCREEN.say("the mass is unknown: the simulated shapes are not normalised by mass")
    n_zero = int((~rigid.supported).sum())
    if n_zero not in (0, 6):
        SCREEN.say(f"{n_zero} simulated modes have zero frequency; a free structure has six")
    if not (rigid.supported | rigid.is_rigid).all():
        SCREEN.say("one of them deforms the structure: this mechanism is left out like rigid modes")
    for (first, second), channels in zip(result.alike, result.alike_told_by, strict=True):
        SCREEN.say(
            f"modes {first} and {second} are similar at these channels; they differ most at "
            f"{', '.join(channels)}"
        )
    for number in result.unseen:
        SCREEN.say(f"mode {number} does not move at these channels and cannot be matched")
    if result.unmatched:
        unmatched = ", ".join(str(number) for number in result.unmatched)
        SCREEN.say(f"simulated modes in the band that were not measured: {unmatched}")


_DEFAULT_TOLERANCE_PERCENT = 5.0  # of the mass, where none is stated: joints, glue, cables
_MASS_TEXT = re.compile(r"\s*(\S+?)\s*(?:(?:\+-|\+/-|\u00b1)\s*(\S+?)\s*(%?))?\s*(?:kg)?\s*")


def read_mass(text: str) -> tuple[float, float]:
    """Return mass and tolerance [kg] of a text such as ``800``, ``800+-40`` or ``800+-5%``.

    Raises:
        UsageError: the text has another form.
        InputError: the mass is not positive, or the tolerance negative.
    """
    match = _MASS_TEXT.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        mass = float(match[1])
        width = _DEFAULT_TOLERANCE_PERCENT if match[2] is None else float(match[2])
    except ValueError:
        raise UsageError(
            f"--mass {text!r} is no mass: give kg with or without a tolerance, as 800 or 800+-40"
        ) from None
    is_relative = match[2] is None or match[3]
    tolerance = width * mass / 100 if is_relative else width
    if not 0 < mass < np.inf:
        raise InputError(f"--mass {text} is no mass: give the mass of the structure in kg")
    if not 0 <= tolerance < np.inf:
        raise InputError(f"--mass {text}: give a tolerance of 0 or more, as 800+-40")
    return mass, tolerance
