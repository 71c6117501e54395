"""The model of a campaign with everything that can vary as Parts."""

from identification.words import Campaign, Dof
from mbmodel import (
    AddedPart,
    ChannelPart,
    HammerGainPart,
    HammerPart,
    Machine,
    Model,
    Part,
    RestPart,
    SensorPart,
    body_parts,
    hammer_gain_parts,
    hammer_parts,
    joint_parts,
    sensor_parts,
    spring_parts,
)
from mbmodel.parts import AttachedPart, ToleranceKind
from mbmodel.parts.change_rows import RowNames, fit_part


def build_toleranced_model(machine: Machine, campaign: Campaign) -> Model:
    """Return the model with everything that can vary as Parts.

    The Parts are springs, bodies, joints, sensors, each direction of the hammer, and each force
    channel or drive. Sensors that no test reads are left out.

    Args:
        campaign: tests, which say which sensors are read and where the hammer hits.
    """
    read_points = {dof.point for test in campaign.tests for dof in test.estimate.frf.outputs}
    directions = [dof for dof in campaign.outputs if isinstance(dof, Dof)]
    unknown = campaign.unknown_gains
    return Model(
        machine,
        (
            *spring_parts(machine),
            *body_parts(machine),
            *joint_parts(machine),
            *(
                part
                for part in sensor_parts(machine, directions, unknown.sensors)
                if part.point.name in read_points
            ),
            *_other_channel_parts(machine, campaign),
            *hammer_parts(machine, _forces_at_points(machine, campaign)),
            *_force_channel_parts(campaign),
        ),
    )


def _other_channel_parts(machine: Machine, campaign: Campaign) -> tuple[ChannelPart, ...]:
    """Return the gain and delay of each channel that is no direction of a sensor."""
    sensors, unknown = set(machine.layout.sensors), campaign.unknown_gains.sensors
    return tuple(
        ChannelPart(channel, "unknown_gain" if channel.point in unknown else "sensor_gain")
        for channel in campaign.outputs
        if channel.point not in sensors
    )


def _force_channel_parts(campaign: Campaign) -> tuple[HammerGainPart, ...]:
    """Return the gain and delay of each hammer and drive.

    Where only products of gains are seen, one hammer has the gain 1 by definition.
    """
    unknown = campaign.unknown_gains
    with_nominal = {
        gain.location.removeprefix("hammer:") for gain in unknown.nominal if gain.direction is None
    }
    parts: list[HammerGainPart] = []
    for name in dict.fromkeys(test.condition.instrument for test in campaign.tests):
        known: ToleranceKind = "exactly" if name in unknown.hammers else "hammer_gain"
        parts += hammer_gain_parts([name], "unknown_gain" if name in with_nominal else known)
    return tuple(parts)


def _forces_at_points(machine: Machine, campaign: Campaign) -> tuple[Dof, ...]:
    """Return the forces at points that the tests apply, whose place and direction can be off.

    A torque is the same wherever it acts on a solid body, and a motor acts as the model says.
    """
    return tuple(
        reference
        for reference in campaign.inputs
        if isinstance(reference, Dof)
        and not reference.is_rotation
        and reference.point in machine.layout.points
    )


# Places of Parts that belong to the machine, not to the measurement.
MACHINE_LOCATIONS = ("joint:", "tendon:", "body:")


def machine_alone(model: Model) -> Model:
    """Return a model without the Parts of the measurement: sensors, hammer and their channels."""
    places = (*MACHINE_LOCATIONS, "pair:")
    parts = [part for part in model.parts if part.location.startswith(places)]
    return Model(model.machine, tuple(parts))


def rebuild_for_machine(model: Model, machine: Machine) -> Model:
    """Return a model with equal Parts for a machine with more coordinates and bodies.

    Args:
        model: model from ``build_toleranced_model``.
        machine: machine that contains everything of the model's machine.
    """
    hit = tuple(part.dof for part in model.parts if isinstance(part, HammerPart))
    turning = (
        Dof.of(part.point.name, 3 + axis)
        for part in model.parts
        if isinstance(part, SensorPart)
        for axis in part.rotations
    )
    unknown = [
        part.point.name
        for part in model.parts
        if isinstance(part, SensorPart) and part.gain_known == "unknown_gain"
    ]
    parts: tuple[Part, ...] = (
        *spring_parts(machine),
        *body_parts(machine),
        *joint_parts(machine),
        *sensor_parts(machine, turning, unknown),
        *hammer_parts(machine, hit),
        *(
            part
            for part in model.parts
            if isinstance(part, HammerGainPart | ChannelPart | RestPart | AttachedPart)
        ),
    )
    by_parameters = {part.parameters: part for part in parts}
    names = RowNames.of(model.machine), RowNames.of(machine)
    by_parameters |= {  # causes that a machine before a change has
        part.parameters: fit_part(part, *names)
        for part in model.parts
        if isinstance(part, AddedPart)
    }
    return Model(machine, tuple(by_parameters[part.parameters] for part in model.parts))
