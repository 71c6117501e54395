"""Joints whose force depends on frequency, against closed forms; how much delay a machine bears."""

from dataclasses import replace

import numpy as np
import pytest
from effect_rigs import FREQ, chain, frf_of, machine_of, random_of, rig_of, scene_of
from hypothesis import given
from hypothesis import strategies as st

from truth.campaign.draw import Tolerances, draw_basis, draw_true
from truth.effects.feedback_delay import (
    FeedbackDelay,
    draw_feedback_delay,
    largest_coupling,
    longest_delay,
    poles,
)
from truth.effects.frequency_laws import (
    StructuralDamping,
    Viscoelastic,
    draw_structural_damping,
    draw_viscoelastic,
)
from truth.effects.places import StageDirection, joint_stretch
from truth.errors import TruthError

W = 2 * np.pi * FREQ
S = 1j * W


def block(station, stiffness, damping):
    """Accelerance of the one body along an axis through its centre of mass."""
    return S**2 / (station.stages[0].mass * S**2 + damping * S + stiffness)


@pytest.mark.parametrize(("eta", "share", "left"), [(0.1, 0.25, 0.25), (0.02, 0.25, 0.7)])
def test_a_structural_loss_turns_the_stiffness_and_leaves_some_viscous(one_body, eta, share, left):
    # Of the damper 1 - (1 - share) min(1, eta / 0.05) is left.
    effect = StructuralDamping(stage="table", share=share, size=eta)
    H = frf_of(one_body, effect, occasions=scene_of(one_body, 3).occasions)
    for axis, joint in enumerate(one_body.stages[0].joints[:3]):
        expected = block(one_body, joint.stiffness * (1 + 1j * eta), left * joint.damping)
        np.testing.assert_allclose(H[:, axis, axis], expected, rtol=1e-10)
    assert effect.answer().parameters == {"loss_factor": eta}


def test_a_structural_loss_is_the_conjugate_at_negative_frequencies():
    rig = rig_of(chain(), [StructuralDamping(stage="arm", share=1.0, size=0.1)])
    for law in rig.laws:
        np.testing.assert_array_equal(law.stiffness(-S), law.stiffness(S).conj())
    assert len(rig.laws) == 6


def test_a_maxwell_branch_is_a_spring_on_a_damper(two_bodies):
    # A massless point, held to the body by r k and to the parent by a damper r k tau.
    effect = Viscoelastic(stage="holder", tau=2e-3, size=0.4)
    rig, rows = rig_of(two_bodies), None
    tested = machine_of(two_bodies)
    for number, joint in enumerate(two_bodies.stages[1].joints):
        rig = rig.with_coordinate()
        rows = joint_stretch(rig, tested, 1)
        spring, damper = rows[number].copy(), np.zeros(rows.shape[1])
        spring[-1], damper[-1] = -1.0, 1.0
        branch = 0.4 * joint.stiffness
        rig = rig.with_matrices(
            damping=branch * 2e-3 * np.outer(damper, damper),
            stiffness=branch * np.outer(spring, spring),
        )
    matrix = rig.equations.stiffness + S[:, None, None] * rig.equations.damping
    matrix = matrix + S[:, None, None] ** 2 * rig.equations.mass
    expected = rig.readout @ np.linalg.solve(matrix, rig.drive[None].astype(complex))
    np.testing.assert_allclose(
        frf_of(two_bodies, effect), S[:, None, None] ** 2 * expected, rtol=1e-8
    )
    assert effect.answer().parameters == {"ratio": 0.4, "tau": 2e-3}


def test_a_maxwell_branch_may_stand_beside_one_spring_alone(one_body):
    effect = Viscoelastic(stage="table", tau=2e-3, dof="tz", size=0.4)
    H = frf_of(one_body, effect, occasions=scene_of(one_body, 3).occasions)
    for axis, joint in enumerate(one_body.stages[0].joints[:3]):
        branch = 0.4 * S * 2e-3 / (1 + S * 2e-3) if axis == 2 else 0.0
        expected = block(one_body, joint.stiffness * (1 + branch), joint.damping)
        np.testing.assert_allclose(H[:, axis, axis], expected, rtol=1e-10)
    assert effect.answer().dof == "tz"


def test_one_spring_or_all_of_them_get_a_branch():
    dofs = [draw_viscoelastic(random_of(s), scene_of(chain()), "joint:arm").dof for s in range(60)]
    assert 15 < dofs.count("") < 45
    assert len(set(dofs)) == 7


def test_time_constants_have_their_loss_in_the_measured_band(nominal):
    scene = scene_of(nominal, 11)
    corners = [
        1 / (2 * np.pi * draw_viscoelastic(random_of(s), scene, None).tau) for s in range(99)
    ]
    assert 10 <= min(corners) < 20
    assert 100 < max(corners) <= 150


def test_what_remains_of_viscous_damping_is_anything_from_nothing_to_all(nominal):
    scene = scene_of(nominal, 11)
    shares = [draw_structural_damping(random_of(s), scene, None).share for s in range(99)]
    assert 0 <= min(shares) < 0.1
    assert 0.9 < max(shares) <= 1
    with pytest.raises(TruthError, match="make no sense"):
        StructuralDamping(stage="arm", share=1.2, size=0.1)


def test_a_late_spring_pushes_by_what_was(one_body):
    where = StageDirection("table", 1, "ty")
    effect = FeedbackDelay(where, longest=1e-3, size=4e-4)
    H = frf_of(one_body, effect, occasions=scene_of(one_body, 3).occasions)
    joint = one_body.stages[0].joints[1]
    expected = block(one_body, joint.stiffness * np.exp(-S * 4e-4), joint.damping)
    np.testing.assert_allclose(H[:, 1, 1], expected, rtol=1e-9)
    plain = frf_of(one_body, occasions=scene_of(one_body, 3).occasions)
    np.testing.assert_allclose(H[:, 0, 0], plain[:, 0, 0], rtol=1e-12)
    answer = effect.answer()
    assert (answer.location, answer.dof) == ("joint:table", "ty")
    assert answer.parameters == {"delay": 4e-4}
    assert effect.limits == (pytest.approx(1e-7), 1e-3)


def late_poles(rig, row, stiffness, delay, *, parts=4):
    """Poles with the delay as a chain of all-passes (a - s)/(a + s), a = 2 parts / delay."""
    mass, damping, K = rig.equations.mass, rig.equations.damping, rig.equations.stiffness
    n, a = len(mass), 2 * parts / delay
    A = np.zeros((2 * n + parts, 2 * n + parts))
    A[:n, n : 2 * n] = np.eye(n)
    signal = np.concatenate([row, np.zeros(n + parts)])
    felt = signal
    for part in range(parts):
        A[2 * n + part] = 2 * a * signal
        A[2 * n + part, 2 * n + part] -= a
        signal = -signal
        signal[2 * n + part] += 1
    A[n : 2 * n, :n] = -np.linalg.solve(mass, K)
    A[n : 2 * n, n : 2 * n] = -np.linalg.solve(mass, damping)
    A[n : 2 * n] -= np.outer(np.linalg.solve(mass, row), stiffness * (signal - felt))
    return np.linalg.eigvals(A)


@pytest.mark.parametrize("seed", range(2))
def test_every_spring_of_the_station_bears_its_longest_delay_and_a_third_more_is_too_much(
    nominal, seed
):
    station = draw_true(draw_basis(nominal, seed), Tolerances(), seed)
    tested = machine_of(station, node=11)
    rig = rig_of(station, node=11)
    for index, stage in enumerate(station.stages):
        for joint, row in zip(stage.joints, joint_stretch(rig, tested, index), strict=True):
            longest = longest_delay(rig, row, joint.stiffness)
            assert longest >= 0.8 * joint.damping / joint.stiffness
            assert late_poles(rig, row, joint.stiffness, longest).real.max() < 0
            assert late_poles(rig, row, joint.stiffness, longest / 0.75).real.max() > 0


def test_the_longest_delay_of_one_mass_is_that_of_the_textbook(one_body):
    # On the axis m w^2 = k cos(w tau) and c w = k sin(w tau), so m^2 w^4 + c^2 w^2 = k^2.
    rig, joint = rig_of(one_body), one_body.stages[0].joints[2]
    m, c, k = one_body.stages[0].mass, joint.damping, joint.stiffness
    w = np.sqrt((np.sqrt(c**4 + 4 * m**2 * k**2) - c**2) / (2 * m**2))
    critical = np.arctan2(c * w, m * w**2) / w
    assert longest_delay(rig, np.eye(6)[2], k) == pytest.approx(0.8 * critical, rel=1e-5)


def test_a_drawn_delay_leaves_room_and_an_undamped_spring_has_none(nominal):
    scene = scene_of(nominal, 11)
    for seed in range(20):
        effect = draw_feedback_delay(random_of(seed), scene, None)
        assert 0.2 <= effect.size / effect.longest <= 0.7
        assert effect.longest < 0.02
    stages = tuple(
        replace(stage, joints=tuple(replace(one, damping=0.0) for one in stage.joints))
        for stage in chain().stages
    )
    assert (
        draw_feedback_delay(random_of(1), scene_of(replace(chain(), stages=stages)), None) is None
    )


def test_the_largest_coupling_of_two_dampers_is_exact():
    # Fed back on itself a speed takes from the damper: unstable as the mode's damping is used up.
    rig = rig_of(chain())
    row = joint_stretch(rig, machine_of(chain()), 1)[1]
    largest = largest_coupling(rig, row, -row)
    for part, stable in ((0.99, True), (1.01, False)):
        fed = rig.with_matrices(damping=-part * largest / 0.8 * np.outer(row, row))
        assert (poles(fed).real.max() < 0) == stable
    assert largest_coupling(rig, row, row) == np.inf


@given(st.floats(1, 300), st.floats(0.001, 0.9))
def test_poles_are_those_of_the_textbook(frequency, damping):
    rig = rig_of(chain())
    one = replace(
        rig,
        equations=replace(
            rig.equations,
            mass=np.eye(18),
            damping=2 * damping * 2 * np.pi * frequency * np.eye(18),
            stiffness=(2 * np.pi * frequency) ** 2 * np.eye(18),
        ),
    )
    found = poles(one)
    np.testing.assert_allclose(np.abs(found), 2 * np.pi * frequency, rtol=1e-6)
    np.testing.assert_allclose(-found.real / np.abs(found), damping, rtol=1e-5)
    assert len(found) == 36
