"""The machine of a campaign: its variants, its control loops, and the ports that tests name."""

from dataclasses import replace
from functools import partial
from pathlib import Path

from identification import correct_layout
from identification.readers.campaign_toml import CampaignSettings
from identification.words import Campaign, InputError, UsageError
from mbmodel import (
    Machine,
    StatedLaws,
    load_machine,
    with_loops,
    with_spring_laws,
    with_variants,
)
from mbmodel.ports.ports import find_ports
from tuning.control_loops.read_loops import read_loops
from tuning.control_loops.stability import check_nominal_loops


def with_drawn_laws(source: Path, settings: CampaignSettings, machine: Machine) -> Machine:
    """Return a machine of a campaign with the laws of springs that campaign.toml states.

    Args:
        source: path of campaign.toml.
        machine: nominal machine, or one of a test.

    Raises:
        InputError: a spring that the machine does not have.
    """
    stated = {
        name: StatedLaws(
            table.loss_factor, tuple((branch.ratio, branch.tau) for branch in table.maxwell)
        )
        for name, table in settings.spring.items()
    }
    return with_spring_laws(machine, stated, str(source))


def load_variants(source: Path, settings: CampaignSettings, machine: Machine) -> dict[str, Machine]:
    """Return the machines of tests that have a model or a pose of their own, by variant.

    Args:
        source: path of campaign.toml.
        machine: of the campaign.

    Raises:
        InputError: a model that cannot be read, or a pose that it does not have.
    """
    variants: dict[str, Machine] = {}
    for entry in settings.test:
        if not entry.variant or entry.variant in variants:
            continue
        path = machine.source if entry.model is None else source.parent / entry.model
        variant = load_machine(path, key=machine.keyframe, pose=entry.pose)
        layout = correct_layout(source, settings, variant.layout)
        variant = with_drawn_laws(source, settings, variant)
        variants[entry.variant] = replace(variant, layout=layout)
    return variants


def state_machine(source: Path, settings: CampaignSettings, machine: Machine) -> Machine:
    """Return a machine with sensors, laws and variants as campaign.toml states them, loops open.

    Args:
        source: path of campaign.toml.
        machine: of the MJCF alone.

    Raises:
        InputError: a spring, model or pose that cannot be used.
    """
    correct = partial(correct_layout, source, settings)
    machine = replace(machine, layout=correct(machine.layout), correct=correct)
    machine = with_drawn_laws(source, settings, machine)
    return with_variants(machine, load_variants(source, settings, machine))


def close_loops(
    source: Path, machine: Machine, settings: CampaignSettings
) -> tuple[Machine, list[str]]:
    """Return the machine with the loops of campaign.toml closed, and remarks on them.

    Raises:
        InputError: a port, a controller, or an unstable nominal machine.
    """
    try:
        machine = with_loops(machine, read_loops(source, machine, settings.loop))
        trusted = {name for name, table in settings.loop.items() if table.as_stated}
        remarks = [
            f"loop.{loop.name} was closed during the test, from {loop.measured} to {loop.input}"
            + (f", {loop.delay:g} s late" if loop.delay else "")
            for loop in machine.loops
        ]
        remarks += check_nominal_loops(machine, trusted) if settings.loop else []
    except UsageError as error:
        raise InputError(f"{source}: {error}") from error
    except InputError as error:
        text = str(error)
        raise InputError(text if str(source.parent) in text else f"{source}: {text}") from error
    return machine, remarks


def refuse_unknown_ports(source: Path, machine: Machine, campaign: Campaign) -> None:
    """Raise InputError for a channel or reference that is no port of the model.

    A channel that reads forces, or the weight that a tilting accelerometer feels, is refused too:
    its derivatives by the parameters are not known.
    """
    for side, ports in (("channel", campaign.outputs), ("reference", campaign.inputs)):
        for port in ports:
            outputs, inputs = ((port,), ()) if side == "channel" else ((), (port,))
            try:
                ports_there = find_ports(machine, outputs, inputs)
            except UsageError as error:
                raise InputError(f"{source}: {side} {error}") from error
            if ports_there.further is not None:
                raise InputError(
                    f"{source}: channel {str(port)!r} reads forces or the weight in a tilting "
                    "sensor, which only mbw predict handles: name its site or joint instead"
                )
    for test in campaign.tests:
        variant = machine.variants.get(test.condition.variant)
        if variant is None:
            continue
        try:
            find_ports(variant, test.estimate.frf.outputs, (test.condition.reference,))
        except UsageError as error:
            raise InputError(
                f"{source}: {test.condition.test} with {test.condition.variant}: {error}"
            ) from error
