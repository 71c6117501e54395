"""Nonlinear joints against another integrator, against closed forms, and at vanishing level."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_tests, pulse_spectra
from truth.campaign.protocol import Protocol, takes
from truth.effects.joint_laws import Backlash, Cubic, Friction, Hardening, Jenkins, Play
from truth.effects.outside import Rocking
from truth.effects.places import StageDirection
from truth.errors import TruthError
from truth.machine.nonlinear import HalfSinePulses, nonlinear_readings, rest_forces
from truth.machine.rig import FrequencyLaw, NonlinearJoint, Occasion, Rig, accelerance
from truth.machine.station import GROUND, Hammer, Joint, Sensor, StageBody, Station

MASS, SPRING, DAMPER = 12.0, 4e5, 270.0  # 29 Hz, 6 %
LEVEL, SECONDS, RATE = 300.0, 1.0, 8192.0
X = StageDirection("block", 0, "tx")
PULSE = HalfSinePulses(np.array([LEVEL]), np.array([5.7e-3]))
PEAK = 1e-4  # m, about what the hit moves the block


@pytest.fixture(scope="module")
def block():
    """A mass on one spring: rigid in five directions."""
    joint = Joint("block_tx", "slide", np.eye(3)[0], np.zeros(3), SPRING, DAMPER)
    stage = StageBody(
        "block", GROUND, MASS, np.zeros(3), np.eye(3), (joint,), (Sensor(1, np.zeros(3)),)
    )
    return Station("one", (stage,))


def machine(station, *effects):
    hammers = tuple(Hammer(1, 0, np.zeros(3), axis) for axis in np.eye(3))
    return TrueMachine(station, hammers, effects)


def integrated(law, extra=0.0):
    """The stretch by a Runge-Kutta method of high order, the state of the law put in by hand."""

    def slope(time, motion):
        x, v = motion
        force = PULSE.at(time)[0] - (SPRING + extra) * x - DAMPER * v
        return [v, (force - law.force(np.array([x]), np.zeros(1))[0][0]) / MASS]

    times = np.arange(round(SECONDS * RATE) + 1) / RATE
    ends = [0.0, 5.7e-3, SECONDS]
    parts, start = [np.zeros((2, 1))], np.zeros(2)
    for first, last in pairwise(ends):
        inside = times[(times > first) & (times <= last)]
        found = solve_ivp(
            slope,
            (first, last),
            start,
            "DOP853",
            np.unique(np.append(inside, last)),
            rtol=1e-11,
            atol=1e-16,
            max_step=1 / RATE,
        )
        parts.append(found.y[:, : len(inside)])
        start = found.y[:, -1]
    return np.hstack(parts)[0]


@pytest.mark.parametrize(
    ("effect", "law"),
    [
        (
            Hardening(direction=X, spring=SPRING, peak=PEAK, size=0.8),
            Cubic(0.8 * SPRING / PEAK**2),
        ),
        (Backlash(direction=X, spring=SPRING, peak=PEAK, size=0.2), Play(SPRING, 0.2 * PEAK)),
    ],
)
def test_the_force_in_time_is_that_of_another_integrator(block, effect, law):
    rig = machine(block, effect).rig(Occasion(node=1))
    stretch = integrated(law)
    expected = law.force(stretch, np.zeros_like(stretch))[0]
    coarse, fine = (
        rest_forces(rig, (0,), PULSE, SECONDS, finer * RATE)[0, 0, ::finer] for finer in (1, 4)
    )
    errors = [np.abs(rest - expected).max() / np.abs(expected).max() for rest in (coarse, fine)]
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 8  # of second order: a sixteenth


def test_finer_steps_change_little(block):
    effect = Friction(direction=X, spring=SPRING, size=0.5, limit=3.0)
    rig = machine(block, effect).rig(Occasion(node=1))
    coarse = rest_forces(rig, (0,), PULSE, SECONDS, RATE)[0, 0]
    fine = rest_forces(rig, (0,), PULSE, SECONDS, 8 * RATE)[0, 0, ::8]
    assert np.abs(coarse).max() > 5.0
    np.testing.assert_allclose(coarse, fine, atol=1e-3 * np.abs(fine).max())


def test_a_jenkins_element_goes_round_its_hysteresis_loop():
    # Masing: the loop of a stretch between +-a encloses 4 F (a - F / k).
    law, stretch = Jenkins(2e6, 10.0), 1.2e-5 * np.sin(np.linspace(0, 4 * np.pi, 40001))
    state, forces = law.start(1), []
    for x in stretch:
        rest, state = law.force(np.array([x]), state)
        forces.append(law.stiffness * x + rest[0])
    forces = np.array(forces)
    assert np.abs(forces).max() == pytest.approx(10.0)
    last = slice(20000, None)
    area = np.trapezoid(forces[last], stretch[last])
    assert area == pytest.approx(4 * 10.0 * (1.2e-5 - 10.0 / 2e6), rel=1e-3)


def test_a_rocking_contact_loses_stiffness_beyond_its_edge():
    law = Rocking(3.0, 0.2)
    angles = np.array([-0.5, -0.1, 0.0, 0.2, 0.3])
    rest, _ = law.force(angles, law.start(5))
    np.testing.assert_allclose(rest, [0.9, 0.0, 0.0, 0.0, -0.3], atol=1e-15)


def test_the_spectrum_is_that_of_the_motion_in_time(block):
    # Everything decays within the block, so its transform is known from the samples alone.
    effect = Hardening(direction=X, spring=SPRING, peak=PEAK, size=0.8)
    rig = machine(block, effect).rig(Occasion(node=1))
    lines = np.arange(0, 101.0)
    force = pulse_spectra(lines, PULSE)[0]
    whole = accelerance(rig, lines)[:, 0, 0] * force
    whole = whole + nonlinear_readings(rig, (0,), PULSE, lines)[0, :, 0]
    stretch = integrated(Cubic(0.8 * SPRING / PEAK**2))
    spectrum = np.fft.fft(stretch[:-1])[:101] / RATE
    expected = -((2 * np.pi * lines) ** 2) * spectrum
    np.testing.assert_allclose(whole, expected, atol=3e-3 * np.abs(expected).max())


def test_a_rest_that_stays_has_the_transform_of_a_step():
    # Friction that slips once and sticks: a step of the rest's force at the second sample.
    class Once:
        def start(self, count):
            return np.zeros(count)

        def force(self, stretch, state):
            return np.where(stretch > 0, 1.0, 0.0), state

    joint = Joint("b_tx", "slide", np.eye(3)[0], np.zeros(3), 0.0, 1e6)  # creeps, never returns
    stage = StageBody(
        "block", GROUND, 1.0, np.zeros(3), np.eye(3), (joint,), (Sensor(1, np.zeros(3)),)
    )
    plain = machine(Station("creep", (stage,))).rig(Occasion(node=1))
    rig = Rig(
        plain.equations,
        plain.readout,
        plain.drive,
        joints=(NonlinearJoint(np.eye(6)[0], Once()),),
    )
    lines = np.arange(0, 51.0)
    found = nonlinear_readings(rig, (0,), PULSE, lines)[0, 1:, 0]
    s = 2j * np.pi * lines[1:]
    ramp = -np.expm1(-s / RATE) * RATE / s  # from 0 to 1 within one sample
    np.testing.assert_allclose(found, -accelerance(plain, lines)[1:, 0, 0] * ramp / s, rtol=1e-6)


@pytest.mark.parametrize(
    ("effect", "twin"),
    [
        (Hardening(direction=X, spring=SPRING, peak=PEAK, size=0.8), 1.0),
        (Friction(direction=X, spring=SPRING, size=0.5, limit=3.0), 1.5),
        (Backlash(direction=X, spring=SPRING, peak=PEAK, size=0.2), 0.0),
    ],
)
def test_at_vanishing_level_the_linear_twin_is_measured(block, effect, twin):
    # The same hits and the same noise: what is left is what the joint does, far below the noise.
    # The spring of the twin: the joint's own, with the stuck element, or none within the gap.
    protocol = Protocol((1,), levels=(LEVEL * 1e-4,), lines=201, resolution_hz=0.5)
    (joint,) = block.stages[0].joints
    spring = Joint(joint.name, "slide", joint.axis, joint.position, twin * SPRING, DAMPER)
    (stage,) = block.stages
    linear = Station(
        "twin",
        (StageBody("block", GROUND, MASS, stage.com, stage.inertia, (spring,), stage.sensors),),
    )
    (take,) = takes(protocol, block, 1)
    (found,) = hammer_tests(machine(block, effect), protocol, (take,), 5)
    (expected,) = hammer_tests(machine(linear), protocol, (take,), 5)
    moving = expected.coherence[1:, 0, 0] > 0
    noise = np.sqrt((1 - expected.coherence[1:, 0, 0]) / expected.coherence[1:, 0, 0] / 9)
    off = np.abs(found.frf - expected.frf)[1:, 0, 0] / np.abs(expected.frf[1:, 0, 0])
    assert (off[moving] < np.maximum(0.1 * noise[moving], 1e-6)).all()


def test_hits_that_go_together_are_each_as_alone(block):
    effect = Backlash(direction=X, spring=SPRING, peak=PEAK, size=0.2)
    rig = machine(block, effect).rig(Occasion(node=1))
    lines = np.arange(0, 51.0)
    both = HalfSinePulses(np.array([LEVEL, 2 * LEVEL]), np.array([5.7e-3, 4.9e-3]))
    together = nonlinear_readings(rig, (0, 0), both, lines)
    for number in range(2):
        one = HalfSinePulses(both.peak[number : number + 1], both.duration[number : number + 1])
        alone = nonlinear_readings(rig, (0,), one, lines)[0]
        np.testing.assert_allclose(together[number], alone, atol=1e-7 * np.abs(alone).max())


def test_a_stiffness_of_frequency_is_refused_in_time(block):
    effect = Backlash(direction=X, spring=SPRING, peak=PEAK, size=0.2)
    rig = machine(block, effect).rig(Occasion(node=1))
    law = FrequencyLaw(np.eye(6)[0], np.eye(6)[0], lambda s: 1e3 * s**0.5)
    both = Rig(rig.equations, rig.readout, rig.drive, (law,), (), rig.joints)
    with pytest.raises(TruthError, match="no place in the time domain"):
        rest_forces(both, (0,), PULSE, SECONDS, RATE)
