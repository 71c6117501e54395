"""A grading from files to tables: nothing is dropped, nothing stops it."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from truth.campaign.cause import Cause, Wanted
from truth.campaign.folder import write_campaign
from truth.campaign.protocol import Protocol
from truth.campaign.virtual_test import Plan, draw_campaign
from truth.errors import TruthError
from truth.grade import RATES, CaseFiles, grade, tables, to_json
from truth.grade.__main__ import app, cases_in
from truth.grade.rates import wilson
from truth.grade.text_tables import align, rate_text

ROW = {
    "effect": "appendage",
    "location": "body:table",
    "dof": "tz",
    "probability": 0.9,
    "parameters": {"mass": 12.0},
    "interval": {"mass": [9.0, 13.0]},
    "excess_after": 1.1,
}
GAP = {
    "as_drawn": {"error": 1, "excess": 30},
    "retuned": {"error": 0.5, "excess": 4.0},
    "after": {"error": 0.1, "excess": 2.0},
    "noise": 0.05,
    "closed": 0.8,
}
RIGHT = {
    "verdict": "explained",
    "probability": {"none": 0.1, "unexplained": 0, "several": 0},
    "gap": GAP,
    "where": [{"location": "body:table", "share": 0.7}],
    "causes": [ROW],
    "twins": [],
    "not_testable": [],
    "next_experiment": None,
}
APPENDAGE = """effect = "appendage"
location = "body:table"
dof = "tz"
ratio = 4.0
[parameters]
mass = 10.0
[drawn]
machine = "two"
kind = "one"
"""
TABLES = {"a": RIGHT, "b": RIGHT, "c": {**RIGHT, "causes": []}, "d": None}
ANSWERS = {
    "a": APPENDAGE,
    "b": 'effect = "none"\n[parameters]\n',
    "c": APPENDAGE,
    "d": APPENDAGE.replace("10.0", "20.0"),
    "e": "effect =",
}
REFITS = {"a": (5.0, 1.0), "b": (0.98, None), "c": (None, 1.0)}


@pytest.fixture(scope="module")
def campaign(two_bodies, tmp_path_factory):
    """A campaign as this package draws it, with an appendage."""
    plan = Plan(3, Cause((Wanted("appendage", "body:table"),)), Protocol(nodes=(1,), lines=401))
    folder = tmp_path_factory.mktemp("drawn") / "campaign"
    write_campaign(draw_campaign(two_bodies, plan), folder)
    return folder


@pytest.fixture
def folder(campaign, tmp_path):
    """Five cases: right, false alarm, malformed, no verdict, no answer; and a stray file."""
    for name, answer in ANSWERS.items():
        own = tmp_path / name
        own.mkdir()
        (own / "answer.toml").write_text(answer)
        if name != "e":
            (own / "campaign").symlink_to(campaign)
        if TABLES.get(name):
            (own / "verdict.json").write_text(json.dumps(TABLES[name]))
        for file, excess in zip(("refit", "oracle"), REFITS.get(name, ()), strict=False):
            if excess is not None:
                (own / f"{file}.json").write_text(json.dumps({"excess": excess}))
    (tmp_path / "a" / "oracle.json").write_text('{"excess": 1.0, "seconds": 3}')
    (tmp_path / "b" / "oracle.json").write_text('{"error": 1.0}')
    (tmp_path / "notes.txt").write_text("not a case")
    return tmp_path


@pytest.fixture
def report(folder):
    return grade(cases_in(folder))


def test_failures_are_named_and_counted_as_wrong(report):
    assert report.cases == 5
    assert set(report.failed) == {"c", "d"}
    assert "'explained' needs 1" in report.failed["c"]
    assert "verdict.json: cannot be read" in report.failed["d"]
    assert report.verdicts.all.rates["effect_first"] == report.verdicts.all.rates["both"]
    both = report.verdicts.all.rates["both"]
    assert (both.n, both.hits, (both.low, both.high)) == (4, 1, wilson(1, 4))
    assert report.verdicts.all.rates["false_alarm"].hits == 1


def test_a_case_without_an_answer_is_named_and_not_graded(report):
    assert set(report.ungraded) == {"e"}
    assert "answer.toml: is not TOML" in report.ungraded["e"]
    assert [line.name for line in report.lines] == ["a", "b", "c", "d"]


def test_a_refit_that_cannot_be_read_is_a_remark(report):
    assert report.remarks == {"b": ("oracle.json: excess is missing",)}


def test_the_shrink_is_graded_where_both_refits_are(report):
    spread = report.verdicts.all.means["shrink_share"]
    assert (spread.n, spread.mean) == (1, pytest.approx((5**2 - 2**2) / (5**2 - 1)))


def test_sizes_and_intervals_are_graded(report):
    sizes = report.verdicts.sizes
    assert (sizes.size.true, sizes.size.n, sizes.size.median) == (3, 1, pytest.approx(0.2))
    assert (sizes.intervals.n, sizes.intervals.hits) == (1, 1)


def test_cases_are_grouped_by_what_their_answer_says(report):
    assert {name: group.n for name, group in report.verdicts.by_machine.items()} == {
        "two": 3,
        "unnamed": 1,
    }
    assert report.verdicts.by_tag["one"].n == 3


def test_all_baselines_judge_the_same_cases(report):
    assert set(report.baselines) == {
        "random",
        "refit_only",
        *(
            f"{rank}_{blame}"
            for rank in ("frac", "residual", "comac")
            for blame in ("gain", "mass")
        ),
    }
    for name, baseline in report.baselines.items():
        graded = 2 if name == "refit_only" else 4
        assert (baseline.scores.all.n, len(baseline.skipped)) == (graded, 4 - graded)
    quiet = report.baselines["refit_only"]
    assert set(quiet.skipped) == {"c", "d"}
    assert quiet.scores.all.rates["false_alarm"].hits == 0
    chance = report.baselines["random"].scores.all.rates["both"]
    assert (chance.n, chance.low) == (4, None)
    # Three truths are an appendage on one of two bodies; 25 effects have a place.
    assert chance.rate == pytest.approx(3 / 4 / 25 / 2)


def test_a_campaign_that_cannot_be_read_skips_its_baselines_alone(folder):
    (folder / "a" / "campaign").unlink()
    report = grade(cases_in(folder))
    assert report.verdicts.all.n == 4
    assert report.baselines["random"].scores.all.n == 3
    assert "campaign.toml: cannot be read" in report.baselines["frac_mass"].skipped["a"]
    assert set(report.baselines["refit_only"].skipped) == {"c", "d"}


def test_the_whole_report_is_json_without_nan(report):
    def no_constant(name):
        raise AssertionError(name)

    found = json.loads(to_json(report), parse_constant=no_constant)
    assert found["verdicts"]["all"]["rates"]["both"]["n"] == 4
    assert found["verdicts"]["all"]["rates"]["top3"]["rate"] == pytest.approx(1 / 3)
    assert found["verdicts"]["all"]["rates"]["both_found"]["rate"] is None
    assert set(found["lines"][0]["marks"]) >= set(RATES)


def test_the_text_has_n_and_interval_beside_every_rate(report):
    text = tables(report)
    assert "failed c: " in text
    assert "not graded e: " in text
    low, high = wilson(1, 4)
    assert f"25.0 % [{100 * low:.1f}, {100 * high:.1f}] n=4" in text
    assert "refit_only skipped in 2 cases: there is no refit.json" in text
    for title in ("by survival ratio", "calibration of the causes", "confusion of effects"):
        assert title in text
    assert "nan" not in text.lower()


def test_columns_of_a_table_begin_below_each_other():
    assert align([["a", "bcd", "e"], ["fgh", "i"]]) == ["a    bcd  e", "fgh  i"]
    assert align([]) == []


def test_a_rate_is_written_with_its_interval_or_as_an_expectation(report):
    assert rate_text(report.verdicts.all.rates["both_found"]) == "- n=0"
    assert rate_text(report.baselines["random"].scores.all.rates["both"]).endswith(" % n=4")


def test_nothing_to_grade_is_an_empty_report(tmp_path):
    report = grade([CaseFiles("x", tmp_path, tmp_path / "v.json", tmp_path / "a.toml")])
    assert report.verdicts is None
    assert set(report.ungraded) == {"x"}
    assert "cases 1" in tables(report)
    json.loads(to_json(report))
    assert tables(grade([]))


def test_a_name_given_twice_is_refused(tmp_path):
    case = CaseFiles("x", tmp_path, tmp_path / "v.json", tmp_path / "a.toml")
    other = CaseFiles("y", tmp_path, tmp_path / "v.json", tmp_path / "a.toml")
    with pytest.raises(TruthError, match="cases: x given twice"):
        grade([other, case, case])


def test_a_singular_drawing_skips_the_baselines(folder, monkeypatch):
    def singular(path):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("truth.grade.report.compare", singular)
    report = grade(cases_in(folder))
    assert report.baselines["random"].scores is None
    assert "skipped in 4 cases: Singular matrix" in tables(report)


def test_the_command_writes_tables_and_json(folder, tmp_path):
    result = CliRunner().invoke(app, [str(folder), "--json", str(tmp_path / "out.json")])
    assert result.exit_code == 0
    assert result.stdout.startswith("cases 5, of these failed 2, not graded 1")
    assert json.loads((tmp_path / "out.json").read_text())["cases"] == 5


@pytest.mark.parametrize("made", [True, False])
def test_the_command_refuses_a_folder_without_cases(made, tmp_path):
    if made:
        (tmp_path / "empty").mkdir()
    result = CliRunner().invoke(app, [str(tmp_path / "empty")])
    assert result.exit_code == 3
    assert "truth.grade: " in result.stderr


def test_the_answer_of_a_drawn_campaign_is_read(campaign):
    case = CaseFiles(
        "x", campaign, campaign / "none.json", campaign / "answer.toml", machine="bench"
    )
    line = grade([case], baselines=False).lines[0]
    assert (line.truth, line.places, line.machine) == ("appendage", ("body:table",), "bench")
