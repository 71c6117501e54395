"""The scorecard: its designs are balanced, its figures follow from its rows."""

import tomllib
from collections import Counter
from dataclasses import asdict

import pytest

from tests.bench import scorecard_draws
from tests.bench.scorecard_draws import (
    SIZED,
    Design,
    beside_tolerance,
    draw,
    ensure,
    reported_designs,
)
from tests.bench.scorecard_rates import (
    left_out,
    rate_rows,
    read_rows,
    stated_probabilities,
    wrong_rows,
)
from truth import TruthError

SEED = 550_000  # the scorecard reports no campaign near it
ANSWER = 'effect = "{}"\nlocation = "{}"\nratio = {}\n'
FAULT = ("appendage", "body:ty")
ITEM = ("joint_coupling", "joint:ty")
OTHER = ("mass_error", "body:tilt")


def verdict(*causes, word="partly", none=0.0):
    """A verdict file; every cause has its probability and the excess with it."""
    gap = {"error": 0.3, "excess": 5.0}
    left = 1.0 - none - sum(p for _, p, _ in causes)
    rows = [
        {
            "effect": effect,
            "location": location,
            "probability": p,
            "parameters": {},
            "excess_after": after,
        }
        for (effect, location), p, after in causes
    ]
    return {
        "verdict": word,
        "probability": {"none": none, "unexplained": max(left, 0.0), "several": 0.0},
        "gap": {"as_drawn": gap, "retuned": gap, "after": gap, "noise": 0.1, "closed": 0.9},
        "where": None,
        "causes": rows,
        "twins": [],
        "not_testable": [],
        "next_experiment": None,
    }


def row(seed, design, told, answer=None, drawn=4.0, seconds=20.0):
    answer = ANSWER.format(*FAULT, drawn) if answer is None else answer
    kept = {"seed": seed, "engine": "x", **asdict(design), "answer": answer, "drawn_ratio": drawn}
    return kept | {"items": ["@".join(ITEM)], "verdict": told, "seconds": seconds, "wall": seconds}


SINGLE = Design("dirt 5 %", ("appendage",), 4.0, 5.0)
NAMED = verdict((FAULT, 0.9, 1.5))
NOTHING = 'effect = "none"\n'


def cells(rows):
    return {figures["cell"]: figures for figures in rate_rows(rows)}


def test_any_first_part_of_the_designs_is_balanced():
    designs = reported_designs()
    assert 500 < len(designs) < 1000 <= scorecard_draws._NEXT_SEED
    kinds = Counter((d.cell, d.ratio) for d in designs)
    assert kinds["dirt 5 %", 4.0] == kinds["dirt 15 %", 2.0] == 40
    assert (kinds["dirt alone", None], kinds["nothing", None]) == (45, 40)
    each = Counter(d.effects for d in designs if d.cell == "dirt 5 %")
    assert set(each.values()) <= {4, 5}
    assert len(each) == len(SIZED)
    first = Counter((d.cell, d.dirt, d.ratio) for d in designs[:150])
    share = Counter((d.cell, d.dirt, d.ratio) for d in designs)
    for group, n in share.items():
        assert first[group] == pytest.approx(n * 150 / len(designs), abs=2)
    assert 0.1 < sum(d.machine == "tree" for d in designs) / len(designs) < 0.3
    assert reported_designs() == designs


def test_a_single_fault_counts_in_the_cell_of_the_ratio_that_was_drawn():
    figures = cells(
        [
            row(1, SINGLE, NAMED),
            row(2, SINGLE, verdict((ITEM, 0.8, 2.0), (FAULT, 0.2, 2.5))),
            row(3, SINGLE, verdict((OTHER, 0.8, 2.0))),
            row(4, SINGLE, NAMED, drawn=2.1),
            row(5, SINGLE, None),
        ]
    )
    at_4 = figures["dirt 5 %, ratio 4"]
    assert (at_4["right"], at_4["right n"], at_4["errors"]) == (50, 4, 1)
    assert at_4["right from"] == pytest.approx(15.0, abs=0.1)
    assert at_4["probability"] == pytest.approx(0.275)
    assert at_4["wrong cause"] == 25
    assert figures["dirt 5 %, ratio 2"]["right"] == 100
    assert figures["beside 5 or 15 % of dirt, ratio 4"] == at_4 | {
        "cell": "beside 5 or 15 % of dirt, ratio 4"
    }
    assert figures["all"]["core s"] == 20.0


def test_imperfections_alone_may_be_named_if_they_matter():
    alone = Design("dirt alone", dirt=15.0)
    rows = [
        row(1, alone, verdict((ITEM, 0.8, 2.0)), NOTHING, None),
        row(2, alone, verdict((ITEM, 0.8, 4.9)), NOTHING, None),
        row(3, alone, verdict((OTHER, 0.4, 2.0), word="unexplained"), NOTHING, None),
        row(4, alone, None, NOTHING, None),
    ]
    assert cells(rows)["dirt alone"]["right"] == 50
    assert cells(rows)["dirt alone"]["wrong cause"] == 25
    assert [seed for seed, *_ in wrong_rows(rows)] == [2, 4]
    assert wrong_rows(rows)[0][1:] == (
        "dirt alone: nothing",
        "partly, joint_coupling at joint:ty 0.80",
    )
    (_, middle, sure, _) = stated_probabilities(read_rows(rows[:3])).bins
    assert (sure.true.n, sure.true.hits, middle.true.n) == (2, 1, 0)


@pytest.mark.parametrize(
    ("design", "told", "right"),
    [
        (Design("nothing"), verdict(word="none", none=1.0), True),
        (Design("nothing"), verdict(word="unexplained"), False),
        (Design("nothing, quiet", levels=(5e3,)), verdict(word="unexplained"), False),
        (Design("linear", levels=(40.0, 200.0)), verdict(word="unexplained"), True),
        (Design("linear", levels=(40.0, 200.0)), verdict((OTHER, 0.9, 1.1)), False),
    ],
)
def test_where_nothing_is_missing_the_verdict_has_to_say_so(design, told, right):
    (case,) = read_rows([row(1, design, told, NOTHING, None)])
    assert case.is_right == right


def test_several_faults_are_found_if_all_are_likely():
    cause = '\n[[cause]]\neffect = "{}"\nlocation = "{}"\nratio = 4.0\n'
    answer = 'effect = "several"\n' + cause.format(*FAULT) + cause.format(*OTHER)
    told = verdict((FAULT, 0.5, 3.0), (OTHER, 0.5, 3.0))
    rows = [
        row(1, Design("2 effects", ("appendage", "mass_error"), 4.0), told, answer),
        row(2, Design("2 effects", ("appendage", "mass_error"), 4.0, 5.0), NAMED, answer),
    ]
    assert cells(rows)["2 effects"]["right"] == 50
    assert [seed for seed, *_ in wrong_rows(rows)] == [2]


@pytest.mark.parametrize(
    ("effect", "parameter", "dirt", "told", "right"),
    [
        ("hammer_gain", ("gain", 1.05), 0.0, verdict(word="none", none=1.0), True),
        ("hammer_gain", ("gain", 1.05), 5.0, verdict(word="unexplained"), True),
        ("hammer_gain", ("gain", 1.05), 0.0, verdict(word="unexplained"), False),
        ("hammer_gain", ("gain", 1.05), 5.0, verdict((OTHER, 0.9, 1.1)), False),
        ("hammer_gain", ("gain", 1.2), 0.0, verdict(word="none", none=1.0), False),
        ("hammer_gain", ("gain", 1.2), 0.0, verdict((OTHER, 0.9, 1.1)), False),
        (
            "hammer_gain",
            ("gain", 1.2),
            0.0,
            verdict((OTHER, 0.9, 1.1))
            | {"twins": [["mass_error@body:tilt", "hammer_gain@hammer:acc1"]]},
            True,
        ),
        (
            "hammer_gain",
            ("gain", 1.2),
            0.0,
            verdict((OTHER, 0.9, 1.1))
            | {"twins": [["mass_error@body:tilt", "mass_error@body:ty"]]},
            False,
        ),
        ("hammer_delay", ("delay", 1e-4), 0.0, verdict(word="none", none=1.0), False),
    ],
)
def test_a_wrong_force_channel_is_named_or_within_its_tolerance(
    effect, parameter, dirt, told, right
):
    design = Design("force channel", (effect,), dirt=dirt, parameter=parameter)
    (case,) = read_rows([row(1, design, told, ANSWER.format(effect, "hammer:acc1", 4.0), None)])
    assert case.is_right == right


@pytest.mark.parametrize(
    ("effect", "parameter"), [("hammer_gain", ("gain", 1.2)), ("hammer_delay", ("delay", -1e-4))]
)
def test_a_fault_of_the_force_channel_is_that_with_its_tolerance(effect, parameter):
    design = Design("force channel", (effect,), parameter=parameter, machine="tree")
    answer = tomllib.loads(draw(design, SEED - 3).answer.decode())
    assert answer["effect"] == effect
    assert answer["parameters"][parameter[0]] == pytest.approx(parameter[1])
    assert beside_tolerance(design, SEED - 3)[1] != pytest.approx(parameter[1])
    assert beside_tolerance(SINGLE, SEED - 3) is None


def test_rows_that_are_left_out_are_counted():
    hidden = {key: row(1, SINGLE, NAMED)[key] for key in ("seed", "cell", "dirt")}
    rows = [row(2, SINGLE, NAMED), hidden | {"left_out": "hidden"}]
    assert left_out(rows) == {"hidden": 1}
    assert cells(rows)["all"]["right n"] == 1


def test_a_drawn_campaign_stays_and_its_answer_lies_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMPAIGNS", str(tmp_path))
    design = Design("dirt 5 %", ("gyroscopic",), 2.0, 5.0, machine="tree")
    stored = ensure(design, SEED - 2)
    assert (stored.folder / "campaign.toml").is_file()
    assert not (stored.folder / "answer.toml").exists()
    assert stored.weakest_ratio == pytest.approx(2.0, rel=0.3)
    assert any(item.startswith("structural_damping@joint:") for item in stored.dirt_items)
    monkeypatch.setattr(scorecard_draws, "draw", None)  # it is not drawn again
    assert ensure(design, SEED - 2) == stored


def test_a_machine_without_a_place_gives_way_to_the_next(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMPAIGNS", str(tmp_path))
    seeds = []

    def fail(design, seed):
        seeds.append(seed)
        raise TruthError("no place")

    monkeypatch.setattr(scorecard_draws, "draw", fail)
    assert ensure(SINGLE, 7).answer is None
    assert seeds == [7, 1007, 2007, 3007, 4007]
