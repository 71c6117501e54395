"""Terminal output of ``mbw diagnose``: reasons of rejection, unusual names, interruption."""

from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from diagnosis import Hypothesis
from diagnosis.search.score_test import Score
from mbw.command import app
from mbw.diagnose import verb
from mbw.messages import SCREEN
from tests.helpers.drawn import drawn

NAME = "a [/b] :x: [red]"


def one(effect, location, *release):
    return Hypothesis(effect, location, release=release)


def refitted(hypothesis, cost):
    return SimpleNamespace(hypothesis=hypothesis, cost=cost, chi_square=cost / 100)


def found(word, refits, *, scored=(), begun=(), pairs=(), present=()):
    search = SimpleNamespace(
        scores=[Score(each, 9.0 - k, np.zeros(1)) for k, each in enumerate(scored)],
        begun=[refitted(each, 500.0) for each in begun],
        refits=refits,
        pairs=pairs,
    )
    return SimpleNamespace(
        search=search,
        judged=SimpleNamespace(word=word),
        present=present,
        nothing=SimpleNamespace(chi_square=100.0),
        gate=SimpleNamespace(checks=(), flexible=()),
    )


def rows(diagnosis):
    """Words and why it fell, by row."""
    first, *_, last = verb._hypothesis_table(diagnosis).columns
    return list(zip(first.cells, last.cells, strict=True))


def test_the_best_hypothesis_is_not_rejected_though_another_shape_of_it_scored_best():
    place = "body:stage2"
    best, other = one("appendage", place, "shape1"), one("appendage", place, "shape0")
    worse, small = one("gyroscopic", place, "spin"), one("drift", "joint:stage1", "k")
    far = one("mass_error", "body:stage1", "m")
    refits = [refitted(worse, 130.0), refitted(best, 120.0)]
    scored = [worse, other, far, small, best]
    told = rows(found("explained", refits, scored=scored, begun=[other, far], present=(best,)))
    assert told == [
        (best.words, ""),
        (worse.words, "10 nats worse"),
        (far.words, "a first refit gained much less than the best"),
        (small.words, "not refitted: its score is small"),
    ]


def test_of_two_present_causes_none_is_rejected_but_the_best_single_one_is():
    first, second = one("drift", "joint:a", "k"), one("mass_error", "body:b", "m")
    alone = one("appendage", "body:c", "s")
    refits = [refitted(alone, 120.0), refitted(first, 130.0), refitted(second, 140.0)]
    pair = refitted(None, 100.0)
    told = rows(found("several", refits, pairs=(pair,), present=(first, second)))
    assert told == [(alone.words, "20 nats worse"), (first.words, ""), (second.words, "")]


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("none", "its gain is within tolerances and noise"),
        ("unexplained", "it does not explain the gap"),
    ],
)
def test_without_a_present_cause_the_best_hypothesis_is_rejected_too(word, why):
    best = one("drift", "joint:a", "k")
    assert rows(found(word, [refitted(best, 120.0)])) == [(best.words, why)]


def test_a_body_may_have_any_name(capsys, monkeypatch):
    best = one("appendage", f"body:{NAME}", "shape1")
    scored = [best]
    verb._explain(found("explained", [refitted(best, 120.0)], scored=scored, present=(best,)))
    with SCREEN.progress() as progress:
        verb._ProgressReporter(progress).show_step(f"refitted: {best.words}")
        SCREEN.console.print(progress.get_renderable())
    monkeypatch.setattr(SCREEN, "quiet", False)
    SCREEN.say(NAME)
    SCREEN.error(NAME)
    said = capsys.readouterr().err
    assert f"appendage@body:{NAME}" in said
    assert f"refitted: appendage@body:{NAME}" in said
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
