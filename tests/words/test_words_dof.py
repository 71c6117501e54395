"""Labels: every signed direction there and back, short forms, and what is refused."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.words import DIRECTIONS, Dof, UsageError

SIGNED = [sign + axis for sign, axis in itertools.product("+-", DIRECTIONS)]
# A point's name is anything without a colon that stripping leaves alone.
POINTS = st.text(
    st.characters(exclude_characters=":", exclude_categories=["C", "Z"]), min_size=1, max_size=12
)


@pytest.mark.parametrize("direction", SIGNED)
def test_a_label_reads_back_as_it_was_written(direction):
    dof = Dof("acc11", direction)
    assert str(dof) == f"acc11:{direction}"
    assert Dof.parse(str(dof)) == dof


@pytest.mark.parametrize(
    ("text", "expected"),
    [(f"acc7:{sign}{axis}", f"{sign or '+'}t{axis}") for sign in ("", "+", "-") for axis in "xyz"]
    + [(f"acc7:{axis}", f"+{axis}") for axis in DIRECTIONS],
)
def test_a_short_form_means_a_translation_and_a_plus(text, expected):
    assert Dof.parse(text) == Dof("acc7", expected)


def test_blanks_around_a_label_are_dropped():
    assert Dof.parse("  acc11:-ry\n") == Dof("acc11", "-ry")


@given(POINTS, st.sampled_from(SIGNED))
def test_any_name_without_a_colon_is_a_point(point, direction):
    dof = Dof(point, direction)
    assert Dof.parse(str(dof)) == dof


@pytest.mark.parametrize(
    ("direction", "axis", "sign", "turns"),
    [
        ("+tx", 0, 1, False),
        ("-tx", 0, -1, False),
        ("+ty", 1, 1, False),
        ("-ty", 1, -1, False),
        ("+tz", 2, 1, False),
        ("-tz", 2, -1, False),
        ("+rx", 3, 1, True),
        ("-rx", 3, -1, True),
        ("+ry", 4, 1, True),
        ("-ry", 4, -1, True),
        ("+rz", 5, 1, True),
        ("-rz", 5, -1, True),
    ],
)
def test_a_direction_has_its_axis_its_sign_and_its_kind(direction, axis, sign, turns):
    dof = Dof("p", direction)
    assert (dof.axis, dof.sign, dof.is_rotation) == (axis, sign, turns)


@pytest.mark.parametrize("direction", SIGNED)
def test_axis_and_sign_build_the_same_label(direction):
    dof = Dof("p", direction)
    assert Dof.of("p", dof.axis, dof.sign) == dof


@pytest.mark.parametrize("direction", SIGNED)
def test_the_positive_label_only_loses_its_sign(direction):
    assert Dof("p", direction).positive == Dof("p", "+" + direction[1:])


def test_the_twelve_labels_of_a_point_are_twelve_different_ones():
    assert len({Dof.parse(f"p:{direction}") for direction in SIGNED}) == 12


@pytest.mark.parametrize(
    "text",
    [
        *("", "acc11", "acc11:", ":+tx", "  :+tx", "acc11:+", "acc11:t", "acc11:+tt", "acc11:+TX"),
        *("acc11:+txy", "acc11:++tx", "acc11:+ tx", "acc11:x+", "acc11:r", "acc11:+w", "acc11:1"),
        *("acc11+tx", "acc11:+tx:"),
    ],
)
def test_what_is_no_label_is_refused_with_the_form_to_write(text):
    with pytest.raises(UsageError, match="<point>:<sign><direction>"):
        Dof.parse(text)


@pytest.mark.parametrize("direction", ["", "+", "tx", "x", "+x", "+tw", "*tx", "+tx ", "+rxy"])
def test_a_direction_without_sign_or_axis_is_refused(direction):
    with pytest.raises(ValueError, match="is not a direction"):
        Dof("acc11", direction)


def test_a_point_without_a_name_is_refused():
    with pytest.raises(ValueError, match="name of a point is empty"):
        Dof("", "+tx")


@pytest.mark.parametrize("point", ["a:b", ":", "x:+tx"])
def test_the_last_colon_of_a_label_is_that_of_the_direction(point):
    assert Dof.parse(f"{point}:-ry") == Dof(point, "-ry")
