"""Accelerometers, force gauges and stingers that hang on the machine in some tests."""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from identification.readers.campaign_toml import CampaignSettings, port_key
from identification.words import Campaign, Dof, InputError
from mbmodel import Machine
from mbmodel.parts import AttachedPart, Stinger

_MAX_MASS_SHARE = 1.0  # of its body's mass: a heavier instrument is a mass in g


def attach_instruments(
    source: Path, settings: CampaignSettings, machine: Machine, campaign: Campaign
) -> tuple[list[AttachedPart], list[str]]:
    """Return what ``[sensor.*]`` and ``[hammer.*]`` hang on the machine, and remarks on it.

    Args:
        source: path of campaign.toml.
        campaign: tests, whose files say where instruments hang.

    Raises:
        InputError: a mass or stinger where no test reads or drives a point of the machine.
    """
    points = set(machine.layout.points)
    parts = list(_sensors(source, settings, campaign, points))
    parts += _shakers(source, settings, campaign, points)
    if not parts:
        return [], []
    texts = ", ".join(map(_describe, parts))
    remark = f"{source.name}: on the machine in the tests of their files: {texts}"
    bodies = dict(zip(machine.layout.bodies, np.diag(machine.body_mass)[::6], strict=True))
    for part in parts:
        body = machine.layout.body_name(part.pushes.point)
        if part.mass > _MAX_MASS_SHARE * bodies[body]:
            raise InputError(
                f"{source}: {part.location} has a mass of {part.mass:g} kg, and {body} itself has "
                f"{bodies[body]:g} kg: give mass in kg"
            )
    if machine.statics is not None:
        remark += "; their weight does not move the equilibrium here"
    return parts, [remark]


def _describe(part: AttachedPart) -> str:
    """Return mass and place of an instrument, and how stiff its stinger is."""
    text = f"{1e3 * part.mass:g} g at {part.pushes.point}"
    if part.stinger is None:
        return text
    held = part.stinger.stiffness(np.array([1.0, 0.0, 0.0]))
    return f"{text} with a stinger of {held[1, 1]:.3g} N/m sideways and {held[4, 4]:.3g} N m/rad"


def _sensors(
    source: Path, settings: CampaignSettings, campaign: Campaign, points: set[str]
) -> Iterator[AttachedPart]:
    """Yield each accelerometer with a mass, in the tests of the files that it reads."""
    files = defaultdict[str, set[str]](set)
    for test in campaign.tests:
        for dof in test.estimate.frf.outputs:
            if isinstance(dof, Dof):
                files[dof.point].add(test.condition.test)
    for site, table in settings.sensor.items():
        if table.mass is None:
            continue
        if site not in points or not files[site]:
            raise InputError(
                f"{source}: sensor.{site}: mass = {table.mass:g} kg, but no test reads a site of "
                "that name: name the site of a channel, or remove mass"
            )
        yield AttachedPart(f"sensor:{site}", Dof.of(site, 0), frozenset(files[site]), table.mass)


def _shakers(
    source: Path, settings: CampaignSettings, campaign: Campaign, points: set[str]
) -> Iterator[AttachedPart]:
    """Yield what each shaker has at each point and direction in which it pushes."""
    for name, table in settings.hammer.items():
        if table.mass is None and table.stinger is None:
            continue
        files = defaultdict[Dof, set[str]](set)
        for condition in (test.condition for test in campaign.tests):
            reference, is_of_shaker = condition.reference, condition.instrument == port_key(name)
            if is_of_shaker and isinstance(reference, Dof) and reference.point in points:
                files[reference].add(condition.test)
        if not files:
            raise InputError(
                f"{source}: hammer.{name}: a mass or stinger, but no test of it pushes at a point "
                "of the machine: name a site as reference, or remove them"
            )
        rod = Stinger(**table.stinger.model_dump()) if table.stinger else None
        for reference, tests in files.items():
            yield AttachedPart(
                f"hammer:{name}", reference, frozenset(tests), table.mass or 0.0, rod
            )
