"""Starts in dynamic stiffness, of effects along a force at a joint."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import ForceGain
from diagnosis.null_model import fit_null_model
from diagnosis.refits.refitting import add_hypotheses, find_start
from diagnosis.search.local_starts import begin_along
from diagnosis.search.score_test import Score
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tuning import predict

FORCE = ForceGain(location="joint:stage2", dof="tx", gain=1.0, share=0.9)
SPRING = "stage2_tx.stiffness"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("machine"), 72_012)
    return Scene(session, session.model.drawn)


@pytest.fixture(scope="module")
def far(scene):
    """A fit that lacks an effect, and has made the spring beside it twelve times as stiff."""
    null = fit_null_model(scene, SETTINGS)
    varies = null.session.parametrisation
    theta = np.array(scene.theta)
    theta[[parameter.name for parameter in varies.parameters].index(SPRING)] *= 12
    return replace(null, fit=replace(null.fit, x=varies.coordinates(theta)))


def measure(scene, far, hypothesis):
    """The fit to exact FRFs of a hypothesis with its start values."""
    session = add_hypotheses(scene.session, hypothesis)
    campaign, tests = scene.session.campaign, []
    frfs = predict(session.model, find_start(scene, session, hypothesis), campaign)
    for test, frf in zip(campaign.tests, frfs, strict=True):
        estimate = replace(test.estimate, frf=replace(test.estimate.frf, values=frf))
        tests.append(replace(test, estimate=estimate))
    exact = replace(campaign, tests=tuple(tests))
    return replace(far, session=replace(far.session, campaign=exact))


def select(scene, effect, dof=FORCE.dof):
    """A hypothesis at the joint of the force."""
    return next(
        hypothesis
        for hypothesis in EFFECTS[effect](scene)
        if (hypothesis.location, hypothesis.dof) == (FORCE.location, dof)
    )


def rate(*hypotheses):
    """Scores of hypotheses, all alike."""
    return [Score(hypothesis, 1.0, np.ones(1)) for hypothesis in hypotheses]


@pytest.mark.parametrize(
    ("effect", "sizes"),
    [
        ("inertance", {"inertance": 4.0}),
        ("viscoelastic", {"branch0.size": 0.7, "branch0.time": 0.4}),
        ("feedback_delay", {"delayed1.size": 1.3}),
    ],
)
def test_sizes_and_the_spring_beside_them_are_those_of_exact_data_from_afar(
    scene, far, effect, sizes
):
    hypothesis = select(scene, effect)
    true = {f"stage2_tx.{name}": size for name, size in sizes.items()}
    fitted = measure(scene, far, replace(hypothesis, begin={**hypothesis.begin, **true}))
    (begun,) = begin_along(scene, fitted, rate(hypothesis), FORCE, SETTINGS)
    drawn_stiffness = scene.find_stiffness(("stage2_tx",))[0]
    assert begun.begin[SPRING] == pytest.approx(drawn_stiffness, rel=1e-5)
    assert {name: begun.begin[name] for name in true} == pytest.approx(true, rel=1e-4)


def test_none_begins_without_a_force_in_its_direction_alone(scene, far):
    along, across = select(scene, "inertance"), select(scene, "inertance", "ty")
    everywhere = select(scene, "viscoelastic", None)
    assert begin_along(scene, far, rate(along), None, SETTINGS) == []
    assert begin_along(scene, far, rate(across, everywhere), FORCE, SETTINGS) == []
    at_body = FORCE.model_copy(update={"location": "body:stage2"})
    assert begin_along(scene, far, rate(along), at_body, SETTINGS) == []
    (begun,) = begin_along(scene, far, rate(across, along, everywhere), FORCE, SETTINGS)
    assert begun.key == along.key
