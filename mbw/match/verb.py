"""``mbw match``: finite-element shapes against the modes of a few sensors."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from identification.impacts import read_impacts
from identification.matching import match
from identification.shapes import How, RigidModes, check_mass, read_shapes, rigid_modes
from identification.words import InputError
from mbw.files import check_json, check_names, write_json
from mbw.match.page import render
from mbw.match.result import NAMES, PAGE, gather, write_result
from mbw.match.schema import MatchFile
from mbw.messages import SCREEN
from tuning import files_of


@dataclass(frozen=True)
class Simulated:
    """Where shapes come from and what is known of them.

    Args:
        path: the mesh.
        frequencies: a table beside it; None for names that tell them.
        mass: stated [kg]; None if nobody did.
        how: shapes are read at sensors.
    """

    path: Path
    frequencies: Path | None = None
    mass: float | None = None
    how: How = "interpolated"


_WITHIN = 0.05  # of a stated mass


def run(
    simulated: Simulated, folder: Path, out: Path | None, json: Path | None, width_hz: float
) -> Path:
    """Match, print, write the result and its page.

    Args:
        simulated: shapes.
        folder: of the campaign.
        out: folder of the result; <campaign>-matched if None.
        json: a file beside it, or ``-``.
        width_hz: of the sliding average of amplitudes.

    Returns:
        The folder of the result.

    Raises:
        InputError: files that cannot be used, shapes of another mass, no elastic mode.
    """
    campaign = read_impacts(folder)
    target = out or Path(f"{campaign.path.parent.absolute().name}-matched")
    check_names(target, NAMES)
    if json is not None:
        check_json(json)
    whole = read_shapes(simulated.path, simulated.frequencies)
    rigid = rigid_modes(whole)
    if simulated.mass is not None:
        if not 0 < simulated.mass < np.inf:
            raise InputError(f"--mass {simulated.mass:g} is no mass. Give what it weighs in kg.")
        check_mass(rigid, simulated.mass, _WITHIN, str(simulated.path))
    if not rigid.held.any():
        raise InputError(f"{simulated.path} has modes at rest alone. Give some that vibrate.")
    with SCREEN.console.status("clocks, spectra, modes") if not SCREEN.quiet else nullcontext():
        found = match(whole.only(rigid.held), campaign.layout, campaign.spectra(), simulated.how)
        result = gather(whole, rigid, campaign, found, width_hz)
    with files_of(target) as place:
        write_result(result, place)
        (place / PAGE).write_text(render(result), encoding="utf-8")
    if json is not None:
        write_json(result.summary.model_dump_json(indent=1), json)
    if json is None or str(json) != "-":
        _print(result.summary)
    _say(result.summary, rigid)
    SCREEN.say(f"match in {target}")
    SCREEN.say(f"pictures in {(target / PAGE).absolute().as_uri()}")
    return target


def _print(result: MatchFile) -> None:
    typer.echo("measured/Hz       sd  damping/%  is mode  simulated/Hz  probability   MAC  told by")
    for row in result.modes:
        simulated = "-" if row.simulated is None else str(row.simulated)
        at = "-" if row.simulated_frequency is None else f"{row.simulated_frequency:.2f}"
        alike = "-" if row.mac is None else f"{row.mac:.2f}"
        typer.echo(
            f"{row.frequency:11.3f}  {row.frequency_sd:7.4f}  {100 * row.damping:9.2f}  "
            f"{simulated:>7}  {at:>12}  {row.probability:11.3f}  {alike:>4}  "
            f"{', '.join(row.telling)}"
        )


def _say(result: MatchFile, rigid: RigidModes) -> None:
    if result.mass is not None:
        SCREEN.say(f"the simulated structure weighs {result.mass:.4g} kg by its rigid modes")
    elif rigid.modes.sum() == 6:
        SCREEN.say("the shapes are not normalised by mass: what they weigh cannot be told")
    loose = int((~rigid.held).sum())
    if loose not in (0, 6):
        SCREEN.say(f"{loose} simulated modes are at rest; a structure that nothing holds has six")
    if not (rigid.held | rigid.modes).all():
        SCREEN.say("one of them deforms: a mechanism, which is left out as rigid ones are")
    for (first, second), channels in zip(result.alike, result.alike_told_by, strict=True):
        SCREEN.say(
            f"modes {first} and {second} are alike at these channels; what tells them is "
            f"{', '.join(channels)}"
        )
    for number in result.unseen:
        SCREEN.say(f"mode {number} does not move at these channels: nothing can be said of it")
    if result.unmatched:
        left = ", ".join(str(one) for one in result.unmatched)
        SCREEN.say(f"simulated in the band and not measured: {left}")
