"""Terminal output of ``mbw diagnose``: reasons of rejection, unusual names, interruption."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from diagnosed import diagnosed
from rich.console import Console
from typer.testing import CliRunner

from diagnosis import Hypothesis
from diagnosis.decision.established import RemarkRow
from diagnosis.decision.remaining_gap import RestRow, Where
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.posterior import compute_log_odds
from diagnosis.settings import SETTINGS
from diagnosis.verdict.schema import CauseRow
from mbw.command import app
from mbw.diagnose import verb
from mbw.diagnose.headline import findings, lead
from mbw.diagnose.verb import hypothesis_table
from mbw.messages import SCREEN
from mbw.results.diagnosed_files import read_result
from tests.helpers.drawn import drawn
from tests.helpers.judged import evidence, fitted

NAME = "a [/b] :x: [red]"


@pytest.fixture(scope="module")
def partly(tmp_path_factory):
    return read_result(diagnosed("partly", tmp_path_factory.mktemp("partly")))


def found(evidence, *present):
    """Return a diagnosis whose verdict names some causes."""
    causes = [Hypothesis(effect, location) for effect, location in present]
    return SimpleNamespace(
        evidence=evidence,
        settings=SETTINGS,
        present=SimpleNamespace(causes=causes),
        gross_hypotheses=(),
        checks=SimpleNamespace(bodies=()),
    )


def rows(diagnosis):
    """Return hypothesis, closed part and last column by row."""
    first, _, _, closed, last = hypothesis_table(diagnosis).columns
    return list(zip(first.cells, closed.cells, last.cells, strict=True))


def test_the_table_says_why_each_set_is_rejected():
    best = fitted(("gyroscopic", "body:a"), cost=-0.5, gap=0.1)
    less = fitted(("appendage", "body:a"), cost=-0.2, gap=0.5)
    small = fitted(("drift", "joint:b"), cost=-0.01, gap=0.9)
    loose = fitted(("sensor_gain", "sensor:acc1"), cost=-0.02, gap=0.6, shifts=(3.1,))
    told = rows(found(evidence(1.0, [less, best, small, loose]), ("gyroscopic", "body:a")))
    odds = dict(zip(("best", "less"), compute_log_odds(
        evidence(1.0), [best, less], load_calibration()
    ), strict=True))  # fmt: skip
    assert told == [
        ("gyroscopic at body:a", "90", f"{odds['best']:.0f}"),
        ("appendage at body:a", "50", f"{odds['less']:.0f}, less probable"),
        ("sensor_gain at sensor:acc1", "40", "pull < 4.5"),
        ("drift at joint:b", "10", "closes < 20 %"),
        ("mass_error at body:a", "", "small score"),
        ("mass_error at joint:b", "", "small score"),
        ("mass_error at sensor:acc1", "", "small score"),
    ]


def test_a_set_of_two_causes_is_one_row_and_the_better_fit_of_a_set_counts():
    first, second = ("drift", "joint:b"), ("mass_error", "body:a")
    alone = fitted(first, cost=-1.0, gap=0.5)
    again = fitted(first, cost=-0.9, gap=0.6)
    both = fitted(first, second, cost=-3.0, gap=0.05)
    told = rows(found(evidence(1.0, [alone, again, both]), first, second))
    assert [name for name, *_ in told[:2]] == [
        "drift at joint:b + mass_error at body:a",
        "drift at joint:b",
    ]
    assert told[0][1] == "95"
    assert told[1][2].endswith("less probable")


def test_without_a_present_cause_the_best_hypothesis_is_rejected_too():
    best = fitted(("drift", "joint:b"), cost=-0.001, gap=0.2)
    ((_, _, why), *_) = rows(found(evidence(1.0, [best])))
    assert why.endswith("improbable")


def test_the_terminal_states_established_causes_rest_and_remarks(capsys, monkeypatch, partly):
    monkeypatch.setattr(SCREEN, "quiet", False)
    result = partly
    keys = [(row.effect, row.location, row.dof) for row in result.verdict.causes[:1]]
    late = CauseRow(
        effect="hammer_delay", location="hammer:acc11", dof=None, probability=0.98,
        parameters={"delay": -2e-4}, interval={}, excess_after=1.5,
    )  # fmt: skip
    causes = [*result.verdict.causes[:1], late]
    closes = {keys[0]: 0.9, ("hammer_delay", "hammer:acc11", None): 0.06}
    present = SimpleNamespace(established=keys, closes=closes, intervals={})
    remark = RemarkRow(effect="sensor_gain", location="sensor:acc11", dof="tx", closed=0.004)
    verdict = result.verdict.model_copy(update={"remarks": [remark], "causes": causes})
    shown = result.shown.model_copy(update={"campaign": "here", "remarks": ["said", "A pull."]})
    stated = replace(result, verdict=verdict, shown=shown)
    verb._say(stated, diagnosis_of(present, "said"))
    said = capsys.readouterr().err
    assert f"here: {lead(stated)}\n" in said
    assert "One effect is established, and a rest remains: a link that bypasses joints" in said
    assert "\n  A pull.\n" in said
    assert "\n  said\n" not in said
    assert len(findings(stated)) > 1
    assert all(f"\n  {text}\n" in said for text in findings(stated))
    assert "parallel_path at pair:stage1-stage3: stiffness" in said
    assert "; closes 90 % of the fitted lines' gap that the others leave\n" in said
    assert (
        "98% hammer_delay at hammer:acc11: delay -0.2 ms; closes 6 % of the fitted lines' gap "
        "that the others leave, less than 20 %, so it is not established\n" in said
    )
    assert "\n  with the effects: " in said
    assert f" What remains is {result.verdict.rest.excess:.3g} times the noise: the model" in said
    assert (
        "  A wrong gain at sensor acc11, along x is proven without the model, but it "
        "closes only 0.4 % of the gap.\n" in said
    )


def diagnosis_of(present, *remarks):
    """Return what the terminal reads of a diagnosis beside its stored result."""
    return SimpleNamespace(
        session=SimpleNamespace(campaign=SimpleNamespace(remarks=remarks)),
        present=present,
        checks=SimpleNamespace(unknown=()),
    )


def say_unexplained(result, capsys, monkeypatch, spread):
    """Return what the terminal says of a gap that no cause explains."""
    monkeypatch.setattr(SCREEN, "quiet", False)
    where = [Where(location="joint:stage1", share=0.74)]
    rest = RestRow(excess=6.0, model_error=0.018, significant=True, spread=spread, where=where)
    update = {"verdict": "unexplained", "causes": [], "rest": rest, "where": where}
    stated = replace(result, verdict=result.verdict.model_copy(update=update))
    verb._say(stated, diagnosis_of(SimpleNamespace(closes={}, intervals={})))
    return capsys.readouterr().err


def test_a_gap_that_is_everywhere_has_no_place(capsys, monkeypatch, partly):
    assert "  where: joint:stage1 74%" in say_unexplained(partly, capsys, monkeypatch, "local")
    said = say_unexplained(partly, capsys, monkeypatch, "everywhere")
    assert "The model's error is 1.8 % of the motion at each sensor, of which no" in said
    assert "\n  where: " not in said


def test_a_table_in_a_file_keeps_all_columns(capsys):
    places = [("sensor_misalignment", "sensor:acc8"), ("parallel_path", "pair:frame-xstage")]
    both = fitted(*places, cost=-0.3, gap=0.9)
    SCREEN.console.print(hypothesis_table(found(evidence(1.0, [both]))))
    said = capsys.readouterr().err
    row = next(line for line in said.splitlines() if "acc8" in line)
    assert "sensor_misalignment at sensor:acc8 + parallel_path at pair:frame-xstage " in row
    assert "one cause adds < 20 %" in row
    assert all(name in said for name in (" score ", " error % ", " closed % ", " log odds "))


def test_a_narrow_terminal_shows_the_numbers_of_every_row(capsys):
    places = [("sensor_misalignment", "sensor:acc8"), ("parallel_path", "pair:frame-xstage")]
    table = hypothesis_table(found(evidence(1.0, [fitted(*places, cost=-0.3, gap=0.9)])))
    Console(width=80, stderr=True, force_terminal=True, color_system=None).print(table)
    said = capsys.readouterr().err
    assert "…" not in said
    assert all(name in said for name in (" score ", " error % ", " closed % ", " log odds "))


def test_a_body_may_have_any_name(capsys, monkeypatch):
    key = ("appendage", f"body:{NAME}")
    verb._explain(found(evidence(1.0, [fitted(key, cost=-0.3, gap=0.1)]), key))
    with SCREEN.progress() as progress:
        verb._show_step(progress, progress.add_task("diagnosis"), f"refitted: body:{NAME}")
        SCREEN.console.print(progress.get_renderable())
    monkeypatch.setattr(SCREEN, "quiet", False)
    SCREEN.say(NAME)
    SCREEN.error(NAME)
    said = capsys.readouterr().err
    assert f"appendage at body:{NAME}" in said
    assert f"refitted: body:{NAME}" in said
    assert f"\n{NAME}\nmbw: {NAME}\n" in said


def test_an_interrupted_diagnosis_leaves_no_folder(tmp_path, monkeypatch):
    drawn(tmp_path, 72_001, lines=41)
    out = tmp_path / "made" / "result"

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(verb, "diagnose", interrupted)
    outcome = CliRunner().invoke(
        app, ["diagnose", str(tmp_path / "campaign"), "--out", str(out), "--quiet"]
    )
    assert outcome.exit_code == 130
    assert outcome.stderr == "mbw: interrupted\n"
    assert not out.parent.exists()
