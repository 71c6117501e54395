"""Faults of instruments beyond tolerance: the force channel, the place of hits, late sensors."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.estimates.intervals import fit_parameters
from diagnosis.scene_points import list_instruments, locate_hammer
from diagnosis.search.score_test import scores
from diagnosis.settings import SETTINGS
from mbmodel import (
    Machine,
    Part,
    body_parts,
    hammer_parts,
    sensor_parts,
    spring_parts,
)
from tests.helpers.refits import refit_null, refit_with
from tests.helpers.torque_campaign import OUTPUTS, REFERENCES, write_torque_campaign
from tuning import Session, open_session

HITS = ("3:+x", "3:-y", "3:+z")
DISPLACED = {
    f"hammer(acc3:t{hit}).position_{axis}": size
    for hit in "xyz"
    for axis, size in zip("xyz", (0.03, -0.02, 0.025), strict=True)
}
CASES = {
    "hammer_gain": ({"drives": dict.fromkeys(HITS, 1.3)}, "hammer:acc3", {"gain": 1.3}),
    "hammer_delay": ({"force_delay": -2e-4}, "hammer:acc3", {"delay": -2e-4}),
    "hammer_position": (
        {"changed": DISPLACED},
        "hammer:acc3",
        {"offset": (0.03, -0.02, 0.025)},
    ),
    "sensor_delay": (
        {"changed": {f"acc4.delay_{axis}": 3e-4 for axis in ("x", "y", "z", "rz")}},
        "sensor:acc4",
        {"delay": 3e-4},
    ),
}


def parts(machine: Machine) -> tuple[Part, ...]:
    return (
        *spring_parts(machine),
        *body_parts(machine),
        *sensor_parts(machine, OUTPUTS),
        *hammer_parts(machine, REFERENCES[:3]),
    )


def opened(folder: Path, fault: dict[str, object], extra: str = "") -> Session:
    """A campaign of three hits whose instruments are off, opened."""
    write_torque_campaign(folder, parts, labels=HITS, noise=0.003, extra=extra, **fault)
    return open_session(folder, (5.0, 165.0))


def proposed(scene: Scene):
    return [one for effect in EFFECTS.values() for one in effect(scene)]


@pytest.mark.parametrize("effect", CASES)
def test_the_effect_is_scored_first_and_recovers_its_parameter(tmp_path, effect):
    fault, place, truth = CASES[effect]
    session = opened(tmp_path / "case", fault)
    null = refit_null(Scene(session, session.model.drawn))
    scene = Scene(session, null.fit.theta)
    ranked = scores(scene, null.fit, proposed(scene), null.floor, SETTINGS.score_stride)
    best = ranked[0].hypothesis
    assert best.key == (effect, place, None)
    ended = refit_with(scene, null, best)
    free = dict(
        zip(ended.fit.parametrisation.names, ended.fit.parametrisation.is_tolerance, strict=True)
    )
    assert not any(free[name] for name in best.release)
    (ends,) = fit_parameters(ended).estimate_intervals(best).values()
    ((name, true),) = truth.items()
    assert set(ended.state_parameters(best)) == {name}
    low, high = np.reshape(ends, (-1, 2)).T
    slack = 0.5 * (high - low)
    assert (low - slack < true).all(), (ends, true)
    assert (true < high + slack).all(), (ends, true)
    is_seen = high - low < np.abs(true)  # of a place, what the machine's motions show
    assert is_seen.any()


def test_a_named_hammer_is_its_own_place_and_another_is_not_released(tmp_path):
    session = opened(tmp_path / "case", {})
    scene = Scene(session, session.model.drawn)
    assert list_instruments(scene) == ("default",)
    assert locate_hammer(scene, "default") == "hammer:acc3"
    assert locate_hammer(scene, "big") == "hammer:big"


def test_hits_of_a_point_are_displaced_together_or_one_by_one(tmp_path):
    session = opened(tmp_path / "case", {})
    found = {
        one.dof: one for one in EFFECTS["hammer_position"](Scene(session, session.model.drawn))
    }
    assert set(found) == {None, "tx", "ty", "tz"}
    assert found["tx"].release == tuple(f"hammer(acc3:tx).position_{axis}" for axis in "yz")
    assert len(found[None].release) == 4  # its body does not turn about x
    assert all(one.location == "hammer:acc3" for one in found.values())


def test_instruments_that_are_stated_exact_are_not_released(tmp_path):
    exact = (
        "[tolerance]\nhammer_gain = 0\nhammer_delay = 0\nsensor_delay = 0\nhammer_position = 0\n"
    )
    session = opened(tmp_path / "case", {}, exact)
    scene = Scene(session, session.model.drawn)
    assert not [one.effect for one in proposed(scene) if one.effect in CASES]
