"""Two visits to one machine: what stays, what differs, and what comes between."""

from pathlib import Path

import numpy as np
import pytest

from truth import Cause, Plan, Protocol, Wanted, read_station
from truth.campaign.draw import NO_TOLERANCE, REAL_INSTRUMENTS
from truth.campaign.measure import hammer_tests
from truth.campaign.virtual_test import draw_subject
from truth.campaign.visits import VISIT_SPREAD, VisitSpread, draw_visits, revisit

STATION = read_station(Path(__file__).parents[2] / "assets" / "microstation" / "station.xml")
SHORT = Protocol(nodes=(11,), lines=101, resolution_hz=1.0)


def plan(effect="mass_error", seed=31):
    wanted = (Wanted(effect),) if effect else ()
    return Plan(seed, Cause(wanted), SHORT, REAL_INSTRUMENTS)


def test_without_any_spread_the_second_visit_is_the_first():
    subject = draw_subject(STATION, plan())
    still = VisitSpread(0.0, 0.0, 0.0, 0.0)
    again = revisit(subject.machine, REAL_INSTRUMENTS, 5, still)
    first, second = (
        hammer_tests(machine, SHORT, subject.files, 5)[0].frf
        for machine in (subject.machine, again)
    )
    np.testing.assert_allclose(second, first, rtol=1e-9)


def test_springs_share_one_factor_and_masses_stay():
    subject = draw_subject(STATION, plan())
    again = revisit(subject.machine, NO_TOLERANCE, 5)
    pairs = [
        (joint.stiffness / old.stiffness, joint.damping / old.damping)
        for stage, before in zip(again.station.stages, subject.machine.station.stages, strict=True)
        for joint, old in zip(stage.joints, before.joints, strict=True)
        if old.stiffness > 0 and old.damping > 0
    ]
    stiffness, damping = np.array(pairs).T
    assert np.ptp(stiffness) < 1e-12
    assert np.ptp(damping) < 1e-12
    assert 0 < abs(np.log(stiffness[0])) < 4 * VISIT_SPREAD.stiffness
    masses = [[stage.mass for stage in m.station.stages] for m in (again, subject.machine)]
    assert masses[0] == masses[1]
    hammer, old = again.hammers[0], subject.machine.hammers[0]
    np.testing.assert_array_equal(hammer.position, old.position)
    assert hammer.gain != old.gain


def test_sensors_are_mounted_anew_within_half_their_tolerance():
    subject = draw_subject(STATION, plan())
    moves = []
    for seed in range(20):
        again = revisit(subject.machine, REAL_INSTRUMENTS, seed)
        for (_, sensor), (_, old) in zip(
            again.station.sensors(), subject.machine.station.sensors(), strict=True
        ):
            moves.append(sensor.position - old.position)
    deviation = VISIT_SPREAD.remount * REAL_INSTRUMENTS.sensor_position
    assert np.std(moves) == pytest.approx(deviation, rel=0.1)


def test_the_effect_comes_between_the_visits_and_is_the_answer_of_the_second():
    before, after = draw_visits(STATION, plan())
    assert 'effect = "none"' in before.answer.decode()
    assert 'effect = "mass_error"' in after.answer.decode()
    assert before.files["model.xml"] == after.files["model.xml"]
    assert before.files["campaign.toml"] == after.files["campaign.toml"]
    measured = [
        visit.files[name] for visit in (before, after) for name in visit.files if ".uff" in name
    ]
    assert len(set(measured)) == 2
