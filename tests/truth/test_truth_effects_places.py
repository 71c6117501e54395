"""Where effects sit, and what they draw."""

import numpy as np
import pytest
from effect_rigs import chain, machine_of, random_of, rig_of, scene_of
from hypothesis import given
from hypothesis import strategies as st

from truth.effects.places import (
    body_motion,
    choose,
    draw_direction,
    draw_location,
    draw_spring_stage,
    draw_stage,
    joint_stretch,
    log_uniform,
    relative_motion,
    sign,
    springs,
    unit_vector,
)
from truth.effects.places import direction_of as direction
from truth.effects.sensor_errors import draw_sensor_delay
from truth.errors import TruthError
from truth.machine.station import Joint

LOCATIONS = ["sensor:acc1", "sensor:acc2", "sensor:acc30"]


def joint(name, kind, axis):
    return Joint(name, kind, np.array(axis), np.zeros(3), 1.0, 0.0)


def test_a_joint_is_called_as_its_name_ends_or_as_its_axis_points():
    assert direction(joint("head_ry", "hinge", [0.0, 1.0, 0.0])) == "ry"
    assert direction(joint("first_of_ty_rz", "hinge", [0.0, 0.1, 1.0])) == "rz"
    assert direction(joint("lift", "slide", [0.1, 0.2, -0.9])) == "tz"
    assert direction(joint("knee", "hinge", [-1.0, 0.2, 0.1])) == "rx"


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_choosing_uses_one_number_however_many_there_are(seed, count):
    one, other = np.random.default_rng(seed), np.random.default_rng(seed)
    assert choose(one, range(count)) in range(count)
    other.random()
    assert one.random() == other.random()


def test_each_is_chosen_alike():
    random = random_of(2)
    counts = np.bincount([choose(random, range(4)) for _ in range(4000)])
    assert np.abs(counts - 1000).max() < 5 * np.sqrt(750)
    assert {sign(random) for _ in range(20)} == {1, -1}


def test_decades_are_drawn_alike():
    random = random_of(1)
    values = np.array([log_uniform(random, (1e-3, 10.0)) for _ in range(4000)])
    assert values.min() >= 1e-3
    assert values.max() <= 10
    assert np.median(values) == pytest.approx(0.1, rel=0.3)


@pytest.mark.parametrize("span", [None, [[1.0, 2, 0], [0, 1, 1]], [[0.0, 0, 2], [0, 0, -1]]])
def test_a_direction_is_a_unit_vector_of_its_space(span):
    random = random_of(1)
    rows = np.eye(3) if span is None else np.array(span)
    drawn = np.array([unit_vector(random, None if span is None else rows) for _ in range(2000)])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1)
    rank = np.linalg.matrix_rank(rows)
    assert np.linalg.matrix_rank(np.vstack([rows, drawn[:50]]), tol=1e-9) == rank
    # In a space of that dimension the mean square along each of its directions is 1 / dimension.
    spread = np.linalg.eigvalsh(drawn.T @ drawn / 2000)[-rank:]
    np.testing.assert_allclose(spread, 1 / rank, rtol=0.1)


def test_a_location_is_drawn_or_named_in_full_or_short():
    random = random_of(1)
    assert {draw_location(random, None, LOCATIONS) for _ in range(40)} == {0, 1, 2}
    assert draw_location(random, "sensor:acc2", LOCATIONS) == 1
    assert draw_location(random, "acc30", LOCATIONS) == 2
    assert draw_location(random, None, []) is None
    assert draw_location(random, "acc30", []) is None
    with pytest.raises(TruthError, match=r"'acc3' cannot.*acc1, sensor:acc2, sensor:acc30$"):
        draw_location(random, "acc3", LOCATIONS)
    with pytest.raises(TruthError, match=r"sensor:12 \.\.\.$"):
        draw_location(random, "lid", [f"sensor:{number}" for number in range(1, 40)])


def test_a_stage_is_named_with_its_kind():
    random = random_of(1)
    assert draw_stage(random, chain(), "joint:arm", "joint", [0, 1]) == 1
    assert draw_stage(random, chain(), "arm", "joint", [0, 1]) == 1
    assert draw_stage(random, chain(), None, "joint", []) is None
    with pytest.raises(TruthError, match="sits at joint:<name>"):
        draw_stage(random, chain(), "body:arm", "joint", [0, 1])
    with pytest.raises(TruthError, match=r"'joint:head' cannot.*joint:base, joint:arm$"):
        draw_stage(random, chain(), "joint:head", "joint", [0, 1])
    with pytest.raises(TruthError, match="'lid' is unknown; the model has base, arm, head"):
        draw_stage(random, chain(), "joint:lid", "joint", [0, 1])


def test_a_direction_is_drawn_among_those_that_can_be_used():
    def hinge(one):
        return one.kind == "hinge"

    drawn = [draw_direction(random_of(s), chain(), "joint:arm", hinge) for s in range(30)]
    assert {(one.number, one.dof) for one in drawn} == {(3, "rx"), (4, "ry"), (5, "rz")}
    assert {one.location for one in drawn} == {"joint:arm"}
    assert drawn[0].joint(chain()).name == f"arm_{drawn[0].dof}"
    assert draw_direction(random_of(1), chain(), None, lambda _: False) is None


def test_sensors_and_springs_are_found():
    drawn = [draw_sensor_delay(random_of(s), scene_of(chain()), None) for s in range(99)]
    nodes = {effect.node for effect in drawn}
    assert nodes == set(range(1, 13))
    assert {draw_spring_stage(random_of(s), chain(), None) for s in range(30)} == {
        "base",
        "arm",
        "head",
    }


def test_rows_are_as_wide_as_the_rig_and_give_the_joints_stretch():
    station = chain()
    tested, rig = machine_of(station), rig_of(station).with_coordinate()
    rows = joint_stretch(rig, tested, 1)
    assert rows.shape == (6, 19)
    assert not rows[:, 18].any()
    point = station.stages[1].joints[0].position
    np.testing.assert_allclose(rows, relative_motion(rig, tested, 1, point), atol=1e-12)
    on_ground = relative_motion(rig, tested, 0, point)
    np.testing.assert_array_equal(on_ground, body_motion(rig, tested, 0, point))
    matrix = springs(rows, [joint.stiffness for joint in station.stages[1].joints])
    lone = sum(
        one.stiffness * np.outer(row, row)
        for one, row in zip(station.stages[1].joints, rows, strict=True)
    )
    np.testing.assert_allclose(matrix, lone, rtol=1e-9, atol=1e-6)
