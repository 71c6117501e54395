"""Errors of FRFs by random changes of all forces, against machines that are changed at random."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from small_machine import MJCF

from identification.words import Dof, Signal
from mbmodel import Evaluator, FrfRequest, as_drawn
from tuning.assessment.model_discrepancy import discrepancy_motion

FREQ = np.array([7.0, 21.0, 33.0, 60.0, 120.0])
REQUEST = FrfRequest(
    FREQ,
    (Dof.parse("acc3:+tx"), Dof.parse("head:-rz"), Signal("joint:base_tz")),
    (Dof.parse("acc1:+tz"), Signal("joint:head_tx"), Signal("acc3-acc1:+ty")),
    "mobility",
)


@pytest.fixture(scope="module")
def lines(from_text):
    model = as_drawn(from_text(MJCF))
    return Evaluator(model, REQUEST).at(model.drawn)


def random_errors(lines, count, seed):
    """Exact changes of the FRFs for small random changes of Z; (count, n_freq, n_out, n_in)."""
    matrices, rng = lines.assembly.matrices, np.random.default_rng(seed)
    squares, shapes = scipy.linalg.eigh(matrices.stiffness, matrices.mass)
    to_forces = matrices.mass @ shapes
    step, size = 1e-5, len(squares)
    errors = []
    for s in lines.request.laplace:
        dynamic = s**2 * matrices.mass + s * matrices.damping + matrices.stiffness
        root = np.sqrt(squares + abs(s) ** 2)
        drawn = rng.standard_normal((2, count, size, size)) / np.sqrt(2)
        x = (drawn[0] + 1j * drawn[1]) * (1 - np.eye(size)) * np.outer(root, root)
        changed = dynamic + step * (to_forces @ x @ to_forces.T)
        frfs = s * lines.readout @ np.linalg.solve(changed, lines.drive.astype(complex))
        errors.append((frfs - s * lines.readout @ np.linalg.solve(dynamic, lines.drive)) / step)
    return np.array(errors).transpose(1, 0, 2, 3)


def test_deviations_are_those_of_machines_that_are_changed_at_random(lines):
    errors = random_errors(lines, 4000, seed=11)
    spread = np.sqrt((np.abs(errors) ** 2).mean(axis=0))
    # the mean square of 4000 complex normal numbers is known to 1.6 %
    np.testing.assert_allclose(discrepancy_motion(lines), spread, rtol=0.06)


def test_sums_of_outputs_and_inputs_have_the_deviations_of_their_sums(lines):
    rng = np.random.default_rng(3)
    left = rng.standard_normal((len(FREQ), 2, 3)) + 1j * rng.standard_normal((len(FREQ), 2, 3))
    right = rng.standard_normal((len(FREQ), 3, 2)) + 1j * rng.standard_normal((len(FREQ), 3, 2))
    errors = left @ random_errors(lines, 4000, seed=12) @ right
    spread = np.sqrt((np.abs(errors) ** 2).mean(axis=0))
    np.testing.assert_allclose(discrepancy_motion(lines, left, right), spread, rtol=0.06)


def test_a_machine_of_one_mode_has_no_discrepancy_beside_its_parameters(from_text):
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="m">
    <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
    <joint name="m_tx" type="slide" axis="1 0 0" stiffness="1e4" damping="5"/>
    <site name="acc1"/></body></worldbody></mujoco>"""
    model = as_drawn(from_text(text))
    port = (Dof.parse("acc1:+tx"),)
    lines = Evaluator(model, replace(REQUEST, outputs=port, inputs=port)).at(model.drawn)
    assert discrepancy_motion(lines) == pytest.approx(0.0, abs=1e-9)
