"""Maxwell branches beside one spring of a joint or all of them: physics, sign and direction."""

import tomllib

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene, build_verdict, diagnose
from identification.words import DIRECTIONS
from mbmodel import PartContext
from tests.helpers.drawn import drawn

LAPLACE = 2j * np.pi * np.array([4.0, 23.0, 57.0, 140.0])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("few"), 72_001, lines=41, stages=2)
    return Scene(session, session.model.drawn * 1.1)


def dynamic_stiffness(scene, hypothesis, theta):
    """Return the dynamic stiffness that the Part adds to the joints at each s; (n_line, nv, nv)."""
    (part,) = hypothesis.parts
    machine = scene.model.machine
    total = np.zeros((len(LAPLACE), *machine.armature.shape), complex)
    for change in part.changes(theta, PartContext(machine)):
        powers = LAPLACE[:, None] ** np.arange(3) * change.shape(LAPLACE)[:, None]
        total += change.left @ np.einsum("fk,krt->frt", powers, change.core) @ change.right.T
    return total


def values_of(hypothesis, size):
    """Parameters of the Part where its size has a value, in order and by name."""
    parameters = hypothesis.parts[0].parameters
    named = {p.name: size if p.name in hypothesis.scored else p.drawn for p in parameters}
    return np.array(list(named.values())), named


def test_each_group_of_springs_has_the_dynamic_stiffness_of_a_branch(scene):
    machine = scene.model.machine
    places = {axle.joint: axle.coordinate for axle in machine.axles}
    proposed = [h for h in EFFECTS["viscoelastic"](scene) if h.location == "joint:stage2"]
    directions = [axle.dof for axle in machine.axles if axle.stage == "stage2"]
    assert list(dict.fromkeys(h.dof for h in proposed)) == [None, *directions]
    for hypothesis in proposed:
        theta, named = values_of(hypothesis, np.log(1.7))
        stated = hypothesis.state(named)
        assert stated["ratio"] == pytest.approx(0.7)
        s_tau = LAPLACE * stated["tau"]
        expected = np.zeros((len(LAPLACE), *machine.armature.shape), complex)
        for name, spring in hypothesis.follow.items():
            joint = places[spring.removesuffix(".stiffness")]
            expected[:, joint, joint] = named[name] * 0.7 * s_tau / (1 + s_tau)
        stiffness_change = dynamic_stiffness(scene, hypothesis, theta)
        np.testing.assert_allclose(stiffness_change, expected, rtol=1e-12)


def test_elements_along_an_axis_stiffen_its_translation_and_the_rotations_across_it(scene):
    proposed = [h for h in EFFECTS["viscoelastic"](scene) if h.location == "joint:stage2"]
    springs = [[name.removesuffix(".stiffness") for name in h.follow.values()] for h in proposed]
    groups = {
        (h.dof, *(spring.rpartition("_")[2] for spring in names))
        for h, names in zip(proposed, springs, strict=True)
    }
    singles = {(dof, dof) for dof in DIRECTIONS}
    across = {("tx", "tx", "ry", "rz"), ("ty", "ty", "rx", "rz"), ("tz", "tz", "rx", "ry")}
    assert groups == {(None, *DIRECTIONS), *singles, *across}


def test_neither_a_ratio_nor_an_end_of_its_interval_is_negative(scene):
    for name, size in (("viscoelastic", "ratio"), ("structural_damping", "loss_factor")):
        hypothesis = next(iter(EFFECTS[name](scene)))
        assert hypothesis.signed
        for theta in (-3.0, -0.1, 0.0):
            assert hypothesis.state(values_of(hypothesis, theta)[1])[size] == 0.0


def test_a_branch_is_named_with_its_direction(tmp_path):
    # The draw of this seed is a branch beside one spring.
    session, text = drawn(tmp_path, 3, "viscoelastic", ratio=4.0, lines=161)
    answer = tomllib.loads(text)
    verdict = build_verdict(diagnose(session))
    (cause,) = (cause for cause in verdict.causes if cause.probability >= 0.5)
    assert answer["dof"]
    place = answer["location"], answer["dof"]
    assert (cause.effect, cause.location, cause.dof) == ("viscoelastic", *place)
    for name, true in answer["parameters"].items():
        assert cause.parameters[name] == pytest.approx(true, rel=0.05)
        low, high = cause.interval[name]
        assert 0 < low <= true <= high
