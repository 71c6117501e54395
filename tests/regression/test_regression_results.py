import json

import pytest

from tests.regression.results import (
    changed_numbers,
    compare_files,
    compare_values,
    show_difference,
)

VALUE = {"causes": [{"effect": "drift", "mass": 1.5, "said": "a joint drifts"}], "closed": None}


def changed(**changes):
    row = {**VALUE["causes"][0], **changes}
    return {**VALUE, "causes": [row]}


def test_equal_values_show_no_difference():
    assert list(compare_values(VALUE, changed())) == []
    assert list(compare_values(float("nan"), float("nan"))) == []


@pytest.mark.parametrize(
    "changes",
    [{"mass": 1.5 + 1e-15}, {"mass": 1}, {"effect": "none"}, {"more": 0}, {"said": None}],
)
def test_a_number_a_type_a_name_or_a_key_that_changes_is_found(changes):
    differences = list(compare_values(VALUE, changed(**changes)))
    assert differences
    assert not any(difference.is_sentence for difference in differences)


def test_the_sign_of_zero_is_a_difference():
    assert list(compare_values({"a": 0.0}, {"a": -0.0}))


def test_numbers_of_a_changed_sentence_are_told():
    before = {"said": "take off 17 kg of hose 3 at 1.5e-3 m"}
    (difference,) = compare_values(before, {"said": "remove 18 kg of hose 3, 1.5e-3 m long"})
    assert changed_numbers(difference) == (["17"], ["18"])
    (difference,) = compare_values(before, {"said": "remove 17 kg of hose 3, 1.5e-3 m long"})
    assert changed_numbers(difference) == ([], [])


def test_a_list_that_grows_is_found():
    assert list(compare_values([1.0], [1.0, 2.0]))


def test_a_sentence_may_change_and_is_shown(tmp_path):
    before, after = tmp_path / "before.json", tmp_path / "after.json"
    before.write_text(json.dumps(VALUE))
    after.write_text(json.dumps(changed(said="the joint drifts")))
    (difference,) = compare_files(before, after)
    assert difference.is_sentence
    assert difference.place == "causes.0.said"
    assert "the joint drifts" in show_difference(difference)
