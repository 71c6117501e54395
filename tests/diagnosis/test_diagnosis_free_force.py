"""Free forces: the gain is that of the dense covariance; whatever pushes is found where it does."""

import tomllib

import numpy as np
import pytest

from diagnosis.search.free_force import _LinearisedFit, fit_free_forces
from diagnosis.settings import SETTINGS
from identification import smooth_variance
from mbmodel import Evaluator, FrfRequest
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, refit_null
from tuning import open_session, thin_lines
from tuning.misfit.accumulation import FreeForceReduction

POWER = 30.0


def begun(folder, seed, effect=None, **more):
    session, answer = drawn(folder, seed, effect, **more)
    scene = early_scene(session)
    return scene, tomllib.loads(answer)


def dense(scene, found, force, power, model_error):
    """The same gain with every covariance written out, test by test."""
    model, varies, x = scene.session.model, found.parametrisation, found.x
    campaign = thin_lines(scene.session.campaign, SETTINGS.score_stride)
    rates = np.zeros((len(varies.free), varies.size))
    rates[varies.free, varies.coordinate_of[varies.free]] = varies.rates(x)[varies.free]
    parts = []
    for test in campaign.tests:
        estimate, frf = test.estimate, test.estimate.frf
        question = FrfRequest(frf.freq_hz, frf.outputs, frf.inputs, frf.quantity)
        lines = Evaluator(model, question).at(varies.theta(x))
        power_of = {
            d.point: sum(
                np.abs(frf.values[:, k, 0]) ** 2
                for k, e in enumerate(frf.outputs)
                if e.point == d.point
            )
            for d in frf.outputs
        }
        floor = model_error**2 * np.stack([power_of[d.point] for d in frf.outputs], axis=1)
        weight = np.where(
            estimate.measured[:, 0], np.sqrt(2 / (smooth_variance(estimate)[:, :, 0] + floor)), 0.0
        )
        laplace = question.laplace[:, None, None]
        m = lines.assembly.matrices
        z = laplace**2 * m.mass + laplace * m.damping + m.stiffness
        answers = lines.readout @ np.linalg.solve(z, np.tile(force[:, None], (len(z), 1, 1)))
        off = weight * (lines.values - frf.values)[:, :, 0]
        columns = weight[..., None] * (lines.columns() @ rates)[:, :, 0]
        parts.append((off, columns, weight * answers[:, :, 0]))
    middle = np.median(np.concatenate([(np.abs(u) ** 2).sum(axis=1) for _, _, u in parts]))

    def cost(p):
        value, gradient = 0.5 * (varies.precision * x**2).sum(), varies.precision * x
        normal, chance = np.diag(varies.precision), 0.0
        for off, columns, answers in parts:
            for r, d, u in zip(off, columns, answers, strict=True):
                covariance = np.eye(len(r)) + p * np.outer(u, u.conj())
                weighed = np.linalg.solve(covariance, np.column_stack([r, d]))
                value += 0.5 * (r.conj() @ weighed[:, 0]).real
                gradient = gradient + (d.conj().T @ weighed[:, 0]).real
                normal = normal + (d.conj().T @ weighed[:, 1:]).real
                chance += np.log(np.linalg.det(covariance).real)
        free = ~varies.coordinates_at_bound(x)
        step = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
        return value - 0.5 * gradient[free] @ step + chance

    return cost(0.0) - cost(power / middle)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A machine that lacks nothing: its scene and its null model."""
    scene, _ = begun(tmp_path_factory.mktemp("fitted"), 72_031, lines=161)
    return scene, refit_null(scene).fit


def test_the_gain_is_that_of_the_dense_covariance(fitted):
    scene, early = fitted
    size = len(scene.model.machine.coordinates)
    forces = np.random.default_rng(3).standard_normal((size, 3))
    powers = np.full(3, POWER)
    for model_error in (3e-4, 2e-2):
        linearised = _LinearisedFit.linearise(scene, early, model_error)
        gains = linearised.compute_gains(forces, powers, SETTINGS.max_force_values)
        few = linearised.compute_gains(forces, powers, 1)  # one force at once
        np.testing.assert_allclose(few, gains, rtol=1e-9)
        for force, gain in zip(forces.T, gains, strict=True):
            expected = dense(scene, early, force, POWER, model_error)
            assert gain == pytest.approx(expected, rel=1e-5, abs=1e-3)


def test_the_power_is_that_of_the_largest_gain_if_nothing_else_varies(fitted):
    scene, early = fitted
    forces = np.random.default_rng(3).standard_normal((len(scene.model.machine.coordinates), 3))
    linearised = _LinearisedFit.linearise(scene, early, 3e-3)
    powers = np.array(SETTINGS.force_powers)
    gains = np.zeros((len(powers), 3))
    for k, power in enumerate(powers):
        reduction = FreeForceReduction.zeros(3, len(early.x))
        for misfit in linearised.misfits:
            misfit.add_force_reduction(early.x, forces, np.full(3, power), reduction)
        gains[k] = reduction.value - reduction.expected_gain
    together = sum(misfit.force_gains(early.x, forces, powers) for misfit in linearised.misfits)
    np.testing.assert_allclose(together, gains, rtol=1e-9)
    chosen = linearised.choose_powers(forces, powers)
    np.testing.assert_array_equal(chosen, powers[gains.argmax(axis=0)])


@pytest.mark.parametrize(("effect", "seed"), [("hardening", 72_032), ("backlash", 72_033)])
def test_what_no_linear_effect_explains_is_found_where_it_pushes(tmp_path, effect, seed):
    scene, answer = begun(tmp_path, seed, effect, ratio=4.0, lines=161)
    null = refit_null(scene)
    forces = fit_free_forces(scene, null.fit, null.floor)
    assert (forces[0].location, forces[0].dof) == (answer["location"], answer["dof"])
    gains = [force.gain for force in forces]
    assert gains == sorted(gains, reverse=True)
    assert len({force.location for force in forces}) == len(forces)
    # It explains a part of the residual's cost, and much more than one at any other place.
    assert 0 < forces[0].share < 1
    assert gains[0] > max(gains[1:]) + 10


def test_where_nothing_may_vary_forces_are_free_all_the_same(tmp_path):
    drawn(tmp_path, 72_013, "gyroscopic", ratio=6.0, lines=81)
    file = tmp_path / "campaign" / "campaign.toml"
    file.write_text(file.read_text("utf-8") + '\n[tuning]\nfix = ["*"]\n', encoding="utf-8")
    scene = early_scene(open_session(tmp_path / "campaign"))
    null = refit_null(scene)
    assert null.fit.parametrisation.size == 0
    assert max(force.gain for force in fit_free_forces(scene, null.fit, null.floor)) > 0
