"""Refits in processes: the same for any number of jobs."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, refit_null


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A campaign with a strong effect at a joint, and a fit with 10 %."""
    session, _ = drawn(
        tmp_path_factory.mktemp("coupled"), 72_021, "joint_coupling", ratio=6.0, lines=161
    )
    return early_scene(session)


def test_refits_in_processes_are_those_one_after_the_other_and_keep_their_hypotheses(scene):
    null = refit_null(scene)
    hypotheses = list(EFFECTS["joint_coupling"](scene))[:3]
    tasks = [add_cause(null, hypothesis) for hypothesis in hypotheses]
    alone, beside = (
        run_refits(replace(scene, jobs=jobs), tasks, SETTINGS.schedule) for jobs in (1, 2)
    )
    for first, second, hypothesis in zip(alone, beside, hypotheses, strict=True):
        assert first.causes == second.causes == (hypothesis,)
        assert first.summary == second.summary
        assert np.array_equal(first.fit.x, second.fit.x)
