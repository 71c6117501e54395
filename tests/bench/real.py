"""Computed changes of one measured machine: the tower, against its drawing tuned before the change.

Each case draws a change (``tests/helpers/changed_tower.py``), makes it in the measured matrix, and
diagnoses the result against the tower tuned to the unchanged test. Where a change has a size, it is
one that a refit leaves at 2 to 8 times what it leaves without it: sqrt(e1^2 - e0^2) / e0.

A cause counts as named with a probability of one half. It is right with effect and place of the
truth, wrong otherwise. A leg is right if its stiffness differs from the tuned one by the drawn
change within a quarter, and no cause is named; so is a common gain if it is named.

Seeds 470000 and up, none of which tuned anything. Rows that are done are kept: ``LIMIT=24`` for the
first 24, ``JOBS=1`` for the number of processes.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from mbmodel import load_machine
from tests.bench.kept import cases, of
from tests.helpers.changed_tower import (
    ASSET,
    KINDS,
    change_tower,
    draw_change,
    read_tower,
    write_tower,
)
from truth.grade.rates import wilson
from tuning import channel_gaps, fit, open_session, predict, summarise_gaps

CASES, FIRST = 216, 470_000
RATIOS = (2.0, 8.0)
_TRIES = 8  # of sizes
_NAMED = 0.5  # probability
_LEG_ERROR = 0.25  # of the drawn change of stiffness
_SIZELESS = ("sign", "exchange", "nothing")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the rates of each kind of change.

    ``results/real_before.cases.jsonl`` has the same cases by the engine that knew no reciprocity.
    """
    limit = int(os.environ.get("LIMIT", CASES))
    cases("real", range(min(limit, CASES)), _case, int(os.environ.get("JOBS", "1")))
    rows = []
    for engine, name in (("before", "real_before"), ("now", "real")):
        kept = list(of(name).values())
        for kind in (*KINDS, "all"):
            chosen = [row for row in kept if kind in (row["kind"], "all")]
            rows.append({"engine": engine, **_rates(kind, chosen)})
    return rows


def _rates(kind: str, rows: list[dict]) -> dict[str, object]:
    """Return how many are named right and wrong, each with its 95 % interval."""
    counts = {name: sum(row[name] for row in rows) for name in ("right", "wrong")}
    intervals = {name: wilson(count, max(len(rows), 1)) for name, count in counts.items()}
    return {
        "change": kind,
        "n": len(rows),
        **counts,
        **{f"{name} from": 100 * ends[0] for name, ends in intervals.items()},
        **{f"{name} to": 100 * ends[1] for name, ends in intervals.items()},
    }


def _case(number: int) -> dict[str, object]:
    """Return drawn change, verdict and grade of one case."""
    kind = KINDS[number % len(KINDS)]
    with threadpool_limits(1), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = _tune_unchanged(folder)
        freq_hz, _ = read_tower()
        changes, values, ratio = _draw(number, kind, folder, model)
        write_tower(folder / "changed", model, freq_hz, values)
        start = sum(os.times()[:4])
        verdict = _diagnose(folder)
        change = _leg_changes(folder, model)
    return {
        "seed": FIRST + number,
        "kind": kind,
        "truth": [vars(each) for each in changes],
        "ratio": ratio,
        "verdict": verdict,
        "legs": change,
        "seconds": sum(os.times()[:4]) - start,
        **_grade(kind, changes, verdict, change),
    }


def _tune_unchanged(folder: Path) -> Path:
    """Return the drawing tuned to the test before any change."""
    freq_hz, frf = read_tower()
    write_tower(folder / "before", ASSET / "model.xml", freq_hz, frf)
    _call("tune", folder / "before", "--out", folder / "tuned", "--no-pictures")
    return folder / "tuned" / "tuned.xml"


def _draw(number: int, kind: str, folder: Path, model: Path):
    """Return changes, FRFs and survival ratio; sizes are drawn until the ratio is between both."""
    freq_hz, frf = read_tower()
    ratio, scale = None, 1.0
    for _ in range(_TRIES):
        rng = np.random.default_rng(FIRST + number)
        changes = draw_change(kind, rng, scale)
        state = rng.bit_generator.state
        values = change_tower(freq_hz, frf, changes, rng)
        if kind in _SIZELESS:
            break
        rng.bit_generator.state = state
        without = _refit_excess(folder / "without", model, change_tower(freq_hz, frf, [], rng))
        excess = _refit_excess(folder / "with", model, values)
        ratio = float(np.sqrt(max(excess**2 - without**2, 0.0)) / without)
        if RATIOS[0] <= ratio <= RATIOS[1]:
            break
        scale *= float(np.clip(4.0 / max(ratio, 0.5), 0.3, 2.0))
    return changes, values, ratio


def _refit_excess(folder: Path, model: Path, values) -> float:
    """Return what stiffness, damping and tolerances leave, over the noise."""
    freq_hz, _ = read_tower()
    write_tower(folder, model, freq_hz, values)
    session = open_session(folder)
    fitted = fit(session.model, session.campaign, parametrisation=session.parametrisation)
    gaps = channel_gaps(predict(session.model, fitted.theta, session.campaign), session.campaign)
    return float(summarise_gaps(gaps).excess)


def _diagnose(folder: Path) -> dict[str, object]:
    """Return the verdict on the changed tower."""
    target = folder / "verdict.json"
    _call("diagnose", folder / "changed", "--out", folder / "diagnosed", "--json", target)
    return json.loads(target.read_text(encoding="utf-8"))


def _call(*words: object) -> None:
    """Run the command; its exit codes below 2 leave results."""
    command = [sys.executable, "-m", "mbw", *map(str, words), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")


def _leg_changes(folder: Path, model: Path) -> dict[str, float]:
    """Return the stiffness of each leg in augmented.xml less that before the change [N/m]."""
    files = model, folder / "diagnosed" / "augmented.xml"
    legs = [
        {spring.name: spring.stiffness for spring in load_machine(file).springs} for file in files
    ]
    return {name: legs[1].get(name, 0.0) - value for name, value in legs[0].items()}


def _grade(kind: str, changes, verdict: dict, legs: dict[str, float]) -> dict[str, bool]:
    """Return whether a true cause is named, and whether a wrong one is."""
    named = {
        (cause["effect"], cause["location"])
        for cause in verdict["causes"]
        if (cause["probability"] or 0.0) >= _NAMED
    }
    true = {(change.effect, change.location) for change in changes}
    wrong = bool(named - true)
    if kind == "leg":
        ((_, place),), size = true, changes[0].sizes["stiffness"]
        error = abs(legs[place.partition(":")[2]] - size)
        return {"right": error <= _LEG_ERROR * abs(size) and not wrong, "wrong": wrong}
    if kind == "nothing":
        return {"right": not named, "wrong": wrong}
    return {"right": true <= named, "wrong": wrong}
