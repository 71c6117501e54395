"""A verdict file is read strictly: what breaks the contract is refused by name."""

import copy
import json

import pytest

from truth.errors import TruthError
from truth.grade.answer import TrueCause, Truth
from truth.grade.json_reading import LARGEST
from truth.grade.read_verdict import read_verdict
from truth.grade.sizes import estimates_of

GOOD = {
    "verdict": "explained",
    "probability": {"none": 0.01, "unexplained": 0.02, "several": 0.02},
    "gap": {
        "as_drawn": {"error": 1.42, "excess": 38.0},
        "retuned": {"error": 0.31, "excess": 5.1},
        "after": {"error": 0.07, "excess": 1.04},
        "noise": 0.067,
        "closed": 0.997,
        "interval": {"closed": [0.98, 1.0], "after": [1.0, 1.1]},
    },
    "where": [{"location": "body:ty", "share": 0.83}, {"location": "joint:ty", "share": 0.1}],
    "causes": [
        {
            "effect": "appendage",
            "location": "body:ty",
            "dof": "tz",
            "probability": 0.9,
            "parameters": {"mass": 31.2, "position": [0.1, 0.0, 0.2], "damping": None},
            "interval": {"mass": [29.8, 32.9], "position": [[0, 1], [0, 1], [0, 1]]},
            "excess_after": 1.04,
        },
        {
            "effect": "joint_coupling",
            "location": "joint:ty",
            "dof": None,
            "probability": 0.06,
            "parameters": {},
        },
    ],
    "twins": [["joint_coupling@joint:ty", "appendage@body:ty"]],
    "not_testable": ["friction"],
    "next_experiment": "repeat at 40 N",
}
DELETE = object()


def changed(path, value):
    """GOOD with the value at a path of keys and indices, or without it."""
    found = copy.deepcopy(GOOD)
    inside = found
    for key in path[:-1]:
        inside = inside[key]
    if value is DELETE:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return found


def read(value, tmp_path):
    path = tmp_path / "verdict.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return read_verdict(path)


def test_the_contracts_example_is_read_whole(tmp_path):
    verdict = read(GOOD, tmp_path)
    assert (verdict.verdict, verdict.none, verdict.unexplained) == ("explained", 0.01, 0.02)
    assert (verdict.several, verdict.retuned, verdict.after) == (0.02, 5.1, 1.04)
    first, second = verdict.causes
    assert (first.effect, first.location, first.dof) == ("appendage", "body:ty", "tz")
    assert first.parameters == {"mass": (31.2,), "position": (0.1, 0.0, 0.2)}
    assert first.interval == {"mass": ((29.8, 32.9),), "position": ((0, 1),) * 3}
    assert (second.dof, second.interval) == ("", {})
    assert verdict.where == (("body:ty", 0.83), ("joint:ty", 0.1))
    assert verdict.twins == (frozenset({("joint_coupling", "joint:ty"), ("appendage", "body:ty")}),)


def test_places_of_a_cause_are_read_and_its_location_is_one_of_them(tmp_path):
    places = ["body:tilt", "body:ty"]
    first = read(changed(("causes", 0, "places"), places), tmp_path).causes[0]
    assert first.places == ("body:tilt", "body:ty")
    assert all(first.is_at("appendage", place) for place in places)
    assert not first.is_at("mass_error", "body:ty")
    with pytest.raises(TruthError, match="body:ty is not among them"):
        read(changed(("causes", 0, "places"), ["body:tilt"]), tmp_path)


NOTHING = {
    **GOOD,
    "verdict": "none",
    "probability": {"none": 1, "unexplained": 0, "several": 0},
    "gap": {"as_drawn": None, "retuned": {"error": 0.1, "excess": None}, "after": None,
            "noise": None, "closed": None},
    "where": None,
    "causes": [],
    "twins": [],
    "next_experiment": None,
}  # fmt: skip

ALLOWED = {
    "nothing at all": NOTHING,
    "more keys": {**GOOD, "schema": 3, "causes": [{**GOOD["causes"][0], "note": "x"}]},
    "shares that do not exist": changed(("where", 0, "share"), None)
    | {"where": [{"location": "body:ty", "share": None}]},
    "rows left out below 0.01": changed(("causes", 0, "probability"), 0.72),
    "presence in a set of several": {
        **GOOD,
        "verdict": "several",
        "probability": {"none": 0, "unexplained": 0, "several": 0.9},
        "causes": [{**GOOD["causes"][0], "probability": 0.95},
                   {**GOOD["causes"][1], "probability": 0.92}],
    },
    "an excess below the noise": changed(("gap", "after", "excess"), 0.97),
    "equal shares": changed(("where", 0, "share"), 0.1),
    "equal probabilities": changed(("causes", 0, "probability"), 0.5)
    | {"causes": [{**one, "probability": 0.475} for one in GOOD["causes"]]},
    "rounded a little above 1": changed(("causes", 1, "probability"), 0.07),
}  # fmt: skip


@pytest.mark.parametrize("case", ALLOWED)
def test_what_the_contract_allows_is_read(case, tmp_path):
    assert read(ALLOWED[case], tmp_path).verdict == ALLOWED[case]["verdict"]


REFUSED = {
    "an unknown word": (changed(("verdict",), "explaned"), "verdict 'explaned'"),
    "no word": (changed(("verdict",), DELETE), "verdict is missing"),
    "no causes key": (changed(("causes",), DELETE), "causes is missing"),
    "no next experiment": (changed(("next_experiment",), DELETE), "next_experiment is missing"),
    "causes null": (changed(("causes",), None), "causes: expected a list, got None"),
    "a list": ([1], r"expected an object, got \[1\]"),
    "explained without causes": (
        changed(("causes",), []) | {"probability": {"none": 1, "unexplained": 0, "several": 0}},
        "'explained' needs 1",
    ),
    "several with one cause": (
        changed(("verdict",), "several") | {"causes": GOOD["causes"][:1]},
        "'several' needs 2",
    ),
    "sum above 1": (changed(("probability", "none"), 0.09), "all sum to 1.090"),
    "sum far below 1": (changed(("causes", 0, "probability"), 0.6), "all sum to 0.710"),
    "a cause beside a certain none": (
        changed(("probability",), {"none": 0.5, "unexplained": 0, "several": 0.5}),
        "a cause has 0.9",
    ),
    "a cause beside a probable unexplained": (
        changed(("probability",), {"none": 0.1, "unexplained": 0.3, "several": 0.6})
        | {"causes": [{**one, "probability": p}
                      for one, p in zip(GOOD["causes"], (0.65, 0.1), strict=True)]},
        "a cause has 0.65",
    ),
    "negative": (changed(("probability", "none"), -0.01), "probability of none"),
    "above one": (changed(("causes", 0, "probability"), 1.5), r"causes\[0\]: 1.5"),
    "null probability": (changed(("causes", 0, "probability"), None), "expected a number"),
    "a string": (changed(("probability", "none"), "0.01"), "expected a number, got '0.01'"),
    "a boolean": (changed(("probability", "none"), False), "expected a number, got False"),
    "another hypothesis": (changed(("probability", "gremlin"), 0.0), "'gremlin' is no hypothesis"),
    "one effect twice": (
        changed(("causes", 1), {**GOOD["causes"][0], "probability": 0.06}),
        "given twice at one location",
    ),
    "one pair twice, turned": (
        changed(
            ("causes",),
            [{**GOOD["causes"][1], "effect": "parallel_path", "location": f"pair:{pair}",
              "probability": 0.45} for pair in ("a-b", "b-a")],
        ),
        "given twice at one location",
    ),
    "the least first": (changed(("causes",), GOOD["causes"][::-1]), "most probable first"),
    "an unknown effect": (changed(("causes", 0, "effect"), "gremlin"), "'gremlin' is not in"),
    "effect at a wrong place": (changed(("causes", 0, "location"), "joint:ty"), "sits at body"),
    "no location": (changed(("causes", 0, "location"), "ty"), "'ty': expected <kind>:<name>"),
    "a nested parameter": (changed(("causes", 0, "parameters", "mass"), [[1]]), "mass: expected"),
    "an empty vector": (changed(("causes", 0, "parameters", "mass"), []), "mass: is empty"),
    "a turned interval": (changed(("causes", 0, "interval", "mass"), [2, 1]), "interval.mass"),
    "half an interval": (changed(("causes", 0, "interval", "mass"), [2]), "interval.mass"),
    "one interval for a vector": (
        changed(("causes", 0, "interval", "position"), [0, 1]),
        "one for each component",
    ),
    "a share above one": (changed(("where", 0, "share"), 1.2), r"where\[0\].share"),
    "shares above one": (changed(("where", 1, "share"), 0.5), "sum to 1 at most"),
    "shares out of order": (changed(("where", 0, "share"), 0.05), "the largest first"),
    "some shares null": (changed(("where", 1, "share"), None), "some shares are null"),
    "a place twice": (changed(("where", 1, "location"), "body:ty"), "a location is given twice"),
    "a lonely twin": (changed(("twins", 0), ["appendage@body:ty"]), "two or more different"),
    "a twin of itself": (changed(("twins", 0), ["appendage@body:ty"] * 2), "two or more"),
    "a twin without place": (changed(("twins", 0, 0), "appendage"), r"location ''"),
    "a gap without noise": (changed(("gap", "noise"), DELETE), "gap: noise is missing"),
    "a negative excess": (changed(("gap", "after", "excess"), -1), "gap.after.excess"),
    "an excess as text": (changed(("gap", "retuned", "excess"), "5"), "gap.retuned.excess"),
    "a number that is none": ('{"verdict": NaN}', "NaN is no number"),
    "an infinite number": ('{"verdict": -Infinity}', "-Infinity is no number"),
    "too large a number": (
        json.dumps(GOOD).replace('"excess": 5.1', '"excess": 1e999'),
        "gap.retuned.excess: inf is not finite",
    ),
    "a very long number": (
        json.dumps(GOOD).replace('"excess": 5.1', f'"excess": 1{"0" * 400}'),
        "gap.retuned.excess",
    ),
    "an endless number": (f'{{"verdict": {"9" * 6000}}}', "is not JSON"),
    "a key twice": ('{"a": 1, "verdict": "none", "verdict": "x"}', "'verdict' is given twice"),
    "half a file": (json.dumps(GOOD)[:200], "is not JSON"),
    "nothing": ("", "is not JSON"),
    "a deep file": ("[" * 100_000, "nested too deeply"),
    "a huge file": (" " * LARGEST + "{}", "bytes; at most"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_breaks_the_contract_is_refused_by_name(case, tmp_path):
    value, words = REFUSED[case]
    with pytest.raises(TruthError, match=words):
        read(value, tmp_path)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "verdict.json").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(TruthError, match="is not JSON"):
        read_verdict(tmp_path / "verdict.json")


@pytest.mark.parametrize("name", ["none.json", "."])
def test_a_missing_file_or_a_folder_is_refused(name, tmp_path):
    with pytest.raises(TruthError, match="cannot be read"):
        read_verdict(tmp_path / name)


def test_components_that_nothing_shows_are_null_and_are_not_graded(tmp_path):
    row = {
        **GOOD["causes"][0],
        "effect": "parallel_path",
        "location": "pair:a-b",
        "parameters": {"stiffness": [4e3, None, None]},
        "interval": {"stiffness": [[3e3, 5e3], None, None]},
    }
    path = tmp_path / "verdict.json"
    path.write_text(json.dumps(changed(("causes", 0), row)), encoding="utf-8")
    verdict = read_verdict(path)
    for true in ((5e3, 1.0, 1.0), (5e3,)):
        cause = TrueCause("parallel_path", "pair:a-b", parameters={"stiffness": true})
        (estimate,) = estimates_of(Truth((cause,)), verdict)
        assert estimate.error == pytest.approx(0.2)
        assert estimate.inside == (True,)
