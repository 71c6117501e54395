"""Impossible moments of inertia: the nearest possible ones are written, with a remark."""

import mujoco
import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf
from scipy.spatial.transform import Rotation

from mbmodel import Model, NotInMjcf, body_parts, load_machine, write_mjcf
from mbmodel.spatial import nearest_inertia


def second_moments(inertia):
    """Sum of r r' over a body's mass: tr(I)/2 1 - I."""
    return np.trace(inertia) / 2 * np.eye(3) - inertia


def turned_inertia(second, seed=1):
    """I = tr(J) 1 - J of principal second moments, about skew axes."""
    axes = Rotation.random(random_state=seed).as_matrix()
    full = axes @ np.diag(second) @ axes.T
    return np.trace(full) * np.eye(3) - full


@pytest.fixture
def model(from_text):
    """One mass on a spring, whose mass, inertia and centre may be tuned."""
    machine = from_text(mjcf(mass_on_spring(4, 3e4, 7)))
    return Model(machine, body_parts(machine))


def theta_with(model, **values):
    """Return the parameters as drawn with some values replaced."""
    names = [parameter.name.partition(".")[2] for parameter in model.parameters]
    theta = model.drawn.copy()
    for name, value in values.items():
        theta[names.index(name)] = value
    return theta


def test_what_a_body_can_have_stays_as_it_is():
    for seed in range(5):
        inertia = turned_inertia(np.random.default_rng(seed).uniform(0.01, 3, 3), seed)
        np.testing.assert_array_equal(nearest_inertia(inertia), inertia)


def test_second_moments_below_zero_become_small_and_the_others_stay():
    nearest = nearest_inertia(turned_inertia([-0.4, 1.0, 3.0]))
    np.testing.assert_allclose(nearest, turned_inertia([4e-6, 1.0, 3.0]), atol=1e-12)


def test_no_body_is_nearer_than_the_nearest():
    random = np.random.default_rng(2)
    wanted = second_moments(turned_inertia([-0.4, -0.1, 2.0]))
    nearest = second_moments(nearest_inertia(turned_inertia([-0.4, -0.1, 2.0])))
    root = np.linalg.cholesky(nearest)
    for size in (1e-4, 1e-2, 0.3):
        for _ in range(100):
            factor = root + size * random.normal(size=(3, 3))  # factor @ factor.T is any body's
            assert (
                np.linalg.norm(factor @ factor.T - wanted) > np.linalg.norm(nearest - wanted) - 1e-5
            )


@pytest.mark.parametrize("moment", [3.0, 0.003, -0.5])
def test_mass_and_centre_are_written_where_no_body_has_the_moments(model, tmp_path, moment):
    inertia = {"inertia_xx": 1.0, "inertia_yy": 1.1, "inertia_zz": moment, "inertia_xy": 0.9}
    theta = theta_with(model, mass=6.5, com_x=0.02, com_z=-0.01, **inertia)
    target = tmp_path / "tuned.xml"
    assert write_mjcf(model.machine.source, target, model.edits(theta)) == ()
    (missing,) = (edit for edit in model.edits(theta) if isinstance(edit, NotInMjcf))
    assert str(missing) == (
        "a.inertia (no body can have the fitted moments of inertia, "
        "so the nearest possible ones are written)"
    )
    written = load_machine(target)
    drawn = model.machine.layout.centres[0]
    assert written.mass == pytest.approx(6.5, rel=1e-12)
    np.testing.assert_allclose(written.layout.centres[0] - drawn, [0.02, 0, -0.01], atol=1e-12)
    frf_request = np.array([[1.0, 0.9, 0], [0.9, 1.1, 0], [0, 0, moment]])
    np.testing.assert_allclose(written.body_mass[3:, 3:], nearest_inertia(frf_request), atol=1e-9)


def test_mujoco_itself_takes_the_thinnest_body_that_is_written(model, tmp_path):
    inertia = {"inertia_xx": 1.0, "inertia_yy": 0.5, "inertia_zz": 40.0}
    target = tmp_path / "tuned.xml"
    write_mjcf(model.machine.source, target, model.edits(theta_with(model, **inertia)))
    low, middle, high = np.sort(mujoco.MjModel.from_xml_path(str(target)).body_inertia[1])
    assert 0 < low + middle - high < 1e-3 * high


def test_of_moments_that_a_body_can_have_nothing_is_said(model, tmp_path):
    theta = theta_with(model, mass=6.5, inertia_xx=1.0, inertia_yy=1.1, inertia_zz=1.2)
    assert write_mjcf(model.machine.source, tmp_path / "m.xml", model.edits(theta)) == ()
    assert not any(isinstance(edit, NotInMjcf) for edit in model.edits(theta))
    written = load_machine(tmp_path / "m.xml")
    np.testing.assert_allclose(written.body_mass[3:, 3:], np.diag([1.0, 1.1, 1.2]), rtol=1e-12)
