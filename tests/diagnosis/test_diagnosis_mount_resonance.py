"""A sensor on a soft mounting is found by its fit to the model, without redundant channels."""

import tomllib

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.search.score_test import scores
from diagnosis.settings import SETTINGS
from identification import mount_response
from mbmodel import Model
from tests.helpers.drawn import drawn, line_by_line
from tests.helpers.refits import early_scene, refit_null, refit_with


def propose_mountings(scene: Scene):
    return list(EFFECTS["mount_resonance"](scene))


@pytest.mark.parametrize(("u", "steps"), [(1.0, 0.0), (0.4, 1.3), (2.5, -0.8)])
def test_readings_are_the_motion_times_the_transmissibility(tmp_path, u, steps):
    session, _ = drawn(tmp_path, 72_031, lines=61)
    scene = Scene(session, session.model.drawn)
    mounting = propose_mountings(scene)[4]
    model = Model(session.model.machine, (*session.model.parts, *mounting.parts))
    theta = np.concatenate([session.model.drawn, [u, steps]])
    rigid = line_by_line(session.model, session.model.drawn, session.campaign)
    read = line_by_line(model, theta, session.campaign)
    names = [parameter.name for parameter in mounting.parts[0].parameters]
    stated = mounting.state(dict(zip(names, (u, steps), strict=True)))
    response = mount_response(session.campaign.freq_hz, stated["frequency"], stated["damping"])
    site = mounting.location.partition(":")[2]
    is_mounted = np.array([dof.point == site for dof in session.campaign.outputs])
    expected = np.where(is_mounted[:, None], response[:, None, None], 1.0) * rigid
    np.testing.assert_allclose(read, expected, rtol=1e-10, atol=1e-13 * np.abs(rigid).max())


def test_a_rigid_mounting_states_nothing(tmp_path):
    session, _ = drawn(tmp_path, 72_031, lines=61)
    mounting = propose_mountings(Scene(session, session.model.drawn))[0]
    names = [parameter.name for parameter in mounting.parts[0].parameters]
    assert mounting.state(dict.fromkeys(names, 0.0)) == {}


@pytest.mark.parametrize("seed", [72_032, 72_036])
def test_the_mounting_is_scored_first_and_its_frequency_is_recovered(tmp_path, seed):
    session, text = drawn(tmp_path, seed, "mount_resonance", ratio=6.0, lines=161)
    answer = tomllib.loads(text)
    scene = early_scene(session)
    null = refit_null(scene)
    scene = Scene(session, null.fit.theta)
    proposed = [hypothesis for effect in EFFECTS.values() for hypothesis in effect(scene)]
    ranked = scores(scene, null.fit, proposed, null.floor, SETTINGS.score_stride)
    best = ranked[0].hypothesis
    assert best.key == ("mount_resonance", answer["location"], None)
    ended = refit_with(scene, null, best)
    assert ended.summary.chi_square < 1.1
    stated = ended.state_parameters(best)
    assert stated["frequency"] == pytest.approx(answer["parameters"]["frequency"], rel=0.01)
    assert stated["damping"] == pytest.approx(answer["parameters"]["damping"], rel=0.1)
