"""Headline of the page of ``mbw diagnose`` for verdicts with several or doubtful causes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from browser import data_of
from diagnosed import diagnosed, lead_of

from diagnosis.decision.established import RemarkRow
from diagnosis.decision.remaining_gap import RestRow, Where
from diagnosis.verdict.schema import CauseRow
from diagnosis.verdict.sentences import UNEXPLAINED
from identification import Fault
from identification.words import capitalise
from mbw.diagnose.gap_sentences import find_best_candidate, remark_sentences, rest_sentence
from mbw.diagnose.page import render
from mbw.diagnose.sentences import sensor_check_sentences
from mbw.results.diagnosed_files import read_result
from mbw.results.diagnosed_schema import EstablishedRow
from tests.helpers.judged import evidence, fitted


@pytest.fixture(scope="module")
def explained(tmp_path_factory):
    return read_result(diagnosed("explained", tmp_path_factory.mktemp("explained")))


def fake(effect, location, dof, probability, **parameters):
    return CauseRow(
        effect=effect, location=location, dof=dof, probability=probability,
        parameters=parameters, interval={}, excess_after=None,
    )  # fmt: skip


def test_several_causes_confounded_causes_and_removed_sensors_are_stated_in_words(explained):
    rows = [
        fake("appendage", "body:stage2", None, 0.9, mass=31.24, frequency=109.04, damping=0.0113),
        fake("joint_coupling", "joint:stage3", None, 0.8, offset=(-0.1224, 0.0031, 0.0)),
        fake("drift", "joint:stage1", "hit29:+ty", 0.02, factor=0.726),
    ]
    verdict = explained.verdict.model_copy(
        update={
            "verdict": "several",
            "causes": rows,
            "twins": [("joint_coupling@joint:stage3", "appendage@body:stage2")],
            "not_testable": ["friction", "drift"],
        }
    )
    faults = [
        ("sensor_polarity", "sensor:acc11", "ty"),
        ("sensor_swap", "sensor:acc21+acc22", None),
    ]
    taken = [
        Fault(effect=e, location=at, dof=d, probability=0.99, parameters={}, excess_after=1.0)
        for e, at, d in faults
    ]
    shown = explained.shown.model_copy(
        update={
            "means": ["", "", ""],
            "established": [EstablishedRow(cause=k, closed=0.4) for k in (0, 1)],
            "taken_out": taken,
        }
    )
    page = render(replace(explained, verdict=verdict, shown=shown))
    assert lead_of(page).startswith(
        "Several effects are present: a small mass on a spring on body stage2 (mass "
        "31.2 kg, frequency 109 Hz, damping 1.13 %), 90 %; a centre of stiffness elsewhere than "
        "drawn at joint stage3 (offset (-122, 3.1, 0) mm from the joint as drawn, in world axes), "
        "80 %. With them the gap falls"
    )
    assert "hardly distinguish a small mass on a spring on body stage2 and a centre of" in page
    # What is established is named, however likely another partner is.
    corrected = [EstablishedRow(cause=k, closed=0.4) for k in (0, 2)]
    first = lead_of(
        render(
            replace(
                explained,
                verdict=verdict,
                shown=shown.model_copy(update={"established": corrected}),
            )
        )
    )
    assert "another stiffness in one test" in first
    assert "a centre of stiffness" not in first
    assert "Not tested, so not excluded: friction; they need hits of several" in page
    assert "another stiffness in one test; one direction of one set-up" in page
    first, second = sensor_check_sentences(shown)
    assert first.startswith("Sensor acc11 along y: a turned sign")
    assert "the search left the channel out" in first
    assert second.startswith("Sensors acc21 and acc22 are exchanged, as the channels prove")
    out = [c["output"] for c in data_of(page)["channels"] if c["out"] and c["test"] == 0]
    assert out == ["acc11:+ty", *(f"acc{n}:+t{axis}" for n in (21, 22) for axis in "xyz")]


def test_a_rest_that_is_spread_everywhere_is_said_to_be(explained):
    rest = RestRow(excess=1.63, model_error=0.0214, significant=True, spread="everywhere", where=[])
    verdict = explained.verdict.model_copy(update={"verdict": "partly", "rest": rest})
    assert lead_of(render(replace(explained, verdict=verdict))).endswith(
        "What remains is 1.63 times the noise: the model's error is 2.1 % of the motion at each "
        "sensor; small errors everywhere, of which no single place explains most."
    )
    verdict = verdict.model_copy(update={"verdict": "unexplained", "causes": []})
    shown = explained.shown.model_copy(update={"means": [], "established": []})
    nothing = evidence(1.0, [fitted(("drift", "joint:b"), cost=-0.3, gap=0.9)])
    page = render(replace(explained, verdict=verdict, shown=shown, evidence=nothing))
    assert lead_of(page).endswith(
        "The model's error is 2.1 % of the motion at each sensor, of which no single place "
        "explains most: no single effect that was refitted closes a fifth of the gap."
    )


@pytest.mark.parametrize(
    ("probability", "why"),
    [(None, "its probability is below 1 %"), (0.39, "its probability is only 39 %")],
)
def test_an_unexplained_gap_names_the_best_single_candidate(explained, probability, why):
    where = [Where(location="body:a", share=0.7)]
    rest = RestRow(excess=7.0, model_error=0.045, significant=True, spread="local", where=where)
    rows = [] if probability is None else [fake("appendage", "body:a", None, probability)]
    verdict = explained.verdict.model_copy(
        update={"verdict": "unexplained", "rest": rest, "where": where, "causes": rows}
    )
    sets = [
        fitted(("appendage", "body:a"), cost=-0.3, gap=0.66),
        fitted(("mass_error", "body:a"), cost=-0.2, gap=0.71),
        fitted(("sensor_gain", "sensor:acc1"), cost=-0.2, gap=0.5, shifts=(3.1,)),
        fitted(("appendage", "body:a"), ("drift", "joint:b"), cost=-0.4, gap=0.3),
    ]
    assert rest_sentence(verdict, evidence(1.0, sets)) == (
        "the model's error is 4.5 % of the motion at each sensor and mainly arises on body a "
        "(70 %): no cause is established; the most probable single candidate, a small mass on "
        f"a spring on body a, closes 34 % of the gap, but {why}"
    )
    failed = evidence(1.0, sets[:1], rejected=(sets[0].keys,))
    said = rest_sentence(verdict, failed)
    assert "the best single candidate, a small mass on a spring" in said
    assert said.endswith("closes 34 % of the gap, but it fails on held-out lines")


@pytest.mark.parametrize(
    ("unexplained", "shares", "said"),
    [
        (
            0.06,
            (0.48, 0.46, 0.02),
            "An effect is missing (94 %), but these data do not tell which: a small mass on a "
            "spring on body a (48 %) or a small mass on a spring on body b (46 %): the gap",
        ),
        (
            0.7,
            (0.2, 0.1),
            f"{capitalise(UNEXPLAINED)} (70 %): the gap",
        ),
        (
            0.03,
            (0.97, 0.4),
            f"{capitalise(UNEXPLAINED)} (3 %): the gap",
        ),
    ],
)
def test_rivals_that_share_the_probability_are_named(explained, unexplained, shares, said):
    rows = [
        fake("appendage", f"body:{body}", None, share)
        for body, share in zip("abc", shares, strict=False)
    ]
    probability = explained.verdict.probability.model_copy(
        update={"none": 0.0, "unexplained": unexplained, "several": 0.0}
    )
    verdict = explained.verdict.model_copy(
        update={"verdict": "unexplained", "causes": rows, "probability": probability}
    )
    shown = explained.shown.model_copy(update={"means": [""] * len(rows), "established": []})
    assert said in lead_of(render(replace(explained, verdict=verdict, shown=shown)))


def test_a_dead_channel_is_said_to_be_left_out(explained):
    dead = RemarkRow(effect="dead_channel", location="sensor:acc5", dof="tx", closed=None)
    verdict = explained.verdict.model_copy(update={"remarks": [dead]})
    assert remark_sentences(verdict) == [
        "No signal at sensor acc5, along x: the search left this channel out"
    ]


def test_the_named_candidate_is_the_most_probable_not_the_one_that_closes_most():
    link = fitted(("parallel_path", "pair:a-b"), cost=-0.36, gap=0.2)
    link = link.model_copy(update={"parameters": (15,)})
    delay = fitted(("sensor_delay", "sensor:acc1"), cost=-0.35, gap=0.7)
    assert find_best_candidate(evidence(1.0, [link, delay])).fit.keys == delay.keys


def test_the_lead_lists_all_causes_of_several_also_those_that_close_little(explained):
    both = [fake("appendage", "body:a", None, 0.99), fake("drift", "joint:b", None, 0.97)]
    both = [row.model_copy(update={"excess_after": 1.05}) for row in both]
    verdict = explained.verdict.model_copy(update={"verdict": "several", "causes": both})
    shown = explained.shown.model_copy(
        update={"means": ["", ""], "established": [EstablishedRow(cause=0, closed=0.9)]}
    )
    said = lead_of(render(replace(explained, verdict=verdict, shown=shown)))
    assert said.startswith("Several effects are present: a small mass on a spring on body a")
    assert "another stiffness in one test at joint b, 97 %. With them the gap falls" in said


def test_refitted_sets_are_listed_with_their_residuals(explained):
    null = explained.evidence.null
    keys = ("appendage", "body:stage2", None), ("missing_dof", "joint:stage1", "rx")
    cost = min(fitted.cost for fitted in explained.evidence.sets) - 1.0
    both = null.model_copy(update={"keys": keys, "cost": cost, "chi_square": 1.0, "serial": 0.0})
    evidence = explained.evidence.model_copy(update={"sets": (both,)})
    page = render(replace(explained, evidence=evidence))
    assert "appendage, body stage2 and missing dof, joint stage1 about x</td>" in page
    assert f"<td>{100 * null.floor:.3g} %</td><td>1</td><td>100 %</td>" in page


def test_the_headline_names_a_second_probable_cause(explained):
    rows = [
        fake("appendage", "body:stage2", None, 0.54, mass=32.7),
        fake("appendage", "body:stage1", None, 0.44, mass=72.3),
    ]
    verdict = explained.verdict.model_copy(update={"causes": rows})
    shown = explained.shown.model_copy(update={"means": ["", ""]})
    assert lead_of(render(replace(explained, verdict=verdict, shown=shown))).startswith(
        "One effect is missing: most probably (54 %) a small mass on a spring on body stage2 (mass "
        "32.7 kg), otherwise a small mass on a spring on body stage1 (44 %). With it the gap falls "
        "from"
    )


def test_a_cause_with_a_large_remaining_gap_gets_a_warning(explained):
    def page(excess):
        gap = explained.verdict.gap
        gap = gap.model_copy(update={"after": gap.after.model_copy(update={"excess": excess})})
        return render(replace(explained, verdict=explained.verdict.model_copy(update={"gap": gap})))

    assert "With the cause the gap is still 15.9 times the noise" in page(15.9)
    assert "the gap is still" not in page(1.2)


def test_a_verdict_without_a_known_gap_still_has_its_page(explained):
    """Where the noise is not known no excess exists; a bending body has no Part."""
    gap = json.loads(explained.verdict.gap.model_dump_json())
    for at in ("as_drawn", "retuned", "after"):
        gap[at] = {"error": None, "excess": None}
    gap |= {"closed": None, "noise": None, "interval": {"closed": None, "after": None}}
    verdict = type(explained.verdict).model_validate(
        json.loads(explained.verdict.model_dump_json()) | {"gap": gap}
    )
    arrays = explained.arrays | {
        name: np.full_like(explained.arrays[name], np.nan)
        for name in ("retuned_excess", "after_excess")
    }
    page = render(replace(explained, verdict=verdict, arrays=arrays))
    assert data_of(page)["gap"] == []
    assert "its change with the cause is unknown" in page
