"""The next experiment: the hit that tells two causes apart, or what confirms the one there is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.corrections import mask_channels
from diagnosis.decision.established import RemarkRow
from diagnosis.next_test.discriminating import (
    _compute_measured_normal,
    _compute_misfit,
    propose_experiment,
)
from diagnosis.next_test.experiments import (
    Experiment,
    add_experiment,
    add_known_mass,
    list_experiments,
)
from diagnosis.settings import SETTINGS
from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, hammer_parts, transport
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, refit_null, refit_with
from tuning import mean_channel_variance, predict_tests, thin_lines
from tuning.assessment.parameter_confidence import posterior_precision


@pytest.fixture(scope="module")
def rivals(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("drawn"), 72_051, "mass_error", lines=81)
    scene = early_scene(session)
    null = refit_null(scene)
    added = list(EFFECTS["mass_error"](scene))[:4:2]  # beside each, mass that is missing
    return session, [refit_with(scene, null, one) for one in added]


def found(session, refits, word, causes, where=(), present=(), spread="local", remarks=()):
    """As much of a diagnosis as the next experiment reads."""
    sets = tuple(((key,), share) for key, share in causes)
    named = tuple(
        SimpleNamespace(key=key, location=key[1])
        for key in present or tuple(key for key, _ in causes[:1])
    )
    by_keys = {refit.keys: refit for refit in refits}
    return SimpleNamespace(
        session=session,
        posterior=SimpleNamespace(causes=causes, where=where, sets=sets),
        present=SimpleNamespace(
            word=word,
            causes=named,
            remarks=[
                RemarkRow(effect=e, location=at, dof=dof, closed=closed)
                for (e, at, dof), closed in dict(remarks).items()
            ],
            rest=SimpleNamespace(spread=spread),
        ),
        search=SimpleNamespace(refit_of=by_keys.get),
        checks=SimpleNamespace(unknown=()),
        settings=SETTINGS,
        gross_hypotheses=(),
    )


def told_by(posed, campaign, inputs):
    """What a rival foresees."""
    return predict_tests(
        posed.model, posed.theta, campaign, mean_channel_variance(campaign), inputs
    )


def test_rivals_are_told_apart_by_the_hit_that_gains_most(rivals):
    session, (one, other) = rivals
    causes = [(one.causes[0].key, 0.6), (other.causes[0].key, 0.3)]
    said = propose_experiment(found(session, (one, other), "explained", causes))
    assert one.causes[0].site in said
    assert other.causes[0].site in said
    campaign = session.campaign
    hit = {test.condition.reference.point for test in campaign.tests}
    frf = campaign.tests[0].estimate.frf
    assert said.split()[1] in {dof.point for dof in frf.outputs} - hit
    # Two that are the same nothing tells apart: what confirms the first is asked for.
    same = replace(one, causes=(replace(one.causes[0], location="body:other"),))
    causes = [(one.causes[0].key, 0.6), (same.causes[0].key, 0.3)]
    said = propose_experiment(found(session, (one, same), "explained", causes))
    assert said.startswith("weigh")


def test_the_gain_is_what_tuning_anew_leaves_of_what_a_rival_foresees(rivals):
    session, (true, rival) = rivals
    campaign = session.campaign
    inputs = (Dof.of(campaign.outputs[-1].point, 1),)
    asked = Experiment("hit", inputs, lambda machine: hammer_parts(machine, inputs))
    posed = [add_experiment(asked, one) for one in (true, rival)]
    told = told_by(posed[0], campaign, inputs)
    before = _compute_measured_normal(rival, SETTINGS.score_stride)
    gain = _compute_misfit(posed[1], told, before, 1.0)
    # The same by least squares, slopes by differences.
    varies, estimate = posed[1].parametrisation, told.tests[0].estimate
    question = FrfRequest(told.freq_hz, estimate.frf.outputs, inputs, estimate.frf.quantity)
    evaluator = Evaluator(posed[1].model, question)
    at = [dof.point for dof in question.outputs]
    power = np.abs(estimate.frf.values[:, :, 0]) ** 2 @ np.equal.outer(at, at)
    noise = np.sqrt(estimate.variance + rival.floor**2 * power[:, :, None])

    def weighted(values):
        return np.concatenate([(values / noise).real.ravel(), (values / noise).imag.ravel()])

    def foreseen(x):
        return weighted(evaluator.at(varies.theta(x)).values)

    x = varies.coordinates(posed[1].theta)
    off = weighted(estimate.frf.values) - foreseen(x)
    steps = 1e-5 * np.eye(len(x))
    slopes = np.array([(foreseen(x + one) - foreseen(x - one)) / 2e-5 for one in steps]).T
    stiff = np.diag(posterior_precision(varies, x))
    stiff[: len(before), : len(before)] += before
    sizes, vectors = np.linalg.eigh(stiff / 2)
    rows = np.vstack([slopes, np.sqrt(np.maximum(sizes, 0.0))[:, None] * vectors.T])
    right = np.append(off, np.zeros(len(x)))
    step, *_ = np.linalg.lstsq(rows, right, rcond=None)
    assert gain == pytest.approx(((right - rows @ step) ** 2).sum(), rel=1e-3)
    assert gain < 0.9 * (off**2).sum()


def test_a_cause_that_is_taken_out_and_a_known_mass_are_foreseen(rivals):
    session, (one, _) = rivals
    thin = thin_lines(session.campaign, 8)
    inputs = (session.campaign.tests[0].condition.reference.positive,)
    out = told_by(
        add_experiment(Experiment("out", inputs, undone=one.causes[0].key), one), thin, inputs
    )
    bare, frf = session.model, out.tests[0].estimate.frf
    question = FrfRequest(thin.freq_hz, frf.outputs, inputs, frf.quantity)
    expected = Evaluator(bare, question).at(one.fit.theta[: len(bare.parameters)]).values
    np.testing.assert_allclose(frf.values, expected, rtol=1e-9)
    # A tenth of its mass at a body's centre is what a mass error of that size would be.
    body = one.causes[0].location.partition(":")[2]
    number = bare.machine.layout.bodies.index(body)
    heavier = told_by(
        add_experiment(
            Experiment("add", inputs, add_known_mass(number, SETTINGS.added_mass_share)), one
        ),
        thin,
        inputs,
    )
    more = one.fit.theta.copy()
    names = [parameter.name for parameter in one.session.model.parameters]
    to_centre, mass = transport(bare.machine.layout.centres[number]), np.zeros((6, 6))
    mass[:3, :3] = 0.1 * bare.machine.body_mass[6 * number, 6 * number] * np.eye(3)
    added = one.causes[0].movable.start({"inertia": to_centre.T @ mass @ to_centre})
    more += [added.get(name, 0.0) for name in names]
    expected = Evaluator(one.session.model, question).at(more).values
    np.testing.assert_allclose(heavier.tests[0].estimate.frf.values, expected, rtol=1e-9)


def test_a_hit_along_other_axes_of_the_same_point_counts(rivals):
    session, (one, other) = rivals
    first = session.campaign.tests[0]
    campaign = replace(session.campaign, tests=(first,))
    reference = first.condition.reference
    words = [asked.words for asked in next(list_experiments(campaign, (one, other), SETTINGS))]
    axes = [axis for axis in "xyz" if axis != reference.direction[2:]]
    assert f"hit {reference.point} along {' and '.join(axes)} as well" in words


def test_a_single_cause_is_confirmed_in_its_own_way(rivals):
    session, (one, other) = rivals
    causes = [(one.causes[0].key, 0.95), (other.causes[0].key, 0.02)]
    said = propose_experiment(found(session, (one, other), "explained", causes))
    assert said.startswith(f"weigh {one.causes[0].location.partition(':')[2]}")
    proven = [(("sensor_swap", "sensor:acc1", "tx+ty"), 0.98)]
    assert "knock" in propose_experiment(found(session, (), "explained", proven))
    # A fault that the data prove leaves no rivals to tell apart, however many were refitted.
    alone = found(session, (one, other), "explained", [*proven, *causes])
    alone.gross_hypotheses = alone.present.causes
    assert "knock" in propose_experiment(alone)


def test_what_nobody_explains_is_asked_at_other_levels_where_it_pushes(rivals):
    session, _ = rivals
    said = propose_experiment(found(session, (), "unexplained", [], [("joint:a", 0.8)]))
    assert "four times the level" in said
    assert "joint:a" in said
    assert propose_experiment(found(session, (), "none", [])) is None
    # What is proven beside it is mended first, and is not where to look.
    swap = ("sensor_swap", "sensor:acc1", "tx+ty")
    where = [("sensor:acc1", 0.5), ("joint:a", 0.4)]
    both = propose_experiment(found(session, (), "unexplained", [(swap, 0.5)], where, (swap,)))
    assert both.index("knock") < both.index("; then repeat") < both.index("look at joint:a")


def test_a_gap_that_is_everywhere_is_looked_at_nowhere(rivals):
    session, _ = rivals
    where = [("joint:stage2", 0.8)]
    said = propose_experiment(found(session, (), "unexplained", [], where, spread="everywhere"))
    assert said.endswith("and come back, a drift does not")
    levels = at_two_levels(session)
    said = propose_experiment(found(levels, (), "unexplained", [], where, spread="everywhere"))
    assert said.startswith("look at the joints, and hit other bodies")


def test_a_proven_fault_that_would_close_much_is_confirmed_first(rivals):
    session, _ = rivals
    bends = ("flexible_body", "body:stage1", None)
    where = [("body:stage1", 0.5), ("joint:stage2", 0.3)]
    remarks = {bends: 0.97, ("sensor_gain", "sensor:acc1", "tx"): 0.1}
    said = propose_experiment(found(session, (), "unexplained", [], where, remarks=remarks))
    assert said.startswith(
        "put more sensors on stage1 and look at its shape at that frequency; then repeat at"
    )
    assert said.endswith("look at joint:stage2, where an unknown force acts")
    assert "acc1" not in said


def at_two_levels(session, silent=()):
    """The session's campaign hit at another level too, without the channels of some bodies."""
    campaign = session.campaign
    harder = [
        replace(test, condition=replace(test.condition, level_n=900.0)) for test in campaign.tests
    ]
    both = replace(campaign, tests=(*campaign.tests, *harder))
    heard = mask_channels(both, lambda dof: campaign.layout.body_name(dof.point) in silent)
    return replace(session, campaign=heard)


def next_at(session, place):
    return propose_experiment(
        found(session, (), "unexplained", [], [(place, 0.8)] if place else [])
    )


def test_with_levels_and_sensors_on_both_sides_the_joint_is_held(rivals):
    said = next_at(at_two_levels(rivals[0]), "joint:stage2")
    assert said == (
        "clamp the joint of stage2 and repeat, stage1 and stage2 hit at each level: a force at "
        "joint:stage2 is gone then, and a gap that remains has its cause elsewhere"
    )
    assert "repeat, stage1 hit at" in next_at(at_two_levels(rivals[0]), "joint:stage1")  # ground
    assert next_at(at_two_levels(rivals[0]), "body:stage2").startswith("clear stage2 of all it")


def test_sensors_are_asked_for_on_that_side_alone_that_has_too_few(rivals):
    said = next_at(at_two_levels(rivals[0], {"stage1"}), "joint:stage2")
    assert said.startswith("put two triaxial sensors or more on stage1, and hit there: an unknown")
    assert "joint:stage2" in said


@pytest.mark.parametrize("place", ["", "hammer:acc1", "joint:elsewhere"])
def test_with_levels_a_place_beside_no_body_is_looked_at(rivals, place):
    said = next_at(at_two_levels(rivals[0]), place)
    assert said.startswith(f"look at {place or 'the joints'}, and hit other bodies")
