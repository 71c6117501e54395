"""Ratios of gains and differences of delays by reciprocity, on computed changes of the tower.

Each case draws a change of the machine, of one channel, or nothing, and a second visit with gains
and delays of its own (``truth/campaign/changed_tower.py``). Reciprocity then says gains and delays
relative to those of the unchanged test, whose channels are not ideal: they differ by 1 % and 0.1 ms
among themselves. Seeds 480000 and up, none of which tuned anything.
"""

import copy
import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np

from identification import check_reciprocity
from truth.campaign.changed_tower import (
    ASSET,
    change_tower,
    draw_change,
    draw_visit,
    read_tower,
    write_tower,
)
from tuning import open_session

CASES, FIRST = 50, 480_000
KINDS = ("mass", "link", "appendage", "damper", "leg", "nothing", "gain", "delay")
FAULTS = {"gain": "sensor_gain", "delay": "sensor_delay"}


def run() -> list[dict[str, object]]:
    """Return how often ratios lie within two deviations, and how often a fault is named."""
    cases = [draw_case(number) for number in range(CASES)]
    rows = []
    for name in FAULTS:
        errors = np.concatenate([case[name] for case in cases])
        rows.append(
            {
                "of": name,
                "n": len(errors),
                "within 2 deviations %": 100 * np.mean(np.abs(errors) < 2),
                "changes of one": sum(case["kind"] == name for case in cases),
                "named right": sum(case["right"] for case in cases if case["kind"] == name),
                "other changes": sum(case["kind"] not in FAULTS for case in cases),
                "named though none": sum(
                    bool(case["named"]) for case in cases if case["kind"] not in FAULTS
                ),
            }
        )
    return rows


def draw_case(number: int) -> dict:
    """Return errors over deviations of each pair of references, and the faults that are named."""
    kind = KINDS[number % len(KINDS)]
    rng = np.random.default_rng(FIRST + number)
    changes = draw_change(kind, rng)
    visit = draw_visit(copy.deepcopy(rng))
    freq_hz, frf = read_tower()
    _, before = _check(freq_hz, frf)
    campaign, after = _check(freq_hz, change_tower(freq_hz, frf, changes, rng))
    true = {"gain": np.log(visit.gains / visit.hits), "delay": visit.late.copy()}
    for change in changes:
        if kind in FAULTS:
            size = change.sizes[kind]
            true[kind][int(change.location[-1]) - 1] += np.log(size) if kind == "gain" else size
    named = {(fault.effect, fault.location) for fault in after.faults(campaign)}
    return {
        "kind": kind,
        "named": named,
        "right": named == {(change.effect, change.location) for change in changes},
        **{name: _errors(after.rows, before.rows, true[name], name) for name in FAULTS},
    }


def _check(freq_hz, values):
    """Return campaign and reciprocity of FRFs of the tower."""
    with tempfile.TemporaryDirectory() as name:
        write_tower(Path(name) / "test", ASSET / "model.xml", freq_hz, values)
        campaign = open_session(Path(name) / "test").campaign
    return campaign, check_reciprocity(campaign)


def _errors(rows, before, true, name: str):
    """Return the error of each pair's ratio or difference over its deviation; (3,)."""
    estimates = [[_size(row, name) for row in each] for each in (rows, before)]
    values = np.array([now[0] - then[0] for now, then in zip(*estimates, strict=True)])
    deviations = np.array([deviation for _, deviation in estimates[0]])
    return np.array(
        [
            (values[i] - values[j] - true[i] + true[j]) / np.hypot(deviations[i], deviations[j])
            for i, j in combinations(range(len(rows)), 2)
        ]
    )


def _size(row, name: str) -> tuple[float, float]:
    """Return ln gain or delay, and its deviation."""
    if name == "gain":
        return float(np.log(abs(row.gain))), row.gain_sd / abs(row.gain)
    return row.delay, row.delay_sd
