"""Sets by seed: the bundled one again, keys with neighbours and places that look alike."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from gapbench.__main__ import BUNDLED, main
from gapbench.draw import _alike_places, _bodies_at, draw_set, places_of
from gapbench.run import open_set
from truth import Cause, Plan, Protocol, Wanted
from truth.campaign.draw import REAL_INSTRUMENTS
from truth.campaign.virtual_test import draw_subject
from truth.grade.verdict import CATALOGUE
from truth.machine.random_tree import draw_tree


def test_the_bundled_set_is_that_of_its_seed(tmp_path, capsys):
    folder = tmp_path / "set"
    words = ["draw", str(folder), "--seed", "930000", "--count", "1", "--strata", "force", "real"]
    assert main(words) == 0
    assert "seed 930000 gives the bundled set" in capsys.readouterr().err
    keys = json.loads((folder / "keys.json").read_text("utf-8"))
    with open_set(BUNDLED) as (bundled, whole):
        assert set(whole["effects"]) == set(CATALOGUE)
        for name, key in keys["cases"].items():
            twin = next(n for n, k in whole["cases"].items() if k["stratum"] == key["stratum"])
            expected = whole["cases"][twin]
            for drawn, cause in zip(key["causes"], expected["causes"], strict=True):
                assert drawn.pop("size") == pytest.approx(cause.pop("size"))
            assert key == expected
            toml = (folder / name / "campaign.toml").read_text("utf-8")
            assert toml == (bundled / twin / "campaign.toml").read_text("utf-8")
            assert "seed" not in toml
            for test in tomllib.loads(toml)["test"]:
                sizes = [
                    (place / test["file"]).stat().st_size
                    for place in (folder / name, bundled / twin)
                ]
                assert sizes[0] == pytest.approx(sizes[1], rel=0.01)


def test_a_set_is_never_overwritten(tmp_path):
    with pytest.raises(FileExistsError, match="another folder"):
        draw_set(tmp_path, 1, 1)


def test_neighbours_share_a_body_or_a_joint():
    station = draw_tree(5, 3)
    parents = [stage.parent for stage in station.stages]
    assert parents == [-1, 0, 1]

    def are_neighbours(first, second):
        return bool(_bodies_at(first, station) & _bodies_at(second, station))

    assert are_neighbours("body:stage1", "body:stage2")
    assert not are_neighbours("body:stage1", "body:stage3")
    assert are_neighbours("joint:stage1", "joint:stage2")
    assert not are_neighbours("joint:stage1", "joint:stage3")
    assert are_neighbours("sensor:acc11", "sensor:acc12")
    assert not are_neighbours("sensor:acc11", "sensor:acc21")
    assert are_neighbours("pair:world-stage3", "pair:stage1-stage3")
    pairs = ["pair:world-stage2", "pair:world-stage3", "pair:stage1-stage3"]
    assert sorted(places_of(station, (19,))["pair"]) == sorted(pairs)


def test_a_link_to_either_of_two_bodies_on_a_stiff_joint_looks_alike():
    tree = draw_tree(5, 3)
    stages = [
        replace(
            stage,
            joints=tuple(
                replace(joint, stiffness=joint.stiffness * (100 if stage.name == "stage3" else 1))
                for joint in stage.joints
            ),
        )
        for stage in tree.stages
    ]
    lookalikes = []
    for station in (tree, replace(tree, stages=tuple(stages))):
        protocol = Protocol((station.first_aim(),), (200.0,), 10, 1, 201, 0.75)
        cause = Cause((Wanted("parallel_path", "pair:world-stage2", 4.0),))
        plan = Plan(5, cause, protocol, REAL_INSTRUMENTS)
        lookalikes.append(_alike_places(draw_subject(station, plan), plan))
    assert lookalikes == [{}, {"pair:world-stage2": ["pair:stage1-stage3"]}]
    assert np.isclose(stages[2].joints[0].stiffness, 100 * tree.stages[2].joints[0].stiffness)
