"""Random machines: sizes, frequencies, sensors, and that others can read them."""

import mujoco
import numpy as np
import pytest
import scipy.linalg

from truth.campaign.file_formats import model_xml
from truth.machine.dynamics import assemble
from truth.machine.random_tree import STAGES, draw_tree
from truth.machine.rig import null_basis
from truth.machine.station import GROUND

SEEDS = range(40)


@pytest.fixture(scope="module")
def trees():
    return [draw_tree(seed) for seed in SEEDS]


def test_all_numbers_of_stages_come_and_some_trees_branch(trees):
    counts = {len(tree.stages) for tree in trees}
    assert counts >= set(range(STAGES[0], STAGES[1] + 1))
    parents = [[stage.parent for stage in tree.stages] for tree in trees]
    assert all(one[0] == GROUND and GROUND not in one[1:] for one in parents)
    assert any(len(set(one)) < len(one) for one in parents)


def test_stages_get_lighter_and_stand_above_their_parents(trees):
    for tree in trees:
        for stage in tree.stages[1:]:
            parent = tree.stages[stage.parent]
            assert stage.mass <= max(parent.mass, 2.0)
            assert stage.com[2] > parent.com[2]


def test_machines_are_stable_and_most_modes_are_in_the_band(trees):
    inside = 0
    for tree in trees:
        equations = assemble(tree)
        basis = null_basis(equations)
        mass, stiffness, damping = (
            basis.T @ one @ basis
            for one in (equations.mass, equations.stiffness, equations.damping)
        )
        squares, shapes = scipy.linalg.eigh(stiffness, mass)
        assert squares.min() > 0
        frequency = np.sqrt(squares) / (2 * np.pi)
        assert frequency.min() > 2
        ratios = np.diag(shapes.T @ damping @ shapes) / (2 * np.sqrt(squares))
        assert ratios[frequency < 200].min() > 0.003
        assert ratios[frequency < 200].max() < 0.3
        inside += ((frequency > 5) & (frequency < 200)).mean()
    assert inside / len(trees) > 0.7


def test_every_stage_has_three_sensors_and_one_point_is_hit(trees):
    for tree in trees:
        assert all(3 <= len(stage.sensors) <= 4 for stage in tree.stages)
        assert sum(len(stage.hit_points) for stage in tree.stages) == 1
        assert tree.first_aim() in {h.node for stage in tree.stages for h in stage.hit_points}


def test_some_directions_are_rigid(trees):
    numbers = {len(stage.joints) for tree in trees for stage in tree.stages}
    assert numbers == {4, 5, 6}


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_a_simulator_reads_the_drawing_and_knows_its_mass_matrix(seed):
    tree = draw_tree(seed)
    model = mujoco.MjModel.from_xml_string(model_xml(tree))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    equations = assemble(tree)
    basis = null_basis(equations)
    ours = np.sort(
        scipy.linalg.eigh(
            basis.T @ equations.stiffness @ basis,
            basis.T @ equations.mass @ basis,
            eigvals_only=True,
        )
    )
    theirs = np.sort(
        scipy.linalg.eigh(np.diag(model.jnt_stiffness.ravel()[: model.nv]), full, eigvals_only=True)
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-7)


def test_the_same_seed_gives_the_same_machine():
    assert model_xml(draw_tree(7)) == model_xml(draw_tree(7))
    assert model_xml(draw_tree(7)) != model_xml(draw_tree(8))
    assert len(draw_tree(7, 4).stages) == 4
