"""Refits from the drawing: a basin in which a fit without the cause ended is left."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.hypothesis import Scene
from diagnosis.null_model import fit_null_model
from diagnosis.refits.refitting import RefitTask, add_hypotheses, find_start, run_refits
from diagnosis.search.drawn_starts import refit_from_drawing
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tuning import is_gap_visible


@pytest.fixture(scope="module")
def lost(tmp_path_factory):
    """Refits of the right cause and a wrong one from a stiffness a hundred times too high."""
    session, answer = drawn(tmp_path_factory.mktemp("lost"), 72_031, "inertance", ratio=8.0)
    truth = tomllib.loads(answer)
    key = truth["effect"], truth["location"], truth["dof"]
    scene = Scene(session, session.model.drawn)
    null = fit_null_model(scene, SETTINGS)
    scene = replace(scene, session=null.session, theta=null.fit.theta)
    proposed = list(EFFECTS["inertance"](scene))
    right = next(hypothesis for hypothesis in proposed if hypothesis.key == key)
    wrong = next(iter(EFFECTS["gyroscopic"](scene)))
    varies = null.session.parametrisation
    x = np.where(varies.is_tolerance, 0.0, varies.upper)
    far = replace(scene, theta=varies.theta(x))
    tasks = []
    for hypothesis in (wrong, right):
        whole = add_hypotheses(null.session, hypothesis)
        start = find_start(far, whole, hypothesis)
        tasks.append(RefitTask((hypothesis,), whole, start, null.floor))
    return scene, run_refits(scene, tasks, SETTINGS.schedule), right


def test_the_right_cause_is_refitted_from_the_drawing_where_its_refit_is_lost(lost):
    scene, refits, right = lost
    assert all(is_gap_visible(refit.gap) for refit in refits)
    best = min(refit_from_drawing(scene, refits, SETTINGS), key=lambda refit: refit.objective)
    assert best.causes == (right,)
    assert not is_gap_visible(best.gap)
    assert best.objective < min(refit.objective for refit in refits)
    assert refit_from_drawing(scene, [*refits, best], SETTINGS) == []
