"""Headline of the page of ``mbw diagnose`` for verdicts with several or doubtful causes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from browser import data_of
from diagnosed import diagnosed, lead_of

from diagnosis.inference.evidence import Paired
from diagnosis.verdict.schema import CauseRow
from mbw.diagnose.files import read_result
from mbw.diagnose.page import render
from mbw.diagnose.sentences import sensor_check_sentences
from mbw.identify.schema import FaultRow


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
        FaultRow(effect=e, location=at, dof=d, probability=0.99, parameters={}, excess_after=1.0)
        for e, at, d in faults
    ]
    shown = explained.shown.model_copy(
        update={"means": ["", "", ""], "taken_out": taken, "doubted": ["stage1"]}
    )
    page = render(replace(explained, verdict=verdict, shown=shown))
    assert lead_of(page).startswith(
        "Several effects are present: a small mass on a spring on body stage2 (mass "
        "31.2 kg, frequency 109 Hz, damping 1.13 %), 90 %; a centre of stiffness elsewhere than "
        "drawn at joint stage3 (offset (-122, 3.1, 0) mm from the joint as drawn, in world axes), "
        "80 %. With them the gap falls"
    )
    assert "hardly distinguish a small mass on a spring on body stage2 and a centre of" in page
    # What the model was corrected by is there, however likely another partner is.
    corrected = [row.model_copy(update={"excess_after": 1.0}) for row in (rows[0], rows[2])]
    several = verdict.model_copy(update={"causes": [corrected[0], rows[1], corrected[1]]})
    first = lead_of(render(replace(explained, verdict=several, shown=shown)))
    assert "another stiffness in one test" in first
    assert "a centre of stiffness" not in first
    assert "Not tested, so not excluded: friction; hits of several" in page
    assert "another stiffness in one test; one direction of one set-up" in page
    first, second, third = sensor_check_sentences(shown)
    assert first.startswith("Sensor acc11 along y: a turned sign")
    assert "the search left the channel out" in first
    assert second.startswith("Sensors acc21 and acc22 are exchanged, as the redundant channels")
    assert third.startswith("Body stage1 bends")
    out = [c["output"] for c in data_of(page)["channels"] if c["out"] and c["test"] == 0]
    assert out == ["acc11:+ty", *(f"acc{n}:+t{axis}" for n in (21, 22) for axis in "xyz")]


def test_refitted_pairs_are_listed_with_their_residuals(explained):
    keys = ("appendage", "body:stage2", None), ("missing_dof", "joint:stage1", "rx")
    best = min(one.cost for one in explained.evidence.refits)
    both = Paired(keys=keys, cost=best - 50.0, chi_square=1.0)
    evidence = explained.evidence.model_copy(update={"pairs": (both,)})
    page = render(replace(explained, evidence=evidence))
    assert (
        "appendage, body stage2 and missing dof, joint stage1 about x</td><td>1</td><td>0" in page
    )
    assert "<td>50</td>" in page


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
    gap = explained.verdict.gap
    gap = gap.model_copy(
        update={"closed": 0.46, "after": gap.after.model_copy(update={"excess": 15.9})}
    )
    page = render(replace(explained, verdict=explained.verdict.model_copy(update={"gap": gap})))
    assert "With the cause the gap is still 15.9 times the noise" in page
    assert "the gap is still" not in render(explained)


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
