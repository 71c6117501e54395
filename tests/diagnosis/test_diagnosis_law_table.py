"""Stiffness of a law under hits that scatter: the H1 average, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.hypothesis import Scene
from diagnosis.levels import tested_joint
from diagnosis.levels.law_family import BACKLASH, FRICTION, HARDENING
from diagnosis.levels.law_table import LawTable, average_hits
from diagnosis.levels.settings import LEVEL_SETTINGS
from tests.helpers.nonlinear_joint import JOINT
from tests.helpers.nonlinear_mass import (
    DAMPING,
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
    average = average_hits(kappa, receptance[None], np.abs(force) ** 2)
    np.testing.assert_allclose(frf(average[0, 0]), h1, rtol=1e-12)


def test_hits_that_scatter_show_the_average_of_many(tested):
    theta = np.array([CUBIC, STIFFNESS, 1.0, 1.0])
    table = LawTable(tested, HARDENING[0], (CUBIC, STIFFNESS, 1.0))
    found, _ = table.at(theta)
    scatter = LEVEL_SETTINGS.hit_scatter
    points, weights = np.polynomial.hermite_e.hermegauss(15)
    sizes = np.exp(scatter * points)
    kappas = tested.compute_stiffness(HARDENING[0], [(theta[:3], size, LINEAR) for size in sizes])
    receptance = tested.transient().receptances(tested.freq_hz)[:, 0]
    (many,) = average_hits(kappas[None], receptance[None], (weights * sizes**2)[:, None])
    mean, _ = table.at(replace_last(theta, 0.0))
    shown, single, expected = (kappa / (1 + kappa * receptance) for kappa in (found, mean, many))
    strong = np.abs(tested.hits.peak) == 200.0
    off = np.linalg.norm(shown[strong] - expected[strong])
    assert off < 0.2 * np.linalg.norm(single[strong] - expected[strong])
    np.testing.assert_allclose(mean, kappas[7], atol=3e-3 * np.abs(kappas[7]).max())


def test_no_scatter_is_the_mean_hit_and_the_variance_counts_linearly(tested):
    table = LawTable(tested, HARDENING[0], (CUBIC, STIFFNESS, 1.0))
    theta = np.array([1.01 * CUBIC, STIFFNESS, 1.0, 1.0])
    values = {v: table.at(replace_last(theta, v))[0] for v in (0.0, 1.0, 2.0)}
    np.testing.assert_allclose(values[2.0] - values[1.0], values[1.0] - values[0.0], rtol=1e-6)
    slope = table.at(theta)[1][3]
    np.testing.assert_allclose(slope, values[1.0] - values[0.0], rtol=1e-6)
    still = replace(tested, pulses=replace(tested.pulses, peak=1e-6 * tested.pulses.peak))
    quiet = LawTable(still, HARDENING[0], (CUBIC, STIFFNESS, 1.0)).at(theta)[1][3]
    assert np.abs(quiet).max() < 1e-6 * STIFFNESS


def test_within_a_cell_the_law_is_linear_and_near_its_simulation(tested):
    start = np.array([CUBIC, STIFFNESS, 1.0, 0.0])
    ends = (0.9, 0.96, 1.0, 1.04, 1.1)
    table = LawTable(tested, HARDENING[0], (CUBIC, STIFFNESS, 1.0))
    stiffness_at_ends = [table.at(start * np.array([factor, 1.0, 1.0, 1.0]))[0] for factor in ends]
    assert len(table.known) == 3
    exact = tested.compute_stiffness(
        HARDENING[0], [(np.array([factor * CUBIC, STIFFNESS, 1.0]), 1.0, LINEAR) for factor in ends]
    )
    for near, true in zip(stiffness_at_ends, exact, strict=True):
        assert np.linalg.norm(near - true) < 0.03 * np.linalg.norm(exact[4] - exact[0])
    line = np.log(ends[1:4])
    rise = (stiffness_at_ends[2] - stiffness_at_ends[1]) / (line[1] - line[0])
    np.testing.assert_allclose(
        stiffness_at_ends[3] - stiffness_at_ends[2], rise * (line[2] - line[1]), rtol=1e-6
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


@pytest.mark.parametrize(
    ("family", "start", "followed"),
    [
        (FRICTION[0], (0.4 * STIFFNESS, 30.0), ("stiffness", "damping")),
        (HARDENING[0], (CUBIC, STIFFNESS), ("damping",)),
    ],
)
def test_a_table_follows_spring_and_damper_of_the_joint(tested, family, start, followed):
    linear = LINEAR[2 - len(followed) :]
    table = LawTable(tested, family, (*start, *linear, 1.0), followed)
    slopes = table.at(np.array([*start, *linear, 1.0, 0.0]))[1]
    last = len(start) + len(followed) - 1
    for kind, share in enumerate((0.003, 0.02)):
        step = share * LINEAR * np.eye(2)[kind]
        cases = []
        for sign in (-1, 1):
            values = np.array([*start, 1.0])
            if family.follows_stiffness:
                values[len(start) - 1] += sign * step[0]
            cases.append((values, 1.0, LINEAR + sign * step))
        softer, stiffer = tested.compute_stiffness(family, cases)
        quotient, slope = (stiffer - softer) / (2 * step[kind]), slopes[last - 1 + kind]
        assert np.linalg.norm(slope - quotient) < 0.3 * np.linalg.norm(quotient)


def replace_last(theta, value):
    changed = theta.copy()
    changed[-1] = value
    return changed
