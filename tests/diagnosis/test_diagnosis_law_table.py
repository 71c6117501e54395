"""Stiffness of a law under hits that scatter: the H1 average, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.hypothesis import Scene
from diagnosis.levels import tested_joint
from diagnosis.levels.law_family import BACKLASH, FRICTION, HARDENING
from diagnosis.levels.law_table import LawTable, average_hits, show
from diagnosis.levels.settings import LEVEL_SETTINGS
from mbmodel.assembly import Matrices
from tests.helpers.nonlinear_joint import JOINT
from tests.helpers.nonlinear_mass import (
    DAMPING,
    MASS_KG,
    STIFFNESS,
    level_campaign,
    nonlinear_block,
    session_of,
)

CUBIC = 1.5e15
LINEAR = np.array([STIFFNESS, DAMPING])  # of the joint


@pytest.fixture(scope="module")
def tested(tmp_path_factory):
    block = nonlinear_block(tmp_path_factory.mktemp("mass"))
    session = session_of(block, level_campaign(block, None, (40.0, 200.0)))
    return tested_joint.TestedJoint.of_scene(Scene(session, session.model.drawn), JOINT)


def complex_normal(random, *shape):
    return random.standard_normal(shape) + 1j * random.standard_normal(shape)


def test_the_average_of_hits_is_that_of_h1():
    random = np.random.default_rng(5)
    kappa, force = complex_normal(random, 1, 6, 1, 40), complex_normal(random, 6, 1)
    linear, there, back = (complex_normal(random, 40) for _ in range(3))
    receptance = 0.1 * complex_normal(random, 40)

    def frf(stiffness):
        return linear - there * back * stiffness / (1 + stiffness * receptance)

    readings = frf(kappa[0, :, 0]) * force
    h1 = (readings * force.conj()).sum(axis=0) / (np.abs(force) ** 2).sum(axis=0)
    average = average_hits(show(kappa, receptance), np.abs(force) ** 2)
    np.testing.assert_allclose(linear - there * back * average[0, 0], h1, rtol=1e-12)


def show_all(table, theta):
    """c in each test; (n_test, n_freq)."""
    tests = range(len(table.mean))
    return np.array([show(table.at(theta, test)[0], table.receptance) for test in tests])


def test_hits_that_scatter_show_the_average_of_many(tested):
    start = (CUBIC, STIFFNESS, 1.0)
    table = LawTable.simulate(tested, HARDENING[0], start)
    points, weights = np.polynomial.hermite_e.hermegauss(15)
    sizes = np.exp(LEVEL_SETTINGS.hit_scatter * points)
    kappas = tested.compute_stiffness(HARDENING[0], [(np.array(start), s, LINEAR) for s in sizes])
    hits = show(kappas, table.receptance)
    (many,) = average_hits(hits[None], (weights * sizes**2)[:, None])
    scattered, mean = (show_all(table, np.array([*start, v, 1.0])) for v in (1.0, 0.0))
    strong = np.abs(tested.hits.peak) == 200.0
    off = np.linalg.norm(scattered[strong] - many[strong])
    assert off < 0.2 * np.linalg.norm(mean[strong] - many[strong])
    np.testing.assert_allclose(mean, hits[7], atol=1e-6 * np.abs(hits[7]).max())


def test_no_scatter_is_the_mean_hit_and_the_variance_counts_linearly(tested):
    start = (CUBIC, STIFFNESS, 1.0)
    table = LawTable.simulate(tested, HARDENING[0], start)
    shown = {v: show_all(table, np.array([1.01 * CUBIC, *start[1:], v, 1.0])) for v in (0, 1, 2)}
    scale = np.abs(shown[1] - shown[0]).max()
    np.testing.assert_allclose(shown[2] - shown[1], shown[1] - shown[0], atol=1e-6 * scale)
    still = replace(tested, pulses=replace(tested.pulses, peak=1e-6 * tested.pulses.peak))
    quiet = LawTable.simulate(still, HARDENING[0], start).slopes[-2]
    assert np.abs(quiet * STIFFNESS * table.receptance).max() < 1e-6


@pytest.mark.parametrize(
    ("family", "start", "followed"),
    [
        (FRICTION[0], (0.4 * STIFFNESS, 30.0), ("stiffness", "damping")),
        (HARDENING[0], (CUBIC, STIFFNESS), ("damping",)),
    ],
)
def test_a_table_follows_the_law_and_the_spring_and_damper_of_the_joint(
    tested, family, start, followed
):
    """Against a law that is simulated elsewhere, by what the FRFs show of the whole joint."""
    values = np.array([*start, *LINEAR[2 - len(followed) :], 1.0])
    table = LawTable.simulate(tested, family, tuple(values), followed)
    for place, name in enumerate(table.names):
        moved = values.copy()
        moved[place] *= 1.01 if name == "stiffness" else 1.04
        elsewhere = LawTable.simulate(tested, family, tuple(moved), followed)
        at_start, expected = (
            show(add_joint(*end), table.receptance) for end in ((table, values), (elsewhere, moved))
        )
        error = np.linalg.norm(show(add_joint(table, moved), table.receptance) - expected)
        assert error < 0.25 * np.linalg.norm(expected - at_start), name


@pytest.mark.parametrize(
    ("family", "start", "followed", "share"),
    [
        (FRICTION[0], (0.4 * STIFFNESS, 30.0), ("stiffness", "damping", "mass"), 0.1),
        (HARDENING[0], (CUBIC, STIFFNESS), ("damping", "mass"), 0.1),
        (BACKLASH[0], (2e-7, 0.3, STIFFNESS), ("damping", "mass"), 0.4),
    ],
)
def test_a_table_follows_the_scale_of_the_machine(tested, family, start, followed, share):
    """Against a law that is simulated on a machine whose M, C and K are larger; a gap is rough."""
    scale = 1.01
    values = np.array([*start, *LINEAR[3 - len(followed) :], MASS_KG, 1.0])
    is_force = [*family.is_force, *(True for _ in followed), False]
    moved = np.where(is_force, scale * values, values)
    larger = replace(
        tested,
        matrices=Matrices(
            *(scale * getattr(tested.matrices, name) for name in ("mass", "damping", "stiffness"))
        ),
        stiffness=scale * STIFFNESS,
        damping=scale * DAMPING,
    )
    table = LawTable.simulate(tested, family, tuple(values), followed)
    elsewhere = LawTable.simulate(larger, family, tuple(moved), followed)
    at_start, expected = add_joint(table, values), add_joint(elsewhere, moved)
    error = np.linalg.norm(add_joint(table, moved) - expected)
    assert error < share * np.linalg.norm(expected - at_start)


def add_joint(table, values):
    """Effect of table and spring on the joint of the machine on test; (n_test, n_freq)."""
    spring = dict(zip(table.names, values, strict=True))
    freq_hz = table.joint.freq_hz
    added = spring["stiffness"] - STIFFNESS if "stiffness" in spring else 0.0
    added = added + 2j * np.pi * freq_hz * (spring["damping"] - DAMPING)
    theta = np.array([*values, 1.0, 1.0])
    kappas = np.array([table.at(theta, test)[0] for test in range(len(table.mean))])
    return kappas + added


def test_slopes_of_a_table_are_its_difference_quotients(tested):
    start = (2e-7, 0.3, STIFFNESS, DAMPING, MASS_KG, 1.0)
    table = LawTable.simulate(tested, BACKLASH[0], start, ("damping", "mass"))
    theta = np.array([2.1e-7, 0.32, 0.98 * STIFFNESS, 1.1 * DAMPING, 41.0, 1.02, 0.9, 1.03])
    slopes = table.at(theta, 5)[1]  # hit along the joint at the higher level
    for place, step in enumerate(1e-6 * theta):
        after, before = (table.at(replace_at(theta, place, s), 5)[0] for s in (step, -step))
        np.testing.assert_allclose(
            (after - before) / (2 * step), slopes[place], atol=1e-6 * np.abs(slopes[place]).max()
        )


@pytest.mark.parametrize(
    ("family", "theta"),
    [
        (FRICTION[0], (0.4 * STIFFNESS, 30.0)),
        (HARDENING[0], (CUBIC, STIFFNESS)),
        (HARDENING[1], (0.01 * CUBIC, STIFFNESS)),
        (BACKLASH[0], (2e-7, 0.3, STIFFNESS)),
    ],
)
def test_stronger_hits_show_what_usual_ones_do_on_a_similar_law(tested, family, theta):
    strength, (number, power) = 1.3, family.similarity
    similar = np.array([*theta, 1.0])
    similar[number] *= strength**power
    cases = [(np.array([*theta, 1.0]), strength, LINEAR), (similar, 1.0, LINEAR)]
    stronger, usual = tested.compute_stiffness(family, cases)
    np.testing.assert_allclose(stronger, usual, rtol=1e-6)


@pytest.mark.parametrize(
    ("family", "theta"),
    [
        (FRICTION[0], (0.4 * STIFFNESS, 30.0)),
        (HARDENING[0], (CUBIC, 1.05 * STIFFNESS)),
        (BACKLASH[0], (2e-7, 0.3, 1.05 * STIFFNESS)),
    ],
)
def test_a_law_beside_another_spring_is_that_of_the_machine_with_it(tested, family, theta):
    spring = np.array([1.05 * STIFFNESS, 0.8 * DAMPING])
    values = np.array([*theta, 1.0])
    added = spring - LINEAR
    along = np.outer(tested.direction, tested.direction)
    matrices = replace(
        tested.matrices,
        stiffness=tested.matrices.stiffness + added[0] * along,
        damping=tested.matrices.damping + added[1] * along,
    )
    moved = replace(tested, matrices=matrices, stiffness=spring[0], damping=spring[1])
    followed = tested.compute_stiffness(family, [(values, 1.0, spring)])
    expected = moved.compute_stiffness(family, [(values, 1.0, spring)])
    np.testing.assert_allclose(followed, expected, rtol=1e-7)
    unmoved = tested.compute_stiffness(family, [(values, 1.0, LINEAR)])
    assert np.linalg.norm(unmoved - expected) > 1e-3 * np.linalg.norm(expected)


def replace_at(theta, place, change):
    changed = theta.copy()
    changed[place] += change
    return changed
