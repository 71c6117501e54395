"""Score tests of the catalogue: gains by forces and by stacked factors against slower twins."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data_checks.check_data import check_data
from diagnosis.effects import load_catalogue
from diagnosis.null_model import set_scene
from diagnosis.search.linearised_fit import ScoredFit
from diagnosis.settings import SETTINGS
from mbmodel import ForwardSensitivities, Model
from tests.helpers.drawn import drawn
from tuning import Misfit, parametrise, thin_lines


@pytest.fixture(scope="module")
def probed(tmp_path_factory):
    """Return hypotheses, coordinates with their names, x, probes, and the misfit about x."""
    session = drawn(tmp_path_factory.mktemp("drawn"), 72_002, lines=161)[0]
    data = check_data(session, SETTINGS)
    scene = set_scene(data.session, data.checks, data.directions, 1, SETTINGS)
    session = scene.session
    varies, model = session.parametrisation, session.model
    random = np.random.default_rng(3)
    x = varies.coordinates(model.drawn) + 0.3 * random.standard_normal(varies.size)
    x = np.clip(x, varies.lower, varies.upper)
    released = np.flatnonzero(varies.is_tolerance)[::7]
    x[released] = varies.upper[released]
    scene = replace(scene, theta=varies.theta(x))
    hypotheses = [
        hypothesis
        for effect in load_catalogue().values()
        for hypothesis in effect(scene)
        if all(Model(model.machine, hypothesis.parts).acting_fractions(None))
    ]
    parts = dict.fromkeys(part for hypothesis in hypotheses for part in hypothesis.parts)
    extended = Model(model.machine, (*model.parts, *parts))
    whole = varies.extend(parametrise(extended, session.campaign.tolerance))
    wanted = {name for hypothesis in hypotheses for name in hypothesis.coordinates}
    is_probe = np.array([name in wanted for name in whole.names])
    is_probe[: varies.size] = False
    x_whole = np.append(x, np.zeros(whole.size - varies.size))
    probes = whole.restrict(is_probe, x_whole)
    fitted = whole.restrict(np.arange(whole.size) < varies.size, x_whole)
    thin = thin_lines(session.campaign, 5)
    misfit = Misfit(extended, thin, fitted, model_error_floor=0.05)
    return hypotheses, varies, x, probes, misfit


def test_probes_by_forces_couple_as_their_columns_do(probed, monkeypatch):
    _, _, x, probes, misfit = probed
    by_forces = misfit.probe_coordinates(x, probes)
    monkeypatch.setattr(
        ForwardSensitivities,
        "is_force_alone",
        property(lambda forward: np.zeros(forward.count, bool)),
    )
    by_columns = misfit.probe_coordinates(x, probes)
    size = np.sqrt(np.diag(by_columns.blocks))
    varying_size = np.sqrt(np.maximum(by_columns.normal.diagonal(), 1e-300))
    assert (size > 0).all()
    np.testing.assert_allclose(
        by_forces.blocks / np.outer(size, size), by_columns.blocks / np.outer(size, size), atol=1e-9
    )
    np.testing.assert_allclose(
        by_forces.cross / np.outer(varying_size, size),
        by_columns.cross / np.outer(varying_size, size),
        atol=1e-9,
    )
    np.testing.assert_allclose(
        by_forces.slope / size, by_columns.slope / size, rtol=1e-9, atol=1e-9
    )
    assert np.abs(by_columns.cross / np.outer(varying_size, size)).max() > 0.1


def test_gains_equal_those_of_normal_equations_without_the_released_coordinates(probed):
    hypotheses, varies, x, probes, misfit = probed
    equations = misfit.probe_coordinates(x, probes)
    fit = ScoredFit(varies, x, equations)
    place = {name: k for k, name in enumerate((*varies.names, *probes.names))}
    free = ~varies.coordinates_at_bound(x)
    assert not free.all()
    several = {}
    for hypothesis in hypotheses:
        several.setdefault(hypothesis.effect, hypothesis)
    for hypothesis in several.values():
        chosen = np.array([place[name] for name in hypothesis.coordinates])
        gain, step = fit.score(hypothesis, chosen)
        slow_gain, slow_step = slow_score(varies, x, equations, hypothesis, chosen)
        assert gain == pytest.approx(slow_gain, rel=1e-6, abs=1e-6), hypothesis.words
        np.testing.assert_allclose(step, slow_step, rtol=1e-5, atol=1e-6 * np.abs(step).max())
    assert any(np.isin(fitted.release, varies.names).any() for fitted in several.values())


def slow_score(varies, x, equations, hypothesis, chosen):
    """Solve the normal equations of everything that is tuned anew, without the chosen ones."""
    count, n_probe = len(x), equations.cross.shape[1]
    whole = np.zeros((count + n_probe, count + n_probe))
    whole[:count, :count] = equations.normal.dense()
    whole[:count, count:] = equations.cross
    whole[count:, :count] = equations.cross.T
    whole[count:, count:] = equations.blocks
    slope = np.append(equations.gradient, equations.slope)
    slope[:count] -= np.where(np.isin(np.arange(count), chosen), varies.precision * x, 0.0)
    tuned = np.flatnonzero(~varies.coordinates_at_bound(x))
    tuned = tuned[~np.isin(tuned, chosen)]
    matrix = whole[np.ix_(tuned, tuned)] + np.diag(varies.precision[tuned])
    scale = 1 / np.sqrt(np.diag(matrix))
    matrix = matrix * np.outer(scale, scale) + np.sqrt(np.finfo(float).eps) * np.eye(len(tuned))
    cross = whole[np.ix_(tuned, chosen)]
    solved = np.linalg.solve(matrix, np.column_stack([cross, slope[tuned]]) * scale[:, None])
    solved *= scale[:, None]
    schur = whole[np.ix_(chosen, chosen)] - cross.T @ solved[:, :-1]
    right = slope[chosen] - cross.T @ solved[:, -1]
    unit = 1 / np.sqrt(np.diag(whole)[chosen])
    values, vectors = np.linalg.eigh(schur * np.outer(unit, unit))
    kept = values > 1e-6
    along = vectors[:, kept].T @ (right * unit)
    step = -(vectors[:, kept] @ (along / values[kept]))
    if hypothesis.signed and (step < 0).any():
        rest = chosen[np.arange(len(chosen)) != np.argmin(step)]
        if not len(rest):
            return 0.0, np.zeros(1)
        gain, shorter = slow_score(varies, x, equations, hypothesis, rest)
        whole_step = np.zeros(len(chosen))
        whole_step[np.isin(chosen, rest)] = shorter
        return gain, whole_step
    return 0.5 * float((along**2 / values[kept]).sum()), step * unit
