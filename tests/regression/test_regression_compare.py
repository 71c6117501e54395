import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from tests.regression.__main__ import HERE, read_groups
from tests.regression.compare import (
    changed_numbers,
    compare_arrays,
    compare_folders,
    compare_lines,
    compare_values,
    is_allowed,
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
def test_a_number_a_type_a_name_or_a_key_that_changes_is_a_difference(changes):
    differences = list(compare_values(VALUE, changed(**changes)))
    assert differences
    assert not any(difference.is_sentence for difference in differences)


def test_the_sign_of_zero_is_a_difference():
    assert list(compare_values({"a": 0.0}, {"a": -0.0}))


def test_a_sentence_may_change_and_its_numbers_may_not():
    before = {"said": "take off 17 kg of hose 3 at 1.5e-3 m"}
    (other,) = compare_values(before, {"said": "remove 18 kg of hose 3, 1.5e-3 m long"})
    assert not other.is_sentence
    assert changed_numbers(other.before, other.after) == (["17"], ["18"])
    (same,) = compare_values(before, {"said": "remove 17 kg of hose 3, 1.5e-3 m long"})
    assert same.is_sentence
    assert "remove" in str(replace(same, file="verdict.json"))


def test_a_list_that_grows_is_a_difference():
    assert list(compare_values([1.0], [1.0, 2.0]))


def test_arrays_agree_to_the_last_bit_in_type_and_shape():
    before = {"frf": np.array([1.0, np.nan]), "labels": np.array(["acc1:+tx"])}
    assert list(compare_arrays(before, {name: each.copy() for name, each in before.items()})) == []
    for name, array in (
        ("frf", np.array([1.0 + 2e-16, np.nan])),
        ("frf", np.array([1.0, np.nan], np.float32)),
        ("frf", np.array([[1.0, np.nan]])),
        ("labels", np.array(["acc1:+ty"])),
        ("more", np.zeros(1)),
    ):
        assert list(compare_arrays(before, {**before, name: array}))


def test_folders_differ_by_files_lines_and_arrays_but_not_by_pages(tmp_path):
    before, after = tmp_path / "before", tmp_path / "after"
    for folder in (before, after):
        (folder / "tune").mkdir(parents=True)
        (folder / "tune" / "tuned.json").write_text(json.dumps(VALUE))
        (folder / "tune" / "tuned.xml").write_text("<mujoco>\n</mujoco>\n")
        np.savez(folder / "posterior.npz", mean=np.ones(2))
    (after / "report.html").write_text("a page")
    assert list(compare_folders(before, after)) == []
    (after / "tune" / "tuned.xml").write_text("<mujoco>\n</mujoco >\n")
    np.savez(after / "posterior.npz", mean=np.array([1.0, 1.5]))
    (after / "tune" / "tuned.json").write_text(json.dumps(changed(mass=2.0)))
    (before / "bands.csv").write_text("1\n")
    differences = {each.file: each for each in compare_folders(before, after)}
    assert differences["tune/tuned.xml"].place == "line 2"
    assert "5.0e-01 of the largest" in differences["posterior.npz"].after
    assert differences["tune/tuned.json"].place == "causes.0.mass"
    assert differences["bands.csv"].after == "no"


def test_what_is_meant_to_differ_has_a_reason():
    allowed = [{"file": "*/verdict.json", "key": "format", "reason": "files state their format"}]
    assert is_allowed("demo/diagnose/verdict.json", "format", allowed) == allowed[0]["reason"]
    assert is_allowed("demo/diagnose/verdict.json", "causes.0.mass", allowed) is None
    stated = tomllib.loads((HERE / "allowed.toml").read_text("utf-8"))["allowed"]
    assert all(row.keys() == {"file", "key", "reason"} for row in stated)


def test_every_verb_with_results_is_called():
    words = {line.split()[1] for calls in read_groups().values() for line in calls.values()}
    assert {
        "identify",
        "tune",
        "diagnose",
        "predict",
        "simulate",
        "match",
        "place",
        "blind",
    } <= words


def test_a_new_line_and_a_new_key_are_named_alone():
    (line,) = compare_lines(["a", "b"], ["format = 1", "a", "b"])
    assert line.place == "(new line)"
    (other,) = compare_lines(["a", "b"], ["a", "c"])
    assert other.place == "line 2"
    (keys,) = compare_values({"a": 1}, {"format": 1, "a": 1})
    assert keys.place == "(keys +format)"
    (order,) = compare_values({"a": 1, "b": 2}, {"b": 2, "a": 1})
    assert order.place == "(keys order)"
