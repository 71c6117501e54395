"""Computed changes of one measured machine: the tower, by one state and before and after.

Each case draws a change (``truth/campaign/changed_tower.py``) and makes it in the measured matrix.
Two campaigns are diagnosed, so that the rates are paired:

- one state: the changed test, against the drawing tuned to the unchanged test;
- before and after: both tests in one campaign, against the drawing.

Where a change has a size, it is one that a refit leaves at 2 to 8 times what it leaves without it:
sqrt(e1^2 - e0^2) / e0, with the tuned drawing. Legs have their drawn size: a refit of one state
follows them wholly.

A cause counts as named with a probability of one half. A case is right if each change is named with
effect and place and nothing else is, wrong if a cause is named that is no change. Two changes have
another name that is as true (``_is_named``): a common gain is all masses at once, and a leg in one
state is a row of the tuned parameters. Sizes are right within 10 %: gains by their distance from
one, springs and legs by the change in N/m, appendages by mass and frequency.

Seeds 470000 and up, none of which tuned anything. Rows that are done are kept: ``LIMIT=24`` for the
first 24, ``STATES=2`` for before and after alone, ``JOBS=1`` for the number of processes.
All rows in ``results/real*.cases.jsonl`` are of one engine: that of the commit that adds them.
"""

import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from mbmodel import load_machine
from tests.bench.kept import cases, of
from truth.campaign.changed_tower import (
    ASSET,
    GAIN_SD,
    KINDS,
    TowerChange,
    change_tower,
    draw_change,
    read_tower,
    write_tower,
)
from truth.grade.rates import wilson
from tuning import channel_gaps, fit, open_session, predict, summarise_gaps

CASES, FIRST = 210, 470_000
RATIOS = (2.0, 8.0)
STATES = {"1": "one state", "2": "before and after"}
_TRIES = 8  # of sizes
_NAMED = 0.5  # probability
_SIZE_ERROR = 0.1
_WITHOUT_RATIO = ("sign", "exchange", "nothing", "leg")  # a refit follows a leg wholly
_GRADED = ("mass", "frequency", "stiffness", "damping", "gain", "delay")  # sizes of a change
COLUMNS = ("right", "wrong", "sizes")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the rates of each number of states."""
    numbers = range(min(int(os.environ.get("LIMIT", CASES)), CASES))
    jobs = int(os.environ.get("JOBS", "1"))
    for states in os.environ.get("STATES", "1 2").split():
        cases(f"real.{states}", numbers, {"1": _diagnose_one, "2": _diagnose_both}[states], jobs)
    return [
        {"states": label, **rate_cases(kind, list(of(f"real.{states}").values()))}
        for states, label in STATES.items()
        for kind in (*KINDS, "all changes", "all")
    ]


def rate_cases(kind: str, rows: list[dict]) -> dict[str, object]:
    """Return how many cases of a kind are right and wrong, each with its 95 % interval.

    Sizes count among the cases that are right and have one.
    """
    chosen = [
        row
        for row in rows
        if kind in (row["kind"], "all") or (kind == "all changes" and row["kind"] != "nothing")
    ]
    result: dict[str, object] = {"change": kind, "n": len(chosen)}
    for name in COLUMNS:
        graded = [row[name] for row in chosen if row[name] is not None]
        low, high = wilson(sum(graded), max(len(graded), 1))
        result |= {name: sum(graded), f"{name} n": len(graded)}
        result |= {f"{name} from": 100 * low, f"{name} to": 100 * high}
    return result | {"seconds": float(np.median([row["seconds"] for row in chosen] or [0.0]))}


def _draw(number: int) -> dict[str, object]:
    """Return change, scale and survival ratio; sizes are drawn until the ratio is as wanted."""
    kind, ratio, scale = KINDS[number % len(KINDS)], None, 1.0
    without, ratios = 0.0, {}
    with threadpool_limits(1), tempfile.TemporaryDirectory() as name:
        for _ in range(_TRIES):
            changes, values, unchanged = make_change(FIRST + number, kind, scale)
            if kind in _WITHOUT_RATIO:
                break
            without = without or _refit_excess(Path(name) / "without", unchanged)
            excess = _refit_excess(Path(name) / "with", values)
            ratio = float(np.sqrt(max(excess**2 - without**2, 0.0)) / without)
            if RATIOS[0] <= ratio <= RATIOS[1]:
                break
            ratios[scale] = ratio
            scale *= float(np.clip(4.0 / max(ratio, 0.5), 0.3, 2.0))
        else:  # the largest of few sizes: a refit may follow a larger one better
            scale = max(ratios, key=lambda size: min(ratios[size], RATIOS[1]))
            ratio, (changes, *_) = ratios[scale], make_change(FIRST + number, kind, scale)
    truth = [vars(each) for each in changes]
    return {"seed": FIRST + number, "kind": kind, "scale": scale, "ratio": ratio, "truth": truth}


def make_change(seed: int, kind: str, scale: float):
    """Return changes, FRFs of the second visit with them, and FRFs of that visit without."""
    freq_hz, frf = read_tower()
    rng = np.random.default_rng(seed)
    changes = draw_change(kind, rng, scale)
    state = rng.bit_generator.state
    values = change_tower(freq_hz, frf, changes, rng)
    rng.bit_generator.state = state
    return changes, values, change_tower(freq_hz, frf, [], rng)


@cache
def _tune_unchanged() -> bytes:
    """Return the MJCF of the drawing tuned to the test before any change."""
    freq_hz, frf = read_tower()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_tower(folder / "before", ASSET / "model.xml", freq_hz, frf)
        _call("tune", folder / "before", "--out", folder / "tuned", "--no-pictures")
        return (folder / "tuned" / "tuned.xml").read_bytes()


def _write_tuned(folder: Path) -> Path:
    """Write the tuned drawing, and return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "tuned.xml"
    file.write_bytes(_tune_unchanged())
    return file


def _refit_excess(folder: Path, values) -> float:
    """Return what stiffness, damping and tolerances leave, over the noise."""
    write_tower(folder, _write_tuned(folder), read_tower()[0], values)
    session = open_session(folder)
    fitted = fit(session.model, session.campaign, parametrisation=session.parametrisation)
    gaps = channel_gaps(predict(session.model, fitted.theta, session.campaign), session.campaign)
    return float(summarise_gaps(gaps).excess)


def _diagnose_one(number: int) -> dict[str, object]:
    """Return drawn change, verdict and grade of one state."""
    return diagnose_case(_find_drawn(number), states=1)


def _diagnose_both(number: int) -> dict[str, object]:
    """Return drawn change, verdict and grade before and after."""
    return diagnose_case(_find_drawn(number), states=2)


def _find_drawn(number: int) -> dict[str, object]:
    """Return the change of a case, from the other number of states if that was diagnosed."""
    for states in STATES:
        if row := of(f"real.{states}").get(number):
            return {name: row[name] for name in ("seed", "kind", "scale", "ratio", "truth")}
    return _draw(number)


def diagnose_case(drawn: dict, states: int) -> dict[str, object]:
    """Return a drawn change with verdict, change of each leg [N/m], seconds and grade."""
    freq_hz, frf = read_tower()
    changes, values, _ = make_change(drawn["seed"], drawn["kind"], drawn["scale"])
    with threadpool_limits(1), tempfile.TemporaryDirectory() as name:
        folder, legs = Path(name), {}
        model = _write_tuned(folder) if states == 1 else ASSET / "model.xml"
        write_tower(folder / "tower", model, freq_hz, values, frf if states == 2 else None)
        target, start = folder / "verdict.json", sum(os.times()[:4])
        _call("diagnose", folder / "tower", "--out", folder / "diagnosed", "--json", target)
        seconds = sum(os.times()[:4]) - start
        verdict = json.loads(target.read_text(encoding="utf-8"))
        if states == 1:
            legs = _find_leg_changes(model, folder / "diagnosed" / "augmented.xml")
    return {
        **drawn,
        "verdict": verdict,
        "legs": legs,
        "seconds": seconds,
        **grade(changes, verdict, legs),
    }


def _call(*words: object) -> None:
    """Run the command; "not converged" leaves results, too."""
    command = [sys.executable, "-m", "mbw", *map(str, words), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 4):
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")


def _find_leg_changes(before: Path, after: Path) -> dict[str, float]:
    """Return the stiffness of each leg in an MJCF less that in another [N/m]."""
    legs = [
        {spring.name: spring.stiffness for spring in load_machine(file).springs}
        for file in (before, after)
    ]
    return {name: legs[1].get(name, 0.0) - value for name, value in legs[0].items()}


def grade(
    changes: list[TowerChange], verdict: dict, legs: dict[str, float]
) -> dict[str, bool | None]:
    """Return whether all changes and nothing else are named, and whether their sizes are right.

    Args:
        changes: what was drawn.
        verdict: verdict.json.
        legs: change of the stiffness of each leg in the tuned parameters [N/m]; empty where states
            make it a cause.
    """
    named = {
        (cause["effect"], cause["location"]): cause["parameters"]
        for cause in verdict["causes"]
        if (cause["probability"] or 0.0) >= _NAMED
    }
    matches = [_find_named(change, named, legs) for change in changes]
    true = {key for keys, _ in matches for key in keys}
    wrong = bool(set(named) - true)
    right = all(sizes is not None for _, sizes in matches) and not wrong
    errors = [
        _is_near(change, name, sizes or {})
        for change, (_, sizes) in zip(changes, matches, strict=True)
        for name in (_list_sizes(change) if sizes != {} else ())
    ]
    return {"right": right, "wrong": wrong, "sizes": all(errors) if right and errors else None}


def _find_named(
    change: TowerChange, named: dict, legs: dict
) -> tuple[list[tuple[str, str]], dict | None]:
    """Return the names under which a change is true, and the sizes named; None if it is not."""
    keys = [(change.effect, change.location)]
    is_common = change.location == "hammer:default"
    if is_common:  # there is one force channel, whatever its place is called
        keys = [key for key in named if key[0] == change.effect]
    if keys and keys[0] in named:
        return keys, named[keys[0]]
    if change.effect == "stiffness" and legs:
        leg = legs[f"leg{change.location[-1]}"]
        is_leg = abs(leg - change.sizes["stiffness"]) <= abs(change.sizes["stiffness"]) / 4
        return [], {"change": leg} if is_leg else None
    floors = [("mass_error", f"body:floor{number}") for number in (1, 2, 3)]
    if is_common and all(floor in named for floor in floors):
        return floors, {}
    return [], None


def _list_sizes(change: TowerChange) -> list[str]:
    """Return the sizes of a change that are graded: an appendage by mass and frequency."""
    names = [name for name in _GRADED if abs(change.sizes.get(name, 0.0)) > 0]
    if change.effect == "appendage":
        names.remove("damping")
    if change.effect == "parallel_path" and "damping" in names:
        names.remove("stiffness")  # a damper has a spring of 1 N/m
    return names


def _is_near(change: TowerChange, name: str, sizes: dict) -> bool:
    """Return whether a size is within 10 %; of links, that along x."""
    true, fitted = change.sizes[name], sizes.get(name, sizes.get("change"))
    if isinstance(fitted, list):
        fitted = fitted[0]
    if fitted is None:
        return False
    if name == "gain":  # by the distance from one, to which a remount adds
        return abs(float(fitted) - true) <= max(_SIZE_ERROR * abs(true - 1), 2 * GAIN_SD)
    return abs(float(fitted) - true) <= _SIZE_ERROR * abs(true)
