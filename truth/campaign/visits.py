"""Two visits to one machine: without its effects, and with them, as if they had come between.

What a machine has beside its effects, tolerances and small imperfections, is there at both visits.
The second visit differs from the first without any change, too:

* it is a few kelvin warmer or colder, which scales all springs;
* losses of joints and cables differ, all by one factor;
* sensors are mounted anew, and the hammer aims anew, by hand at the marks of the first visit;
* gains of the instruments have drifted.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from truth.campaign.cause import Draws
from truth.campaign.draw import Tolerances
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.virtual_test import (
    Plan,
    VirtualCampaign,
    draw_subject,
    measure_subject,
)
from truth.machine.settling import settle
from truth.machine.station import Hammer, Joint, Sensor, Station
from truth.random_streams import stream


@dataclass(frozen=True)
class VisitSpread:
    """Standard deviations of what differs between two visits to a machine.

    Args:
        stiffness: of ln of the factor on all stiffness: 0.3 % are 6 to 10 K.
        damping: of ln of the factor on all damping.
        gain: of ln of the gain of each channel, and of the force.
        remount: of places and angles, over the tolerances of drawn ones: at marks, half of them.
    """

    stiffness: float = 0.003
    damping: float = 0.03
    gain: float = 0.002
    remount: float = 0.5


VISIT_SPREAD = VisitSpread()


def draw_visits(nominal: Station, plan: Plan) -> tuple[VirtualCampaign, VirtualCampaign]:
    """Draw a machine, and test it before and after its effects have come.

    Args:
        nominal: nominal station.
        plan: what is made; its cause comes between the visits.

    Returns:
        Campaigns of both visits; the answer of the second is the change.

    Raises:
        TruthError: effect, place, node or protocol do not fit the station.
    """
    subject = draw_subject(nominal, plan)
    machine, seed = subject.machine, plan.seed
    before = replace(
        subject,
        machine=replace(machine, effects=subject.background.effects),
        draws=Draws((), 0),
    )
    after = replace(subject, machine=revisit(machine, plan.tolerance, seed))
    first_seed = int(stream(seed, "visit.first").integers(2**62))  # hits and noise of its own
    return (
        measure_subject(before, replace(plan, seed=first_seed), nominal.name),
        measure_subject(after, plan, nominal.name),
    )


def revisit(
    machine: TrueMachine, tolerance: Tolerances, seed: int, spread: VisitSpread = VISIT_SPREAD
) -> TrueMachine:
    """Return a machine at a second visit, without any change of its own.

    Args:
        machine: machine at the first visit.
        tolerance: tolerances of drawn places and angles.
        seed: seed of the random numbers.
        spread: standard deviations of what differs.
    """
    climate = np.exp(
        np.array([spread.stiffness, spread.damping])
        * stream(seed, "visit.climate").standard_normal(2)
    )
    random = stream(seed, "visit.remount")

    def warm(joint: Joint) -> Joint:
        return replace(
            joint,
            stiffness=joint.stiffness * float(climate[0]),
            damping=joint.damping * float(climate[1]),
        )

    station = machine.station.vary_joints(warm)
    stages = tuple(
        replace(
            stage,
            sensors=tuple(_remount(each, tolerance, random, spread) for each in stage.sensors),
        )
        for stage in station.stages
    )
    force = float(np.exp(spread.gain * random.standard_normal()))
    hammers = tuple(_aim(hammer, tolerance, random, spread, force) for hammer in machine.hammers)
    return replace(machine, station=settle(replace(station, stages=stages)), hammers=hammers)


def _remount(
    sensor: Sensor, tolerance: Tolerances, random: np.random.Generator, spread: VisitSpread
) -> Sensor:
    """Return a sensor that was mounted anew."""
    turn, shift, gain = random.standard_normal((3, 3))
    angle = Rotation.from_rotvec(spread.remount * tolerance.sensor_angle * turn)
    return replace(
        sensor,
        axes=sensor.axes @ angle.as_matrix().T,
        position=sensor.position + spread.remount * tolerance.sensor_position * shift,
        gain=sensor.gain * np.exp(spread.gain * gain),
    )


def _aim(
    hammer: Hammer,
    tolerance: Tolerances,
    random: np.random.Generator,
    spread: VisitSpread,
    force: float,
) -> Hammer:
    """Return the hits at a point and direction, aimed anew; a motor stays where it is."""
    turn, shift = random.standard_normal((2, 3))
    angle = Rotation.from_rotvec(spread.remount * tolerance.hammer_angle * turn)
    moved = replace(hammer, gain=hammer.gain * force)
    if hammer.along:
        return moved
    return replace(
        moved,
        position=hammer.position + spread.remount * tolerance.hammer_position * shift,
        direction=angle.as_matrix() @ hammer.direction,
    )
