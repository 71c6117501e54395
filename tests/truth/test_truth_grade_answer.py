"""Sealed answers are read as this package writes them, and as it wrote them before."""

import pytest

from truth.errors import TruthError
from truth.grade.answer import Truth, kinds_of, read_answer

ONE = """# salt 00ff
effect = "appendage"
location = "body:granite_top"
dof = "tz"
ratio = 4.02  # what survives
[parameters]
mass = 31.2
position = [0.1, 0.2, 0.3]
"""
DRAWN = """
[drawn]
machine = "tree5"
kind = "twin"
mistuned = false
nodes = [11, 4]
levels = [40.0, 200.0, 1000.0]
setups = 3
coherence = false
dead = [4, 2]
"""
TWO = """effect = "several"
[[cause]]
effect = "sensor_swap"
location = "sensor:acc7+acc12"
ratio = 8.0
[cause.parameters]
[[cause]]
effect = "unexplained"
location = "joint:ty"
kind = "inerter"
[cause.parameters]
inertance = 3.0
"""


def read(text, tmp_path):
    (tmp_path / "answer.toml").write_text(text)
    return read_answer(tmp_path / "answer.toml")


def test_one_effect_stands_by_itself(tmp_path):
    truth = read(ONE, tmp_path)
    (cause,) = truth.causes
    assert (cause.effect, cause.location, cause.dof) == ("appendage", "body:granite_top", "tz")
    assert cause.ratio == 4.02
    assert cause.parameters == {"mass": (31.2,), "position": (0.1, 0.2, 0.3)}
    assert (truth.effect, truth.label, truth.only) == ("appendage", "appendage", cause)
    assert kinds_of(truth) == ("body",)
    assert truth.tags == ()


def test_a_ratio_may_be_small(tmp_path):
    assert read(ONE.replace("4.02", "0.25"), tmp_path).causes[0].ratio == 0.25


def test_how_a_case_was_drawn_becomes_tags(tmp_path):
    truth = read(ONE + DRAWN, tmp_path)
    assert truth.machine == "tree5"
    assert truth.tags == (
        "twin",
        "two hammer points",
        "several levels",
        "several set-ups",
        "no coherence",
        "dead channel",
    )


def test_a_plain_test_has_no_tags(tmp_path):
    plain = 'effect = "none"\n[drawn]\nnodes = [11]\nlevels = [200.0]\nsetups = 1\ncoherence = true'
    assert read(plain, tmp_path) == Truth()


def test_several_effects_have_each_their_table(tmp_path):
    truth = read(TWO, tmp_path)
    assert (truth.effect, truth.only) == ("several", None)
    assert truth.places == ("sensor:acc12+acc7", "joint:ty")
    assert [one.effect for one in truth.causes] == ["sensor_swap", "unexplained"]
    assert kinds_of(truth) == ("sensor", "joint")


def test_what_is_outside_the_catalogue_is_labelled_by_its_kind(tmp_path):
    text = 'effect = "unexplained"\nlocation = "joint:ty"\nkind = "inerter"\n'
    truth = read(text, tmp_path)
    assert (truth.effect, truth.label, truth.only) == (
        "unexplained",
        "unexplained:inerter",
        None,
    )


def test_nothing_and_mistuned_are_told_apart(tmp_path):
    nothing = read('effect = "none"\n\n[parameters]\n', tmp_path)
    mistuned = read('effect = "none"\n[parameters]\n[drawn]\nmistuned = true\n', tmp_path)
    assert (nothing.label, mistuned.label) == ("none", "mistuned")
    assert nothing.effect == mistuned.effect == "none"
    assert kinds_of(nothing) == ("none",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "effect is missing"),
        ("effect =", "is not TOML"),
        ("effect = 3", "expected a string"),
        ('effect = "gremlin"', "not in the catalogue"),
        ('effect = "appendage"', "location ''"),
        ('effect = "appendage"\nlocation = "joint:ty"', "sits at body"),
        ('effect = "several"', "cause: expected a list"),
        ('effect = "several"\n[[cause]]\neffect = "none"', "'none' is not in"),
        (TWO[: TWO.rindex("[[cause]]")], "fewer than two"),
        (ONE.replace("4.02", "nan"), "ratio"),
        (ONE.replace("31.2", '"heavy"'), "mass: expected a number"),
    ],
)
def test_what_is_no_answer_is_refused(text, words, tmp_path):
    with pytest.raises(TruthError, match=words):
        read(text, tmp_path)
