"""Laws of joints that depend on the level: steps, transients, Parts, and a whole diagnosis."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.levels import tested_joint
from diagnosis.levels.free_levels import LAW_EFFECTS, list_levels, propose_law
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.law_family import BACKLASH, FRICTION, HARDENING
from diagnosis.levels.law_hypothesis import build_law_hypothesis
from diagnosis.levels.law_simulation import (
    LawUnderHits,
    compute_equivalent_stiffness,
    compute_peak_stretch,
)
from diagnosis.levels.restoring_laws import CubicLaw, GapLaw, SlidingLaw, stack_laws
from diagnosis.refits.level_dependence import measure_level_dependence
from diagnosis.refits.refitting import add_hypotheses
from diagnosis.search.refit_round import _add_directions, _select_promising
from diagnosis.search.score_test import Score
from diagnosis.settings import SETTINGS
from identification.words import Controller
from mbmodel import Change, Model, PartContext
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.control_loops.loop_law import LoopLaw
from mbmodel.mjcf.edit import write_mjcf
from mbmodel.nonlinear_joints.files import read_nonlinear_joints
from mbmodel.nonlinear_joints.laws import GapSpring, JenkinsElement, PolynomialSpring
from tests.helpers.nonlinear_joint import JOINT, build_transient
from tests.helpers.nonlinear_mass import (
    DAMPING,
    FREQ_HZ,
    MASS_KG,
    PULSE_S,
    STIFFNESS,
    half_sine,
    level_campaign,
    nonlinear_block,
    session_of,
    vertical_accelerance,
)
from tuning import predict
from tuning.misfit.batch import batch_tests

COMPLIANCE = 3e-10  # of one step [m/N]


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Model:
    return nonlinear_block(tmp_path_factory.mktemp("mass"))


def sliding_force(law, stretch, slip):
    """Force of a Jenkins element without its stuck spring, for a given stretch."""
    reach = law.limit / law.stiffness
    moved = stretch - np.clip(stretch - slip, -reach, reach)
    return -law.stiffness * moved


@pytest.mark.parametrize("free", [-4e-6, -2e-7, 0.0, 3e-7, 8e-6])
@pytest.mark.parametrize("slip", [-1e-6, 0.0, 5e-7])
def test_a_sliding_step_solves_its_equation(free, slip):
    law = SlidingLaw(1e8, 40.0)
    force, state = law.solve(np.array([free]), COMPLIANCE, np.array([slip]))
    stretch = brentq(
        lambda q: q - free + COMPLIANCE * sliding_force(law, q, slip), -1e-4, 1e-4, xtol=1e-18
    )
    assert force[0] == pytest.approx(sliding_force(law, stretch, slip), abs=1e-6)
    assert state[0] == pytest.approx(-force[0] / law.stiffness, abs=1e-15)


@pytest.mark.parametrize(
    ("law", "force"),
    [
        (CubicLaw(2e19), lambda q: 2e19 * q**3),
        (GapLaw(1e8, 4e-7), lambda q: -1e8 * np.clip(q, -4e-7, 4e-7)),
        (GapLaw(1e8, 4e-7, 6e-7), lambda q: -1e8 * (np.clip(q - 6e-7, -4e-7, 4e-7) + 4e-7)),
    ],
)
@pytest.mark.parametrize("free", [-3e-6, -1e-7, 0.0, 5e-7, 2e-6])
def test_a_step_of_a_spring_solves_its_equation(law, force, free):
    found, _ = law.solve(np.array([free]), COMPLIANCE, np.array([free]))
    stretch = brentq(lambda q: q - free + COMPLIANCE * force(q), -1e-4, 1e-4, xtol=1e-18)
    assert found[0] == pytest.approx(force(stretch), rel=1e-7, abs=1e-7)


def test_laws_side_by_side_are_each_alone():
    laws = [SlidingLaw(1e8, 3.0), SlidingLaw(2e8, 50.0)]
    free = np.array([1e-6, -2e-6, 1e-6, -2e-6])
    forces, _ = stack_laws(laws, 2).solve(free, COMPLIANCE, np.zeros(4))
    alone = [law.solve(free[:2], COMPLIANCE, np.zeros(2))[0] for law in laws]
    np.testing.assert_allclose(forces, np.concatenate(alone), rtol=1e-14)


def test_receptances_are_those_of_one_mass():
    laplace = 2j * np.pi * FREQ_HZ
    expected = 1 / (MASS_KG * laplace**2 + DAMPING * laplace + STIFFNESS)
    receptances = build_transient().receptances(FREQ_HZ)
    np.testing.assert_allclose(receptances, np.stack([expected, expected], 1), rtol=2e-4)


def test_receptances_of_a_mass_in_a_loop_hold_its_controller_and_delay():
    one, gain, corner, delay = np.ones((1, 1)), 0.3 * STIFFNESS, 2 * np.pi * 400, 2e-4
    controller = Controller(-corner * one, one, gain * corner * one, 0 * one)
    core = np.zeros((3, 1, 1))
    core[0] = 1.0
    change = Change("bodies_and_joints", one, one, core, shape=LoopLaw(controller, delay))
    loop = FrequencyDependentTerm(one, one, change, np.zeros((6, 1)), np.zeros((6, 1)))
    matrices = Matrices(MASS_KG * one, DAMPING * one, STIFFNESS * one)
    transient = JointTransient.of_matrices(matrices, np.ones(1), one, FREQ_HZ, (loop,))
    s = 2j * np.pi * FREQ_HZ
    law = gain / (1 + s / corner) * np.exp(-s * delay)
    expected = 1 / (MASS_KG * s**2 + DAMPING * s + STIFFNESS + law)
    receptance = transient.receptances(FREQ_HZ)[:, 0]
    np.testing.assert_allclose(receptance, expected, rtol=2e-4)


def test_the_peak_of_the_linear_stretch_is_that_of_an_integrator():
    path = solve_ivp(
        lambda t, y: [y[1], (half_sine(t, 80.0) - DAMPING * y[1] - STIFFNESS * y[0]) / MASS_KG],
        (0, 0.05),
        [0.0, 0.0],
        rtol=1e-9,
        atol=1e-16,
        max_step=1e-4,
    )
    found = compute_peak_stretch(
        build_transient(), SimulatedHits(np.array([0]), np.array([80.0]), PULSE_S)
    )
    assert found[0] == pytest.approx(np.abs(path.y[0]).max(), rel=2e-3)


@pytest.mark.parametrize("peak", [20.0, 300.0])
@pytest.mark.parametrize("cubic", [2e15, -2e14])
def test_frfs_of_a_cubic_spring_are_those_of_an_integrator(peak, cubic):
    hits = SimulatedHits(np.array([0]), np.array([peak]), PULSE_S)
    case = LawUnderHits(build_transient(), CubicLaw(cubic), hits)
    kappa = compute_equivalent_stiffness([case], FREQ_HZ)[0, 0]
    laplace = 2j * np.pi * FREQ_HZ
    found = laplace**2 / (MASS_KG * laplace**2 + DAMPING * laplace + STIFFNESS + kappa)
    expected = vertical_accelerance(lambda stretch: cubic * stretch**3, peak)
    error = np.linalg.norm(found - expected) / np.linalg.norm(expected)
    assert error < 0.01


def test_a_gap_that_is_never_left_takes_the_whole_spring():
    hits = SimulatedHits(np.array([0]), np.array([5.0]), PULSE_S)
    softer = GapLaw(0.3 * STIFFNESS, 1.0)
    kappa = compute_equivalent_stiffness([LawUnderHits(build_transient(), softer, hits)], FREQ_HZ)
    np.testing.assert_allclose(kappa[0, 0], -0.3 * STIFFNESS, rtol=5e-3)


@pytest.mark.parametrize("family", [FRICTION[0], HARDENING[0], BACKLASH[0]])
def test_slopes_of_a_law_are_difference_quotients(block, family):
    campaign = level_campaign(block, None, (40.0, 200.0))
    session = session_of(block, campaign)
    scene = Scene(session, session.model.drawn)
    start = family.starts(STIFFNESS, 1e-5)[2]
    hypothesis = build_law_hypothesis(scene, JOINT, family, start)
    part = hypothesis.parts[-1]
    theta = np.array([parameter.drawn for parameter in part.parameters])
    context = PartContext(block.machine, next(iter(part.conditions)))
    laplace = 2j * np.pi * FREQ_HZ[::3]
    linear = MASS_KG * laplace**2 + DAMPING * laplace + STIFFNESS + family.stuck(theta[:-3])
    (change,) = part.changes(theta, context)
    stiff = linear - family.stuck(theta[:-3]) + change.shape(laplace)
    for k, slope in enumerate(part.slopes(theta, context)):
        share = 0.003 if "stiffness" in part.parameters[k].name else 0.03  # within a cell
        step = share * (abs(theta[k]) or 1.0)
        ends = []
        for sign in (1, -1):
            moved = theta.copy()
            moved[k] += sign * step
            (change,) = part.changes(moved, context)
            ends.append(1 / (linear - family.stuck(theta[:-3]) + change.shape(laplace)))
        quotient = (ends[0] - ends[1]) / (2 * step)
        expected = -slope.shape(laplace) / stiff**2
        assert np.linalg.norm(expected - quotient) < 0.2 * np.linalg.norm(quotient) + 1e-16


@pytest.mark.parametrize(
    ("family", "theta", "expected"),
    [
        (FRICTION[0], (2e6, 30.0), JenkinsElement("block_tz", 2e6, 30.0)),
        (HARDENING[1], (1e14, STIFFNESS), PolynomialSpring("block_tz", STIFFNESS, 0.0, -1e14)),
        (BACKLASH[0], (2e-6, 0.0, 6e6), GapSpring("block_tz", 6e6, 2e-6)),
        (BACKLASH[0], (2e-6, -1.5, 6e6), GapSpring("block_tz", 6e6, 2e-6, 6.0)),
    ],
)
def test_a_law_is_written_into_the_mjcf_and_read_back(block, tmp_path, family, theta, expected):
    campaign = level_campaign(block, None, (40.0, 200.0))
    session = session_of(block, campaign)
    scene = Scene(session, session.model.drawn)
    hypothesis = build_law_hypothesis(scene, JOINT, family, theta)
    first, *others = hypothesis.parts
    numbers = np.array([*theta, 1.0, 1.0, 1.0])
    assert all(part.write(numbers) == () for part in others)
    target = tmp_path / "augmented.xml"
    assert not write_mjcf(block.machine.source, target, first.write(numbers))
    (found,) = read_nonlinear_joints(target)
    assert type(found) is type(expected)
    assert found.joint == expected.joint
    read, written = (np.array(list(vars(law).values())[1:]) for law in (found, expected))
    np.testing.assert_allclose(read, written, rtol=1e-3, atol=1e-9)


def test_tests_with_the_same_hits_have_one_stiffness(block):
    campaign = level_campaign(block, None, (40.0, 200.0))
    twice = [
        replace(test, condition=replace(test.condition, test=name, setup=name))
        for name in "ab"
        for test in campaign.tests
    ]
    session = session_of(block, replace(campaign, tests=tuple(twice)))
    tested = tested_joint.TestedJoint.of_scene(Scene(session, session.model.drawn), JOINT)
    theta = np.array([2e14, STIFFNESS, 1.0])
    stiffness = tested.compute_stiffness(
        HARDENING[0], [(theta, 1.0, np.array([STIFFNESS, DAMPING]))]
    )
    case = LawUnderHits(tested.transient(), CubicLaw(2e14), tested.hits)
    expected = compute_equivalent_stiffness([case], tested.freq_hz)
    np.testing.assert_allclose(stiffness, expected, rtol=1e-9)
    np.testing.assert_array_equal(stiffness[:, :6], stiffness[:, 6:])


def test_set_ups_of_one_level_have_one_part_and_one_evaluation(block):
    campaign = level_campaign(block, None, (40.0, 200.0))
    again = [
        replace(test, condition=replace(test.condition, test=f"{test.condition.test} again"))
        for test in campaign.tests
    ]
    campaign = replace(campaign, tests=(*campaign.tests, *again))
    session = session_of(block, campaign)
    scene = Scene(session, session.model.drawn)
    law = build_law_hypothesis(scene, JOINT, HARDENING[0], (1e14, STIFFNESS))
    assert len(law.parts) == 6  # three hammer points at two levels
    for number, test in enumerate(campaign.tests):
        acting = [part.acts(test.condition) for part in law.parts]
        assert acting == [float(k == number % 6) for k in range(6)]
    batches = batch_tests(add_hypotheses(session, law).model, campaign)
    assert [batch.tests for batch in batches] == [(k, k + 6) for k in range(6)]


def test_laws_of_one_joint_are_one_of_the_promising_hypotheses():
    laws = [
        Hypothesis(effect, f"joint:{stage}", "tz", spring=JointDirection(stage, "tz", stage))
        for stage in ("block", "table")
        for effect in LAW_EFFECTS
    ]
    masses = [Hypothesis("mass_error", f"body:{name}") for name in ("a", "b", "c")]
    ranked = [
        Score(h, 100.0 - k, np.ones(1)) for k, h in enumerate((*laws[:3], *masses, *laws[3:]))
    ]
    chosen = _select_promising(ranked, None, replace(SETTINGS, max_refits=3))
    assert chosen == [*laws[:3], *masses[:2]]


def test_laws_are_sought_in_further_directions_of_the_most_promising_joint():
    laws = {
        (stage, dof): [
            Hypothesis(
                effect, f"joint:{stage}", dof, spring=JointDirection(stage, dof, f"{stage}_{dof}")
            )
            for effect in LAW_EFFECTS
        ]
        for stage, dof in (
            ("block", "rx"),
            ("table", "ty"),
            ("block", "ty"),
            ("table", "rx"),
            ("block", "tz"),
            ("block", "rz"),
        )
    }
    mass = Hypothesis("mass_error", "body:block")
    hypotheses = [mass, *(law for direction in laws.values() for law in direction)]
    ranked = [Score(h, 100.0 - k, np.ones(1)) for k, h in enumerate(hypotheses)]
    promising = [*laws["block", "rx"], *laws["table", "ty"]]
    chosen = _add_directions(promising, ranked, replace(SETTINGS, max_variants=2))
    assert chosen == [*promising, *laws["block", "ty"], *laws["block", "tz"]]
    assert _add_directions([], ranked, SETTINGS) == []


def test_nothing_is_proposed_at_one_level(block):
    campaign = level_campaign(block, None, (100.0,))
    session = session_of(block, campaign)
    scene = Scene(session, session.model.drawn)
    assert list_levels(campaign) == (100.0,)
    assert not list(propose_law("friction", scene))


def level_excess(scene: Scene) -> float | None:
    campaign = scene.session.campaign
    return measure_level_dependence(predict(scene.model, scene.theta, campaign), campaign)


def test_errors_that_the_levels_share_are_no_dependence_on_the_level(block):
    campaign = level_campaign(block, None, (40.0, 200.0, 1000.0))
    session = session_of(block, campaign)
    wrong = session.model.drawn.copy()
    names = [parameter.name for parameter in session.model.parameters]
    wrong[names.index("block_tz.stiffness")] *= 1.3
    for theta in (session.model.drawn, wrong):
        scene = Scene(session, theta)
        assert level_excess(scene) == pytest.approx(0.0, abs=0.05)
        assert not list(propose_law("friction", scene))


def test_laws_are_proposed_where_frfs_depend_on_the_level(block):
    stiff = level_campaign(block, lambda q: 1.5e15 * q**3, (40.0, 200.0, 1000.0))
    scene = Scene(session_of(block, stiff), session_of(block, stiff).model.drawn)
    (along_z,) = (law for law in propose_law("hardening", scene) if law.dof == "tz")
    assert along_z.location == "joint:block"
    assert level_excess(scene) > 1.0


def test_points_that_were_hit_at_one_level_each_do_not_tell(block):
    campaign = level_campaign(block, None, (40.0, 200.0))
    tests = (*campaign.tests[:2], campaign.tests[5])  # along z at the second level alone
    session = session_of(block, replace(campaign, tests=tests))
    scene = Scene(session, session.model.drawn)
    assert level_excess(scene) is None
    assert list(propose_law("friction", scene))
