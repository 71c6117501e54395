"""The bench of real machines: its designs are balanced, its figures follow from its rows."""

import tomllib
from collections import Counter
from dataclasses import asdict

import pytest

from tests.bench import dirty_campaigns
from tests.bench.dirty import EARLIER, dirt_items, weakest_ratio
from tests.bench.dirty_campaigns import (
    SIZED,
    Design,
    beside_tolerance,
    draw,
    ensure,
    reported_designs,
)
from tests.bench.dirty_rates import figures, wrong_rows
from truth import TruthError

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
    kept = {"seed": seed, "commit": "x", **asdict(design), "answer": answer, "drawn_ratio": drawn}
    return kept | {"items": ["@".join(ITEM)], "verdict": told, "seconds": seconds, "wall": seconds}


SINGLE = Design("single", ("appendage",), 4.0, 5.0)
NAMED = verdict((FAULT, 0.9, 1.5))


def values(rows, old=()):
    return {figure["figure"]: (figure["value"], figure["n"]) for figure in figures(rows, old)}


def test_any_first_part_of_the_designs_is_balanced():
    designs = reported_designs()
    assert 400 < len(designs) < 1000 <= dirty_campaigns._NEXT_SEED
    cells = Counter((d.dirt, d.ratio) for d in designs if d.cell == "single" and d.dirt < 30)
    assert set(cells.values()) == {4 * len(SIZED)}
    each = Counter((d.dirt, d.ratio, d.effects) for d in designs if d.cell == "single")
    assert {n for (dirt, *_), n in each.items() if dirt < 30} == {4}
    kinds = Counter(d.cell for d in designs)
    assert (kinds["alone"], kinds["force"], kinds["nothing"], kinds["clean"]) == (60, 40, 60, 100)
    first = Counter((d.cell, d.dirt, d.ratio) for d in designs[:150])
    share = Counter((d.cell, d.dirt, d.ratio) for d in designs)
    for group, n in share.items():
        assert first[group] == pytest.approx(n * 150 / len(designs), abs=2)
    effects = Counter(d.effects for d in designs[:150] if d.cell == "single" and d.dirt < 30)
    assert max(effects.values()) <= 2 * (1 + 150 * 4 // len(designs)) + 2
    assert 0.2 < sum(d.tree for d in designs) / len(designs) < 0.3
    assert reported_designs() == designs


def test_a_single_fault_counts_in_the_cell_of_the_ratio_that_was_drawn():
    told = values(
        [
            row(1, SINGLE, NAMED),
            row(2, SINGLE, verdict((ITEM, 0.8, 2.0), (FAULT, 0.2, 2.5))),
            row(3, SINGLE, verdict((OTHER, 0.8, 2.0))),
            row(4, SINGLE, NAMED, drawn=2.1),
            row(5, SINGLE, None),
        ]
    )
    assert told["dirt 5 %, ratio 4: effect and place first, %"][0] == 50
    assert told["dirt 5 %, ratio 4: the fault itself first, %"][0] == 25
    assert told["dirt 5 %, ratio 4: verdict partly or explained, %"] == (75, "4 [30.1, 95.4]")
    assert told["dirt 5 %, ratio 4: probability of the truth, mean"][0] == pytest.approx(0.275)
    assert told["dirt 5 %, ratio 4: wrong cause with p of 0.5 or more, %"][0] == 25
    assert told["dirt 5 %, ratio 2: effect and place first, %"] == (100, "1 [20.7, 100.0]")
    assert told["all: core seconds, median"] == (20.0, 5)


def test_imperfections_alone_may_be_named_if_they_matter():
    alone, nothing = Design("alone", dirt=15.0), 'effect = "none"\n'
    rows = [
        row(1, alone, verdict((ITEM, 0.8, 2.0)), nothing, None),
        row(2, alone, verdict((ITEM, 0.8, 4.9)), nothing, None),
        row(3, alone, verdict((OTHER, 0.4, 2.0), word="unexplained"), nothing, None),
    ]
    told = values(rows)
    assert told["alone: wrong cause with p of 0.5 or more, %"][0] == pytest.approx(100 / 3)
    assert told["alone: verdict unexplained, %"][0] == pytest.approx(100 / 3)
    assert told["alone, dirt 15 %: wrong cause with p of 0.5 or more, %"][1].startswith("3 [")
    ((seed, true, said),) = wrong_rows(rows)
    assert (seed, true, said) == (2, "alone: nothing", "partly, joint_coupling at joint:ty 0.80")
    assert told["diagnoses that ended in an error"] == (0, 3)
    ended = [*rows, row(4, alone, None, nothing, None)]
    assert values(ended)["diagnoses that ended in an error"] == (1, 4)
    assert [seed for seed, *_ in wrong_rows(ended)] == [2, 4]


def test_several_faults_are_found_if_all_are_likely():
    cause = '\n[[cause]]\neffect = "{}"\nlocation = "{}"\nratio = 4.0\n'
    answer = 'effect = "several"\n' + cause.format(*FAULT) + cause.format(*OTHER)
    told = verdict((FAULT, 0.5, 3.0), (OTHER, 0.5, 3.0))
    rows = [
        row(1, Design("several", ("appendage", "mass_error"), 4.0), told, answer),
        row(2, Design("several", ("appendage", "mass_error"), 4.0, 5.0), NAMED, answer),
    ]
    found = values(rows)
    assert found["2 effects: all found, %"][0] == 50
    assert found["2 effects, dirt 0 %: all found, %"][0] == 100
    assert found["2 effects, dirt 5 %: all found, %"][0] == 0
    assert found["2 effects: one of them first, %"][0] == 100
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
            | {"twins": [["mass_error@body:tilt", "mass_error@body:ty"]]},
            False,
        ),
        ("hammer_delay", ("delay", 1e-4), 0.0, verdict(word="none", none=1.0), False),
    ],
)
def test_a_wrong_force_channel_is_named_or_within_its_tolerance(
    effect, parameter, dirt, told, right
):
    design = Design("force", (effect,), dirt=dirt, parameter=parameter)
    given = [row(1, design, told, 'effect = "none"\n', None)]
    (name,) = [name for name in values(given) if name.startswith("force, ")]
    assert values(given)[name][0] == 100 * right


@pytest.mark.parametrize(
    ("effect", "parameter"), [("hammer_gain", ("gain", 1.2)), ("hammer_delay", ("delay", -1e-4))]
)
def test_a_fault_of_the_force_channel_is_that_with_its_tolerance(effect, parameter):
    design = Design("force", (effect,), parameter=parameter, tree=True)
    answer = tomllib.loads(draw(design, EARLIER[0] - 3).answer.decode())
    assert answer["effect"] == effect
    assert answer["parameters"][parameter[0]] == pytest.approx(parameter[1])
    assert beside_tolerance(design, EARLIER[0] - 3)[1] != pytest.approx(parameter[1])
    assert beside_tolerance(SINGLE, EARLIER[0] - 3) is None


def test_two_engines_are_compared_on_the_same_campaigns():
    clean = Design("clean", ("appendage",), 4.0)
    new = [row(seed, clean, NAMED) for seed in range(20)]
    old = [row(seed, clean, NAMED if seed < 12 else None) for seed in range(15)]
    told = values(new, old)
    name = "clean: right, this engine less the old one, % (alone right 3 and 0, McNemar's p 0.25)"
    difference, n = told[name]
    assert difference == pytest.approx(20)
    assert n.startswith("15 [")
    assert not any("less the old one" in figure for figure in values(new))


def test_rows_that_are_left_out_are_counted():
    hidden = {key: row(1, SINGLE, NAMED)[key] for key in ("seed", "cell", "dirt")}
    told = values([row(2, SINGLE, NAMED), hidden | {"left_out": "hidden"}])
    assert told["campaigns left out: hidden"] == (1, 2)


def test_a_drawn_campaign_stays_and_its_answer_lies_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMPAIGNS", str(tmp_path))
    design = Design("single", ("gyroscopic",), 2.0, 5.0, tree=True)
    stored = ensure(design, EARLIER[0] - 2)
    assert (stored.folder / "campaign.toml").is_file()
    assert not (stored.folder / "answer.toml").exists()
    assert weakest_ratio(stored.answer) == pytest.approx(2.0, rel=0.3)
    assert any(item.startswith("structural_damping@joint:") for item in dirt_items(stored.answer))
    monkeypatch.setattr(dirty_campaigns, "draw", None)  # it is not drawn again
    assert ensure(design, EARLIER[0] - 2) == stored


def test_a_machine_without_a_place_gives_way_to_the_next(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMPAIGNS", str(tmp_path))
    seeds = []

    def fail(design, seed):
        seeds.append(seed)
        raise TruthError("no place")

    monkeypatch.setattr(dirty_campaigns, "draw", fail)
    assert ensure(SINGLE, 7).answer is None
    assert seeds == [7, 1007, 2007, 3007, 4007]
