"""A campaign and its machine, opened together: what every tuning and diagnosis starts from."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import band_lines, correct_layout, read_campaign, read_settings
from identification.words import Campaign, InputError, distinct
from mbmodel import (
    HammerPart,
    Machine,
    Model,
    Part,
    as_drawn,
    body_parts,
    hammer_parts,
    joint_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)
from tuning.parametrisation.parametrisation import Freedom
from tuning.parametrisation.user_specification import Wishes, freedom


@dataclass(frozen=True, eq=False)
class Session:
    """What was read.

    Args:
        source: path of campaign.toml.
        model: the machine as drawn, with the corrections of campaign.toml, all that can vary as
            Parts.
        campaign: its tests, the lines of the band only.
        freedom: what varies.
    """

    source: Path
    model: Model
    campaign: Campaign
    freedom: Freedom


def open_session(path: Path, band: tuple[float, float] | None = None) -> Session:
    """Read a campaign folder and the model that it names, to tune it.

    Args:
        path: the folder, or its campaign.toml.
        band: lowest and highest frequency [Hz]; None for the lines with coherence.

    Raises:
        InputError: anything that cannot be used, with file, element and remedy.
    """
    source, machine, campaign = open_campaign(path, band)
    if not as_drawn(machine).parameters:
        raise InputError(
            f"{machine.source}: no joint or tendon has stiffness or damping to tune: draw them"
        )
    model = with_tolerances(machine, campaign)
    try:
        varies = freedom(model, campaign.tolerance, _wishes(path))
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    return Session(source, model, campaign, varies)


def _wishes(path: Path) -> Wishes:
    """What ``[tuning]`` asks for."""
    tuning = read_settings(path)[1].tuning
    return Wishes(
        free=tuning.free,
        fix=tuning.fix,
        prior=tuning.prior,
        bounds={name: (low, high) for name, (low, high) in tuning.bounds.items()},
        ties=tuning.tie,
    )


def with_tolerances(machine: Machine, campaign: Campaign) -> Model:
    """All that can vary as Parts: springs, bodies, joints, sensors, each direction of the hammer.

    Sensors that no test reads are left out.
    """
    read = {dof.point for test in campaign.tests for dof in test.estimate.frf.outputs}
    hit = distinct(test.condition.reference.positive for test in campaign.tests)
    return Model(
        machine,
        (
            *spring_parts(machine),
            *body_parts(machine),
            *joint_parts(machine),
            *(part for part in sensor_parts(machine) if part.point.name in read),
            *hammer_parts(machine, tuple(dof for dof in hit if dof.point in machine.layout.points)),
        ),
    )


def on_machine(model: Model, machine: Machine) -> Model:
    """The same Parts, made for a machine that has more coordinates and bodies.

    Args:
        model: of ``with_tolerances``.
        machine: with all that its machine has.
    """
    hit = tuple(part.dof for part in model.parts if isinstance(part, HammerPart))
    made: tuple[Part, ...] = (
        *spring_parts(machine),
        *body_parts(machine),
        *joint_parts(machine),
        *sensor_parts(machine),
        *hammer_parts(machine, hit),
    )
    known = {part.parameters: part for part in made}
    return Model(machine, tuple(known[part.parameters] for part in model.parts))


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
