"""Is the true effect first when everything is fitted at the error that the model really has?

The null model is fitted at its own error floor, all hypotheses are scored once about that fit, and
the best of each effect and place are refitted, each to its own floor. Machines are the station's
with real instruments and small imperfections that leave 0, 5 and 15 % of the motion after a refit.
Nothing is calibrated and nothing judged: the ranks of the truth show whether a diagnosis can be
built on this. Seeds 340000 and up; cases that are done are kept.
"""

import tempfile
import time
import tomllib
from itertools import product
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from diagnosis.effects import load_catalogue
from diagnosis.hypothesis import Scene
from diagnosis.refits.refitting import add_hypothesis, find_start
from diagnosis.search.score_test import scores
from diagnosis.settings import SETTINGS
from tests.bench.kept import cases
from truth import Cause, Plan, Protocol, TruthError, Wanted, draw_campaign, read_station
from truth.campaign.draw import REAL_INSTRUMENTS
from truth.campaign.folder import write_campaign
from truth.grade.rates import wilson
from tuning import fit_at_error_floor, open_session

FIRST, EACH = 340_000, 1
EFFECTS = (
    "mass_error",
    "appendage",
    "gyroscopic",
    "joint_coupling",
    "structural_damping",
    "viscoelastic",
    "feedback_delay",
    "support_loss",
    "parallel_path",
    "sensor_gain",
    "sensor_misalignment",
    "none",
)
DIRT = (0.0, 5.0, 15.0)
RATIO = 2.0
_DESIGNS = tuple(product(range(EACH), DIRT, EFFECTS))
_REFITTED = 12  # hypotheses, the best of each effect and place
_NAMED_RATIO = 1.0  # survival ratio below which an effect is no larger than what hides it
_STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"


def run() -> list[dict[str, object]]:
    """Draw, fit and rank; return the rates of each amount of dirt."""
    rows, _ = cases("error_floor", range(len(_DESIGNS)), _case, jobs=2)
    return [row for dirt in DIRT for row in _rates(dirt, rows)]


def _case(number: int) -> dict[str, object]:
    _, dirt, effect = _DESIGNS[number]
    wanted = () if effect == "none" else (Wanted(effect, None, RATIO),)
    protocol = Protocol((11,), (200.0,), 10)
    plan = Plan(FIRST + number, Cause(wanted), protocol, REAL_INSTRUMENTS, dirt=dirt)
    with tempfile.TemporaryDirectory() as scratch, threadpool_limits(1):
        folder = Path(scratch) / "campaign"
        try:
            write_campaign(draw_campaign(read_station(_STATION), plan), folder)
        except TruthError as error:
            return {"dirt": dirt, "effect": effect, "failed": str(error)}
        answer = tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
        began = time.process_time()
        row = _ranks(folder, (answer["effect"], answer.get("location")))
        row["core_s"] = time.process_time() - began
    items = answer.get("dirt", {}).get("item", [])
    background = [f"{item['effect']}@{item['location']}" for item in items]
    row["first_is_in_background"] = row["first"] in background
    return {"dirt": dirt, "effect": effect, "ratio": answer.get("ratio"), **row}


def _ranks(folder: Path, truth: tuple[str, str | None]) -> dict[str, object]:
    session = open_session(folder)
    null = fit_at_error_floor(session.model, session.campaign, session.parametrisation)
    scene = Scene(session, null.fit.theta)
    proposals = [one for effect in load_catalogue().values() for one in effect(scene)]
    ranked = scores(scene, null.fit, proposals, null.error.floor, SETTINGS.score_stride)
    best = {}
    for score in ranked:
        best.setdefault((score.hypothesis.effect, score.hypothesis.location), score.hypothesis)
    costs = {}
    for site, hypothesis in list(best.items())[:_REFITTED]:
        inner = add_hypothesis(session, hypothesis)
        refit = fit_at_error_floor(
            inner.model,
            inner.campaign,
            inner.parametrisation,
            start=find_start(scene, inner, hypothesis),
            floor=null.error.floor,
        )
        costs[site] = refit.error
    order = sorted(costs, key=lambda site: costs[site].cost)
    return {
        "null_floor": null.error.floor,
        "first": "@".join(map(str, order[0])),
        "first_floor": costs[order[0]].floor,
        "rank_by_score": list(best).index(truth) if truth in best else None,
        "rank_by_refit": order.index(truth) if truth in order else None,
    }


def _rates(dirt: float, rows: list[dict]) -> list[dict[str, object]]:
    here = [row for row in rows if row["dirt"] == dirt and "failed" not in row]
    found = []
    seen = [r for r in here if r["effect"] != "none" and (r["ratio"] or 0.0) >= _NAMED_RATIO]
    for key, name in (("rank_by_score", "by one score"), ("rank_by_refit", "after refits")):
        right = sum(row[key] == 0 for row in seen)
        low, high = wilson(right, len(seen)) if seen else (0.0, 1.0)
        found.append(
            {
                "figure": f"dirt {dirt:g} %: effect and place first {name}, %",
                "value": 100 * right / max(len(seen), 1),
                "n": f"{len(seen)} [{100 * low:.0f}, {100 * high:.0f}]",
            }
        )
    falls = [row["first_floor"] / row["null_floor"] for row in seen if row["rank_by_refit"] == 0]
    alone = [row["first_floor"] / row["null_floor"] for row in here if row["effect"] == "none"]
    for name, values in (("true effect", falls), ("best one where nothing is missing", alone)):
        if values:
            figure = f"dirt {dirt:g} %: floor with the {name} over the null model's, median"
            found.append({"figure": figure, "value": float(np.median(values)), "n": len(values)})
    if here:
        seconds = [row["core_s"] for row in here]
        figure = f"dirt {dirt:g} %: core seconds, median"
        found.append({"figure": figure, "value": float(np.median(seconds)), "n": len(seconds)})
    return found
