"""Effects of joints and links against closed forms: coupling, freed direction, supports, drift."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from effect_rigs import OCCASIONS, chain, frf_of, machine_of, random_of, rig_of, scene_of
from hypothesis import given
from hypothesis import strategies as st

from truth.effects import Scene
from truth.effects.drift import Drift, draw_drift
from truth.effects.joint_errors import (
    JointCoupling,
    MissingDof,
    draw_joint_coupling,
    draw_missing_dof,
)
from truth.effects.parallel_path import ParallelPath, draw_parallel_path
from truth.effects.support_loss import CORNERS, SupportLoss, draw_support_loss, levers
from truth.errors import TruthError
from truth.machine.dynamics import point_row
from truth.machine.rig import Occasion
from truth.machine.station import GROUND, HitPoint, Joint, StageBody, Station

AXES = np.eye(3)


def test_displaced_springs_couple_by_the_moment_of_their_lever(one_body):
    # Springs and dampers feel u + theta x o = (1, -[o]x) (u, theta): K = T^T diag(k) T, so C.
    effect = JointCoupling("table", along=(0.6, 0.0, 0.8), size=0.1)
    o = np.array(effect.vector)
    T = np.eye(6)
    T[:3, 3:] = np.cross(AXES, o).T
    joints = one_body.stages[0].joints
    k, c = [one.stiffness for one in joints], [one.damping for one in joints]
    rig = rig_of(one_body, [effect])
    np.testing.assert_allclose(rig.equations.stiffness, T.T @ np.diag(k) @ T, rtol=1e-9, atol=1e-4)
    np.testing.assert_allclose(rig.equations.damping, T.T @ np.diag(c) @ T, rtol=1e-9, atol=1e-7)
    # A positive turn about y lowers what is at +x: t_z - r_y o_x.
    assert rig.equations.stiffness[2, 4] == pytest.approx(-7e6 * 0.06)
    assert effect.answer().parameters == {"offset": pytest.approx((0.06, 0.0, 0.08))}


def test_springs_and_dampers_elsewhere_are_a_joint_drawn_elsewhere(two_bodies):
    effect = JointCoupling("holder", along=(2 / 3, -2 / 3, 1 / 3), size=0.15)
    upper = two_bodies.stages[1]
    joints = tuple(replace(one, position=one.position + effect.vector) for one in upper.joints)
    lower = two_bodies.stages[0]
    moved = replace(two_bodies, stages=(lower, replace(upper, joints=joints)))
    np.testing.assert_allclose(frf_of(two_bodies, effect), frf_of(moved), rtol=1e-9, atol=1e-14)


def test_an_offset_is_drawn_where_it_is_felt():
    station = chain()
    few = replace(
        station.stages[2], joints=(station.stages[2].joints[0], station.stages[2].joints[5])
    )
    station = replace(station, stages=(*station.stages[:2], few))
    for seed in range(20):
        # One slide along x, one hinge about z: an offset along y alone is felt.
        effect = draw_joint_coupling(random_of(seed), scene_of(station), "joint:head")
        np.testing.assert_allclose(np.abs(effect.along), [0, 1, 0], atol=1e-12)
    hinges = chain(hinges=True)
    with pytest.raises(TruthError, match=r"joint:head.*cannot"):
        draw_joint_coupling(random_of(1), scene_of(hinges), "joint:head")


@pytest.mark.parametrize("dof", ["tx", "tz", "rz"])
def test_a_freed_direction_is_one_more_joint(dof):
    station = chain(hinges=True)
    effect = MissingDof("head", dof, reference=4e6, time_constant=3e-4, size=2.0)
    head = station.stages[2]
    joint = Joint(
        name="new",
        kind="slide" if dof[0] == "t" else "hinge",
        axis=AXES["xyz".index(dof[1])],
        position=head.joints[0].position,
        stiffness=2e6,
        damping=600.0,
    )
    freed = replace(head, joints=(*head.joints, joint))
    expected = frf_of(replace(station, stages=(*station.stages[:2], freed)))
    np.testing.assert_allclose(frf_of(station, effect), expected, rtol=1e-9, atol=1e-14)
    assert effect.answer().parameters == {"stiffness": 2e6, "damping": pytest.approx(600.0)}
    assert machine_of(station, [effect]).station.stages[2].joints[-1].name == f"head_{dof}"


def test_what_is_freed_is_rigid_in_the_drawing_and_stiffer_than_its_neighbours():
    station = chain(hinges=True)
    drawn = [draw_missing_dof(random_of(s), scene_of(station), None) for s in range(60)]
    assert {one.dof for one in drawn} == {"tx", "ty", "tz", "rz"}
    for one in drawn:
        # The head has hinges alone: a slide's reference comes from the arm below.
        below = 0.7 * 7e6 if one.dof[0] == "t" else 0.5 * 3e5
        assert one.reference == pytest.approx(10 * below)
    hinge = next(one for one in drawn if one.dof == "rz")
    assert hinge.time_constant == pytest.approx((5e-4 + 6e-4) / 2)


def test_a_direction_that_the_joints_already_span_is_not_freed():
    station = chain()
    skew = tuple(
        Joint(f"head_{name}", "slide", np.array(axis), np.zeros(3), 1e6, 1.0)
        for name, axis in {"a": [1.0, 1.0, 0.0], "b": [1.0, -1.0, 0.0]}.items()
    )
    head = replace(station.stages[2], joints=skew)
    scene = scene_of(replace(station, stages=(*station.stages[:2], head)))
    drawn = {draw_missing_dof(random_of(s), scene, None).dof for s in range(60)}
    assert drawn == {"tz", "rx", "ry", "rz"}


def test_two_hinges_apart_span_a_translation_too():
    station, point = chain(), np.array([0.3, 0.4, 0.5])
    hinges = tuple(
        Joint(f"head_{name}", "hinge", AXES[2], point + shift, 1e5, 1.0)
        for name, shift in {"a": np.zeros(3), "b": np.array([1.0, 0.0, 0.0])}.items()
    )
    head = replace(station.stages[2], joints=hinges)
    scene = scene_of(replace(station, stages=(*station.stages[:2], head)))
    drawn = {draw_missing_dof(random_of(s), scene, None).dof for s in range(60)}
    assert drawn == {"tx", "tz", "rx", "ry"}


def standing(k: dict[str, float], c: dict[str, float]) -> Station:
    """A block on one joint away from its centre of mass."""
    point = np.array([0.1, -0.2, 0.3])
    joints = tuple(
        Joint(
            name=f"block_{dof}",
            kind="slide" if dof[0] == "t" else "hinge",
            axis=AXES["xyz".index(dof[1])],
            position=point,
            stiffness=k[dof],
            damping=c[dof],
        )
        for dof in ("tx", "ty", "tz", "rx", "ry", "rz")
    )
    stage = StageBody(
        "block", GROUND, 50.0, np.array([0.15, 0.0, 0.8]), np.diag([3.0, 4, 5]), joints
    )
    return Station("standing", (stage,))


SPRINGS = {"tx": 2e6, "ty": 3e6, "tz": 5e6, "rx": 8e5, "ry": 4.5e5, "rz": 2e6}
DAMPERS = {dof: 1e-3 * value for dof, value in SPRINGS.items()}


def test_lost_supports_are_springs_that_are_missing_at_their_corners():
    # a^2 = k_ry / k_tz = 0.09, b^2 = k_rx / k_tz = 0.16; k_rz is more than 0.16 k_tx + 0.09 k_ty.
    station = standing(SPRINGS, DAMPERS)
    np.testing.assert_allclose(levers(np.array(list(SPRINGS.values()))), [0.3, 0.4, 1.0])
    effect = SupportLoss("block", (1, 3), size=0.6)
    stage = station.stages[0]

    def carried(a, b):
        total = np.zeros((6, 6))
        for x, y in ((-a, b), (a, -b)):
            for axis, name in zip(AXES, ("tx", "ty", "tz"), strict=True):
                row = point_row(stage, stage.joints[0].position + np.array([x, y, 0.0]), axis)
                total += 0.6 * SPRINGS[name] / 4 * np.outer(row, row)
        return total

    missing = carried(0.3, 0.4)
    rig, plain = (rig_of_block(station, effects) for effects in ([effect], []))
    np.testing.assert_allclose(plain.stiffness - rig.stiffness, missing, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(plain.damping - rig.damping, 1e-3 * missing, rtol=1e-9, atol=1e-6)
    assert effect.answer().parameters == {"fraction": pytest.approx((1.0, 0.4, 1.0, 0.4))}
    near = rig_of_block(station, [replace(effect, near=(0.5, 0.75))])
    np.testing.assert_allclose(plain.stiffness - near.stiffness, carried(0.15, 0.3), atol=1e-6)


def rig_of_block(station, effects):
    block = replace(station.stages[0], hit_points=())
    station = replace(station, stages=(replace(block, sensors=chain().stages[0].sensors),))
    return rig_of(station, effects).equations


@given(
    st.lists(st.floats(-3, 3), min_size=12, max_size=12),
    st.sampled_from([(0,), (1,), (0, 2), (1, 2), (0, 1, 2, 3)]),
)
def test_whatever_is_lost_nothing_pushes_back(logs, lost):
    names = list(SPRINGS)
    k = {dof: SPRINGS[dof] * np.exp(log) for dof, log in zip(names, logs[:6], strict=True)}
    c = {dof: DAMPERS[dof] * np.exp(log) for dof, log in zip(names, logs[6:], strict=True)}
    equations = rig_of_block(standing(k, c), [SupportLoss("block", lost, size=1.0)])
    for matrix, whole in ((equations.stiffness, k), (equations.damping, c)):
        assert np.linalg.eigvalsh(matrix)[0] > -1e-9 * max(whole.values())


def test_the_supports_carry_all_that_the_joint_has_against_tilting():
    # Without any of the four nothing is left of tx, ty, tz, rx, ry, whatever of rz.
    equations = rig_of_block(
        standing(SPRINGS, DAMPERS), [SupportLoss("block", (0, 1, 2, 3), size=1)]
    )
    left = np.linalg.eigvalsh(equations.stiffness)
    assert np.abs(left[:5]).max() < 1e-9 * left[5]
    assert left[5] > 1e5


def test_supports_that_would_twist_more_than_the_joint_stand_closer_for_it():
    # Half of what the levers would make of the slides: then all of rz is carried too.
    twist = 0.16 * SPRINGS["tx"] + 0.09 * SPRINGS["ty"]
    springs = SPRINGS | {"rz": twist / 2}
    assert levers(np.array(list(springs.values())))[2] == pytest.approx(np.sqrt(0.5))
    equations = rig_of_block(
        standing(springs, DAMPERS), [SupportLoss("block", (0, 1, 2, 3), size=1)]
    )
    assert np.abs(equations.stiffness).max() < 1e-9 * SPRINGS["tz"]


def test_supports_need_no_dampers():
    still = dict.fromkeys(DAMPERS, 0.0)
    equations = rig_of_block(standing(SPRINGS, still), [SupportLoss("block", (0,), size=0.5)])
    assert not equations.damping.any()


def test_supports_stand_under_six_springs_through_one_point(nominal, two_bodies):
    drawn = [draw_support_loss(random_of(s), scene_of(nominal, 11), None) for s in range(200)]
    assert {one.stage for one in drawn} == {stage.name for stage in nominal.stages}
    assert {len(one.lost) for one in drawn} == {1, 2}
    shares = np.array([one.near for one in drawn])
    assert 0.6 < shares.min() < 0.62
    assert 0.98 < shares.max() < 1
    assert {one.lost for one in drawn} == {
        some for count in (1, 2) for some in combinations(range(len(CORNERS)), count)
    }
    assert all(one.limits[1] == (1.0 if len(one.lost) == 1 else 0.95) for one in drawn)
    lower, upper = two_bodies.stages
    skew = replace(upper.joints[0], axis=np.array([1.0, 1.0, 0.0]))
    apart = replace(upper.joints[1], position=np.zeros(3))
    free = replace(upper.joints[2], stiffness=0.0)
    for number, joint in enumerate((skew, apart, free)):
        joints = tuple(joint if i == number else one for i, one in enumerate(upper.joints))
        station = replace(two_bodies, stages=(lower, replace(upper, joints=joints)))
        with pytest.raises(TruthError, match=r"joint:holder.*cannot.*joint:table"):
            draw_support_loss(random_of(1), scene_of(station), "joint:holder")


def test_more_than_all_cannot_be_lost():
    with pytest.raises(TruthError, match="make no sense"):
        SupportLoss("block", (0,), size=1.01)


@given(st.lists(st.floats(-1, 1), min_size=18, max_size=18))
def test_a_link_stores_what_it_is_stretched_by(motion):
    station = chain()
    effect = ParallelPath("base", "head", reference=2e6, time_constant=5e-4, size=0.1)
    rig, plain = rig_of(station, [effect]), rig_of(station)
    K = rig.equations.stiffness - plain.equations.stiffness
    C = rig.equations.damping - plain.equations.damping
    base, head = station.stages[0], station.stages[2]
    x, middle = np.array(motion), (base.com + head.com) / 2
    stretch = x[12:15] + np.cross(x[15:], middle - head.com)
    stretch -= x[:3] + np.cross(x[3:6], middle - base.com)
    assert x @ K @ x == pytest.approx(2e5 * stretch @ stretch, abs=1e-3)
    np.testing.assert_allclose(C, 5e-4 * K, rtol=1e-6, atol=1e-4)
    for name, size in (("stiffness", 2e5), ("damping", 100.0)):
        assert effect.answer().parameters[name] == pytest.approx((size, size, size))
    # A strut aside pulls along its axis alone.
    aside, axis = np.array([0.1, -0.2, 0.05]), np.array([0.6, 0.0, -0.8])
    strut = replace(effect, aside=tuple(aside), axis=tuple(axis))
    K = rig_of(station, [strut]).equations.stiffness - plain.equations.stiffness
    turned = np.cross(x[15:], aside) - np.cross(x[3:6], aside)
    assert x @ K @ x == pytest.approx(2e5 * (axis @ (stretch + turned)) ** 2, abs=1e-3)


def test_a_link_joins_bodies_that_no_joint_joins_and_scales_with_what_it_bypasses(nominal):
    names = [stage.name for stage in nominal.stages]
    scene = scene_of(nominal, 11)
    drawn = [draw_parallel_path(random_of(s), scene, None) for s in range(200)]
    pairs = {(names.index(one.lower), names.index(one.upper)) for one in drawn}
    assert pairs == {(i, j) for i in range(6) for j in range(i + 2, 6)}
    assert 60 < sum(one.axis is None for one in drawn) < 140
    apart = [
        np.subtract(*(nominal.stages[names.index(n)].com for n in (one.lower, one.upper)))
        for one in drawn
    ]
    share = np.array([one.aside for one in drawn]) / np.linalg.norm(apart, axis=1)[:, None]
    assert 0.4 < abs(share).max() <= 0.5
    one = draw_parallel_path(random_of(1), scene, "pair:ty-spindle")
    bypassed = [j.stiffness for i in (3, 4) for j in nominal.stages[i].joints if j.kind == "slide"]
    assert one.reference == pytest.approx(np.exp(np.mean(np.log(bypassed))))


def test_a_link_to_the_ground_is_drawn_where_it_is_named_alone(nominal):
    scene = scene_of(nominal, 11)
    link = draw_parallel_path(random_of(1), scene, "pair:world-spindle")
    assert (link.lower, link.upper) == ("world", "spindle")
    assert link.answer().location == "pair:world-spindle"
    bypassed = [
        j.stiffness for i in range(5) for j in nominal.stages[i].joints if j.kind == "slide"
    ]
    assert link.reference == pytest.approx(np.exp(np.mean(np.log(bypassed))))
    effect = replace(link, axis=None, aside=(0.0, 0.1, 0.0))
    added = rig_of(nominal, [effect]).equations.stiffness - rig_of(nominal).equations.stiffness
    x = random_of(2).normal(size=len(added))
    stretch = x[24:27] + np.cross(x[27:30], [0.0, 0.1, 0.0])
    stiffness = effect.answer().parameters["stiffness"]
    assert x @ added @ x == pytest.approx(stretch @ np.diag(stiffness) @ stretch, rel=1e-6)


def test_a_link_between_two_branches_goes_around_both_their_joints():
    base, arm, head = chain().stages
    fork = replace(chain(), stages=(base, arm, replace(head, parent=0)))
    one = draw_parallel_path(random_of(1), scene_of(fork), None)
    assert (one.lower, one.upper) == ("arm", "head")
    bypassed = [j.stiffness for stage in (arm, head) for j in stage.joints if j.kind == "slide"]
    assert one.reference == pytest.approx(np.exp(np.mean(np.log(bypassed))))


@pytest.mark.parametrize(("sign", "factor"), [(1, 1.25), (-1, 0.8)])
def test_a_joint_drifts_in_its_test_alone(sign, factor):
    station = chain()
    effect = Drift(stage="arm", test="acc1:+ty", sign=sign, size=float(np.log(1.25)))
    joints = tuple(
        replace(one, stiffness=factor * one.stiffness) for one in station.stages[1].joints
    )
    stages = (station.stages[0], replace(station.stages[1], joints=joints), station.stages[2])
    warm = frf_of(replace(station, stages=stages))
    plain, found = frf_of(station), frf_of(station, effect)
    np.testing.assert_allclose(found[:, :, 1], warm[:, :, 1], rtol=1e-9)
    np.testing.assert_array_equal(found[:, :, [0, 2]], plain[:, :, [0, 2]])
    assert effect.answer().parameters == {"factor": pytest.approx(factor)}


def test_a_drift_belongs_to_a_direction_or_to_a_setup():
    scene = scene_of(chain())
    labels = {f"acc1:+t{axis}" for axis in "xyz"}
    assert {draw_drift(random_of(s), scene, None).test for s in range(60)} == labels
    setups = tuple(replace(one, setup=name) for one in scene.occasions for name in "ab")
    moved = Scene(scene.station, setups)
    drawn = [draw_drift(random_of(s), moved, None).test for s in range(100)]
    assert set(drawn) == labels | {"a", "b"}
    assert 30 < sum(len(test) == 1 for test in drawn) < 70
    drift = Drift(stage="arm", test="b", sign=1, size=0.2)
    assert drift.answer().dof == "b"
    assert [drift.when(one) for one in setups] == [False, True] * 3
    assert not drift.when(OCCASIONS[0])


def test_a_drift_names_the_hit_as_the_drawing_does():
    arm = replace(chain().stages[1], hit_points=(HitPoint(40, np.array([0.1, 0.2, 0.6])),))
    station = replace(chain(), stages=(chain().stages[0], arm, chain().stages[2]))
    for node, site in ((40, "hit40"), (7, "acc7")):
        effect = draw_drift(random_of(1), scene_of(station, node), None)
        assert effect.answer().dof in {f"{site}:+t{axis}" for axis in "xyz"}
        assert sum(effect.when(one) for one in scene_of(station, node).occasions) == 1


def test_the_same_direction_at_two_levels_is_one_test():
    drift = Drift(stage="arm", test="acc1:+tx", sign=1, size=0.2)
    assert drift.when(Occasion(40.0, 1, 0))
    assert drift.when(Occasion(1000.0, 1, 0))
    assert not drift.when(Occasion(40.0, 11, 0))


def test_a_drift_names_the_site_that_is_hit():
    drift = Drift(stage="arm", test="acc29:+tx", sign=1, site="hit29", size=0.2)
    assert drift.answer().dof == "hit29:+tx"
    assert drift.when(Occasion(node=29, axis=0))
    assert Drift(stage="arm", test="b", sign=1, size=0.2).answer().dof == "b"
