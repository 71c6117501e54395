"""What is drawn has the stated spread, and each purpose has random numbers of its own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truth.campaign.draw import Tolerances, draw_basis, draw_drawing, draw_hammers, draw_true
from truth.errors import TruthError
from truth.machine.station import HitPoint, is_inertia
from truth.random_streams import stream

SEEDS = range(25)
TOLERANCE = Tolerances()


def spread_agrees(values: np.ndarray, expected: float) -> bool:
    """Mean zero and this standard deviation, to within four of their standard errors."""
    n = np.size(values)
    mean_is_zero = abs(np.mean(values)) < 4 * expected / np.sqrt(n)
    return bool(mean_is_zero and abs(np.std(values) / expected - 1) < 4 / np.sqrt(2 * n))


def joint_logs(one, other, quantity):
    return [
        np.log(getattr(a, quantity) / getattr(b, quantity))
        for s, t in zip(one.stages, other.stages, strict=True)
        for a, b in zip(s.joints, t.joints, strict=True)
    ]


@pytest.fixture(scope="module")
def drawn(nominal):
    """For each seed: basis, drawing, true machine."""
    bases = [draw_basis(nominal, seed) for seed in SEEDS]
    return [
        (basis, draw_drawing(basis, seed), draw_true(basis, TOLERANCE, seed))
        for seed, basis in zip(SEEDS, bases, strict=True)
    ]


def test_machines_spread_about_the_nominal_one(nominal, drawn):
    masses = [
        np.log(a.mass / b.mass)
        for basis, _, _ in drawn
        for a, b in zip(basis.stages, nominal.stages, strict=True)
    ]
    assert spread_agrees(np.array(masses), 0.1)
    for quantity in ("stiffness", "damping"):
        logs = [joint_logs(basis, nominal, quantity) for basis, _, _ in drawn]
        assert spread_agrees(np.array(logs), 0.3)


@pytest.mark.parametrize(("quantity", "spread"), [("stiffness", 0.3), ("damping", 0.5)])
def test_the_drawing_is_off_by_the_stated_spread(drawn, quantity, spread):
    logs = [joint_logs(drawing, true, quantity) for _, drawing, true in drawn]
    assert spread_agrees(np.array(logs), spread)


def test_the_drawing_has_the_masses_and_places_of_the_basis(drawn):
    basis, drawing, _ = drawn[0]
    for a, b in zip(basis.stages, drawing.stages, strict=True):
        assert a.mass == b.mass
        assert np.array_equal(a.inertia, b.inertia)
        assert np.array_equal(a.com, b.com)
        assert a.sensors is b.sensors
        assert all(
            np.array_equal(x.position, y.position) for x, y in zip(a.joints, b.joints, strict=True)
        )


def test_bodies_are_off_by_their_tolerances(drawn):
    pairs = [
        (t, d)
        for _, drawing, true in drawn
        for t, d in zip(true.stages, drawing.stages, strict=True)
    ]
    assert spread_agrees(np.array([t.mass / d.mass - 1 for t, d in pairs]), 0.02)
    assert spread_agrees(np.array([t.com - d.com for t, d in pairs]), 0.003)
    inertia = np.array([np.diag(t.inertia) / np.diag(d.inertia) - 1 for t, d in pairs])
    # Draws that no body can have are drawn again, which takes a little off the spread.
    assert 0.04 < inertia.std() < 0.053
    assert all(is_inertia(t.inertia) for t, _ in pairs)


def test_a_joints_six_axes_share_one_shift(drawn):
    shifts = []
    for _, drawing, true in drawn:
        for t, d in zip(true.stages, drawing.stages, strict=True):
            each = [a.position - b.position for a, b in zip(t.joints, d.joints, strict=True)]
            np.testing.assert_allclose(each, np.tile(each[0], (6, 1)), atol=1e-15)
            shifts.append(each[0])
    assert spread_agrees(np.array(shifts), 0.003)


def test_sensors_are_off_by_their_tolerances(drawn):
    pairs = [
        (t, d)
        for _, drawing, true in drawn
        for (_, t), (_, d) in zip(true.sensors(), drawing.sensors(), strict=True)
    ]
    assert spread_agrees(np.array([t.gain - 1 for t, _ in pairs]), 0.01)
    assert spread_agrees(np.array([t.position - d.position for t, d in pairs]), 0.0015)
    # The rows of axes are R e_i, so R = axes^T.
    turns = Rotation.from_matrix(np.array([t.axes.T for t, _ in pairs])).as_rotvec()
    assert spread_agrees(turns, 0.01745)


def test_each_hammer_direction_is_off_on_its_own(drawn):
    hits = [
        draw_hammers(d, 11, TOLERANCE, seed) for seed, (_, d, _) in zip(SEEDS, drawn, strict=True)
    ]
    stage, aim = drawn[0][1].aim(11)
    assert {hammer.stage for three in hits for hammer in three} == {stage}
    places = np.array([[hammer.position - aim for hammer in three] for three in hits])
    assert spread_agrees(places, 0.003)
    assert not np.array_equal(places[:, 0], places[:, 1])
    directions = np.array([[hammer.direction for hammer in three] for three in hits])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=2), 1, rtol=1e-12)
    across = directions[:, ~np.eye(3, dtype=bool)]
    # A direction turned by a rotation vector moves across by its two other components.
    assert spread_agrees(across, 0.01745)


def test_the_hammer_prefers_its_own_site(two_bodies):
    upper = replace(two_bodies.stages[1], hit_points=(HitPoint(1, np.array([0.0, 0, 1])),))
    station = replace(two_bodies, stages=(two_bodies.stages[0], upper))
    assert station.aim(1)[0] == 1
    assert two_bodies.aim(1)[0] == 0
    with pytest.raises(TruthError, match="hit99 or acc99"):
        station.aim(99)


def test_an_inertia_at_its_border_stays_one_of_a_solid_body(one_body):
    # A flat disc: one moment is exactly the sum of the others.
    disc = replace(one_body.stages[0], inertia=np.diag([1.0, 1.0, 2.0]))
    station = replace(one_body, stages=(disc,))
    for seed in range(50):
        assert is_inertia(draw_true(station, TOLERANCE, seed).stages[0].inertia)


def test_without_tolerance_the_true_machine_is_the_basis(drawn):
    basis = drawn[0][0]
    true = draw_true(basis, Tolerances(*[0.0] * 9), 3)
    for a, b in zip(true.stages, basis.stages, strict=True):
        assert a.mass == b.mass
        np.testing.assert_array_equal(a.inertia, b.inertia)
        for s, t in zip(a.sensors, b.sensors, strict=True):
            np.testing.assert_array_equal(s.axes, t.axes)
            np.testing.assert_array_equal(s.position, t.position)


def test_each_purpose_has_random_numbers_of_its_own():
    one = stream(7, "a").standard_normal(4)
    stream(7, "b").standard_normal(100)  # another purpose, drawing any amount
    np.testing.assert_array_equal(stream(7, "a").standard_normal(4), one)
    for other in (stream(7, "b"), stream(8, "a"), stream(7, "aa")):
        assert not np.array_equal(other.standard_normal(4), one)
