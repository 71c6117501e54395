"""Where refits of laws begin: the rank-one update of a joint, and laws fitted alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.hypothesis import Scene
from diagnosis.levels import joint_transient, refit_laws, tested_joint
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.joint_update import JointUpdate
from diagnosis.levels.law_family import HARDENING
from diagnosis.levels.law_simulation import LawUnderHits, compute_equivalent_stiffness
from diagnosis.levels.law_starts import fit_starts
from diagnosis.levels.restoring_laws import CubicLaw
from diagnosis.levels.settings import LEVEL_SETTINGS
from mbmodel import Model
from mbmodel.assembly import Matrices
from tests.helpers.nonlinear_joint import JOINT, LEVELS, build_transient
from tests.helpers.nonlinear_mass import (
    DAMPING,
    FREQ_HZ,
    MASS_KG,
    PULSE_S,
    STIFFNESS,
    level_campaign,
    nonlinear_block,
    session_of,
)
from tuning import predict


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Model:
    return nonlinear_block(tmp_path_factory.mktemp("mass"))


def scene_of(block, force=None):
    session = session_of(block, level_campaign(block, force, LEVELS))
    return Scene(session, session.model.drawn)


def test_an_update_is_the_model_with_another_stiffness_and_damping(block):
    scene = scene_of(block)
    campaign, names = scene.session.campaign, [p.name for p in scene.model.parameters]
    update = JointUpdate.of_scene(
        scene, JOINT, tested_joint.TestedJoint.of_scene(scene, JOINT), campaign
    )
    theta = scene.theta.copy()
    theta[names.index("block_tz.stiffness")] *= 0.6
    theta[names.index("block_tz.damping")] *= 3.0
    added = -0.4 * STIFFNESS + 2j * np.pi * FREQ_HZ * 2.0 * DAMPING
    residuals = update.residuals(np.tile(added, (len(campaign.tests), 1)))
    expected = [
        (values - test.estimate.frf.values)[:, test.estimate.measured].ravel()
        for values, test in zip(predict(scene.model, theta, campaign), campaign.tests, strict=True)
    ]
    scale = np.abs(np.concatenate(expected)).max()
    assert len(residuals) == sum(map(len, expected))
    np.testing.assert_allclose(
        np.sort(np.abs(residuals)), np.sort(np.abs(np.concatenate(expected))), atol=1e-8 * scale
    )


def test_a_law_that_gives_way_has_residuals_that_are_not_finite(block):
    scene = scene_of(block)
    tested = tested_joint.TestedJoint.of_scene(scene, JOINT)
    update = JointUpdate.of_scene(scene, JOINT, tested, scene.session.campaign)
    added = np.full((len(scene.session.campaign.tests), len(FREQ_HZ)), np.inf + 0j)
    assert not np.isfinite(update.residuals(added)).any()


def test_a_law_without_force_adds_the_joint_beside_it_alone(block):
    tested = tested_joint.TestedJoint.of_scene(scene_of(block), JOINT)
    weak, parallel = np.array([1e-3, 2e6]), np.array([2e6, 400.0])
    (added,) = tested.add_laws([(HARDENING[0], weak, parallel)], FREQ_HZ)
    expected = 2e6 - STIFFNESS + 2j * np.pi * FREQ_HZ * (400.0 - DAMPING)
    np.testing.assert_allclose(added, np.tile(expected, (len(added), 1)), rtol=1e-9)


@pytest.mark.parametrize(
    ("effect", "force", "parameter"),
    [
        ("hardening", lambda q: 1.5e15 * q**3, 1.5e15),
        ("backlash", lambda q: -STIFFNESS * np.clip(q, -1.2e-7, 1.2e-7), 1.2e-7),
    ],
)
def test_the_law_that_is_there_has_the_best_start(block, effect, force, parameter):
    scene = scene_of(block, force)
    starts = fit_starts(scene, JOINT, ("friction", "backlash", "hardening"), STIFFNESS, DAMPING)
    best = min(starts, key=lambda start: start.cost)
    assert best.family.effect == effect
    assert best.theta[0] == pytest.approx(parameter, rel=0.15)
    assert best.parallel[0] == pytest.approx(STIFFNESS, rel=0.05)
    rivals = [start.cost for start in starts if start is not best]
    assert min(rivals) > best.cost + 0.1


def test_a_gap_is_seen_beside_a_damper_that_free_levels_left_too_large(block):
    gap = 1.2e-7
    scene = scene_of(block, lambda q: -STIFFNESS * np.clip(q, -gap, gap))
    names = [parameter.name for parameter in scene.model.parameters]
    theta = scene.theta.copy()
    theta[names.index("block_tz.stiffness")] *= 0.3
    theta[names.index("block_tz.damping")] *= 3.0
    starts = fit_starts(
        replace(scene, theta=theta),
        JOINT,
        ("friction", "backlash", "hardening"),
        stiffest=0.9 * STIFFNESS,
        least_damping=0.1 * DAMPING,
    )
    best = min(starts, key=lambda start: start.cost)
    assert best.family.effect == "backlash"
    assert best.theta[0] == pytest.approx(gap, rel=0.15)


def test_modes_that_do_not_move_the_joint_are_not_simulated(monkeypatch):
    far = 2 * np.pi * 90.0
    matrices = Matrices(
        np.diag([MASS_KG, 3.0, 5.0]),
        np.diag([DAMPING, 20.0, 30.0]),
        np.diag([STIFFNESS, 3.0 * far**2, 7.0 * far**2]),
    )
    inputs = np.array([[1.0], [1.0], [0.5]])
    transient = JointTransient.of_matrices(matrices, np.array([1.0, 0.0, 0.0]), inputs, FREQ_HZ)
    assert len(transient.poles) == 3
    assert len(transient.find_moving_modes()) == 1
    hits = SimulatedHits(np.array([0]), np.array([200.0]), PULSE_S)
    cases = [LawUnderHits(transient, CubicLaw(2e15), hits)]
    reduced = compute_equivalent_stiffness(cases, FREQ_HZ)
    all_modes = replace(LEVEL_SETTINGS, negligible_mode_share=-1.0)
    monkeypatch.setattr(joint_transient, "LEVEL_SETTINGS", all_modes)
    assert len(transient.find_moving_modes()) == 3
    whole = compute_equivalent_stiffness(cases, FREQ_HZ)
    np.testing.assert_allclose(reduced, whole, rtol=1e-9)


def test_machines_with_other_numbers_of_modes_are_simulated_beside_each_other():
    hits = SimulatedHits(np.array([0]), np.array([200.0]), PULSE_S)
    cases = []
    for damping in (DAMPING, 60 * DAMPING):  # the second one creeps: two real poles
        cases.append(LawUnderHits(build_transient(damping), CubicLaw(2e15), hits))
    assert [len(case.transient.poles) for case in cases] == [1, 2]
    together = compute_equivalent_stiffness(cases, FREQ_HZ)
    for values, case in zip(together, cases, strict=True):
        np.testing.assert_array_equal(values, compute_equivalent_stiffness([case], FREQ_HZ)[0])


def test_a_refit_begins_with_the_nominal_damper(block, monkeypatch):
    gap = 4e-7
    scene = scene_of(block, lambda q: -STIFFNESS * np.clip(q, -gap, gap))
    theta = scene.theta.copy()
    theta[[p.name for p in scene.model.parameters].index("block_tz.damping")] *= 8.0
    free = SimpleNamespace(session=scene.session, fit=SimpleNamespace(theta=theta))
    monkeypatch.setattr(refit_laws, "_read_changes", lambda *_: np.zeros(3, complex))
    overdamped = replace(scene, theta=theta)
    (alone,) = fit_starts(overdamped, JOINT, ("backlash",), STIFFNESS, 8.0 * DAMPING)
    (start,) = refit_laws._find_starts(overdamped, free, JOINT, ("backlash",))
    assert (start.theta, start.cost) == (alone.theta, alone.cost)
    np.testing.assert_allclose(start.parallel, [alone.parallel[0], DAMPING], rtol=1e-12)


def test_a_gap_is_found_where_the_joint_hardly_acts_at_the_lowest_level(block):
    gap = 1.6e-6
    scene = scene_of(block, lambda q: -STIFFNESS * np.clip(q, -gap, gap))
    theta = scene.theta.copy()
    theta[[p.name for p in scene.model.parameters].index("block_tz.stiffness")] *= 0.03
    start, _ = fit_starts(replace(scene, theta=theta), JOINT, ("backlash",), STIFFNESS, DAMPING)
    assert start.theta[0] == pytest.approx(gap, rel=0.05)
    assert start.parallel[0] == pytest.approx(STIFFNESS, rel=0.05)


def test_a_refit_begins_at_a_loose_gap_too_where_the_joint_stiffens(block):
    gap = 4e-8
    scene = scene_of(block, lambda q: -STIFFNESS * np.clip(q, -gap, gap))
    theta = scene.theta.copy()
    theta[[p.name for p in scene.model.parameters].index("block_tz.stiffness")] *= 0.8
    softer = replace(scene, theta=theta)
    tight, loose = fit_starts(softer, JOINT, ("backlash",), STIFFNESS, DAMPING)
    assert not tight.is_loose
    assert loose.is_loose
    assert loose.theta[0] > 3 * tight.theta[0]
    assert loose.theta[1] == 0.0  # the joint rests in the middle
    assert loose.cost > tight.cost
    (alone,) = fit_starts(scene, JOINT, ("backlash",), 0.9 * STIFFNESS, DAMPING)
    assert not alone.is_loose  # the joint is stiffest at the lowest level
    tight, other, loose = fit_starts(softer, JOINT, ("backlash", "friction"), STIFFNESS, DAMPING)
    assert tight.cost < other.cost - 0.1
    assert loose.is_loose  # a law that leads alone may be the wrong one
