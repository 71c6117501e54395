"""``mbw match``: finite-element shapes against the modes of a few sensors."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from pydantic import BaseModel, Field

from identification.impacts import ImpactCampaign, ImpactSpectra, read_impacts
from identification.matching import Match, match
from identification.shapes import RigidModes, Shapes, check_mass, read_shapes, rigid_modes, telling
from identification.words import InputError
from mbw.messages import SCREEN
from mbw.tune import check_json, write_json

Finite = Annotated[float, Field(allow_inf_nan=False)]


class MatchRow(BaseModel):
    """A measured mode and the simulated one that it is.

    Args:
        frequency, frequency_sd: natural [Hz].
        damping, damping_sd: ratio.
        simulated: number of the simulated mode in its file, from 1; null for no match.
        simulated_frequency: its frequency [Hz].
        probability: that it is that one; of no match where that is likelier.
        mac: of signed shapes at the channels.
        telling: channels that tell it from the next candidate.
        shape: real, at ``channels``, of unit size.
    """

    frequency: Finite
    frequency_sd: Finite
    damping: Finite
    damping_sd: Finite
    simulated: int | None
    simulated_frequency: Finite | None
    probability: Finite
    mac: Finite | None
    telling: list[str]
    shape: list[Finite]


class MatchFile(BaseModel):
    """What ``mbw match --json`` writes.

    Args:
        shapes, campaign: what was read.
        band: of the lines [Hz].
        mass: of the simulated structure by its rigid modes [kg]; null if they do not tell.
        channels: such as ``acc1:+tx``.
        impacts: files of the records.
        modes: measured, by rising frequency.
        unmatched: numbers of simulated modes in the band that no measured mode is.
        alike: pairs of simulated modes with a MAC above 0.8 at these channels.
    """

    shapes: str
    campaign: str
    band: list[Finite]
    mass: Finite | None
    channels: list[str]
    impacts: list[str]
    modes: list[MatchRow]
    unmatched: list[int]
    alike: list[list[int]]


@dataclass(frozen=True)
class Simulated:
    """Where shapes come from and what is known of them.

    Args:
        path: the mesh.
        frequencies: a table beside it; None for names that tell them.
        mass: stated [kg]; None if nobody did.
    """

    path: Path
    frequencies: Path | None = None
    mass: float | None = None


_WITHIN = 0.05  # of a stated mass


def run(simulated: Simulated, folder: Path, json: Path | None) -> MatchFile:
    """Match, print, write.

    Returns:
        What was found.

    Raises:
        InputError: files that cannot be used, shapes of another mass, no elastic mode.
    """
    if json is not None:
        check_json(json)
    whole = read_shapes(simulated.path, simulated.frequencies)
    rigid = rigid_modes(whole)
    if simulated.mass is not None:
        check_mass(rigid, simulated.mass, _WITHIN, str(simulated.path))
    if rigid.modes.all():
        raise InputError(f"{simulated.path} has rigid modes alone. Give elastic ones.")
    campaign = read_impacts(folder)
    with SCREEN.console.status("clocks, spectra, modes") if not SCREEN.quiet else nullcontext():
        spectra = campaign.spectra()
        found = match(whole.only(~rigid.modes), campaign.layout, spectra)
    result = _gathered(whole, rigid, campaign, spectra, found)
    if json is not None:
        write_json(result.model_dump_json(indent=1), json)
    if json is None or str(json) != "-":
        _print(result)
    _say(result, rigid)
    return result


def _gathered(
    whole: Shapes,
    rigid: RigidModes,
    campaign: ImpactCampaign,
    spectra: ImpactSpectra,
    found: Match,
) -> MatchFile:
    number = np.flatnonzero(~rigid.modes) + 1
    names = [str(dof) for dof in spectra.dofs]
    rows = []
    for mode, shape in enumerate(found.measured.shapes):
        pair = found.pairs.get(mode)
        none = 1 - float(found.probability[mode].sum())
        rows.append(
            MatchRow(
                frequency=float(found.measured.frequencies[mode]),
                frequency_sd=float(found.measured.frequency_sd[mode]),
                damping=float(found.measured.dampings[mode]),
                damping_sd=float(found.measured.damping_sd[mode]),
                simulated=None if pair is None else int(number[pair]),
                simulated_frequency=None if pair is None else float(found.simulated_hz[pair]),
                probability=none if pair is None else float(found.probability[mode, pair]),
                mac=None if pair is None else float(found.mac[mode, pair]),
                telling=[names[channel] for channel in found.channels(mode)],
                shape=shape.tolist(),
            )
        )
    band = (found.simulated_hz >= campaign.band[0]) & (found.simulated_hz <= campaign.band[1])
    left = [int(number[k]) for k in np.flatnonzero(band) if k not in found.pairs.values()]
    alike = telling(found.at[band]).confused
    own = number[band]
    return MatchFile(
        shapes=whole.source,
        campaign=str(campaign.path),
        band=list(campaign.band),
        mass=rigid.mass if rigid.normalised else None,
        channels=names,
        impacts=list(spectra.sources),
        modes=rows,
        unmatched=left,
        alike=[[int(own[i]), int(own[j])] for i, j in alike],
    )


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
    for first, second in result.alike:
        SCREEN.say(f"modes {first} and {second} are alike at these channels")
    if result.unmatched:
        left = ", ".join(str(one) for one in result.unmatched)
        SCREEN.say(f"simulated in the band and not measured: {left}")
