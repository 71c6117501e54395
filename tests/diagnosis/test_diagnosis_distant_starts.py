"""Causes whose slope tells little: they are refitted from distant starts."""

import tomllib

from diagnosis.data_checks.check_data import check_data
from diagnosis.null_model import fit_baseline
from diagnosis.search.refit_round import list_excluded, refit_round, score_hypotheses
from diagnosis.settings import SETTINGS
from tests.helpers.refits import draw_imperfect


def test_a_rigid_direction_without_slope_is_refitted_and_explains_the_gap(tmp_path):
    """The fit without it makes up for the direction by softer springs, which hide its slope."""
    session, answer = draw_imperfect(tmp_path, 73_107, "missing_dof", dirt=15, ratio=8.0)
    truth = tomllib.loads(answer)
    key = truth["effect"], truth["location"], truth["dof"]
    base = fit_baseline(check_data(session, SETTINGS), 1, SETTINGS)
    ranked = score_hypotheses(base.scene, base.null, list_excluded(base), SETTINGS)
    assert [score.gain for score in ranked if score.hypothesis.key == key] == [0.0]
    refits = refit_round(base, base.null, ranked, SETTINGS)
    best = min(refits, key=lambda refit: refit.objective)
    assert best.keys == (key,)
    assert best.gap < 0.2 * base.null.gap
