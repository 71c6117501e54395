"""A campaign and its machine, opened together: what every tuning and diagnosis starts from."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import band_lines, correct_layout, read_campaign, read_settings
from identification.words import Campaign, InputError
from mbmodel import Machine, Model, as_drawn, load_machine


@dataclass(frozen=True, eq=False)
class Session:
    """What was read.

    Args:
        source: path of campaign.toml.
        model: the machine as drawn, with the corrections of campaign.toml.
        campaign: its tests, the lines of the band only.
    """

    source: Path
    model: Model
    campaign: Campaign


def open_session(path: Path, band: tuple[float, float] | None = None) -> Session:
    """Read a campaign folder and the model that it names, to tune it.

    Args:
        path: the folder, or its campaign.toml.
        band: lowest and highest frequency [Hz]; None for the lines with coherence.

    Raises:
        InputError: anything that cannot be used, with file, element and remedy.
    """
    source, machine, campaign = open_campaign(path, band)
    model = as_drawn(machine)
    if not model.parameters:
        raise InputError(
            f"{machine.source}: no joint or tendon has stiffness or damping to tune: draw them"
        )
    return Session(source, model, campaign)


def open_campaign(
    path: Path, band: tuple[float, float] | None = None
) -> tuple[Path, Machine, Campaign]:
    """Read a campaign folder and the machine that it names.

    Args:
        path: the folder, or its campaign.toml.
        band: lowest and highest frequency [Hz]; None for the lines with coherence.

    Returns:
        Path of campaign.toml, the machine with the corrections stated there, the tests with the
        lines of the band only.

    Raises:
        InputError: anything that cannot be used, with file, element and remedy.
    """
    source, settings = read_settings(path)
    if settings.model is None:
        raise InputError(f'{source} names no model, only a layout: add model = "model.xml"')
    machine = load_machine(source.parent / settings.model)
    machine = replace(machine, layout=correct_layout(source, settings, machine.layout))
    campaign = read_campaign(source, settings, machine.layout)
    chosen = campaign.lines(band_lines(campaign, band, source))
    if not any(np.abs(test.estimate.frf.values).any() for test in chosen.tests):
        raise InputError(f"{source}: all FRFs are zero in the band: check the export")
    return source, machine, chosen
