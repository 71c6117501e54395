"""The diagnosis on withheld truth: 325 campaigns of the station, drawn, diagnosed and graded.

100 have nothing missing, 60 are mis-tuned only, the others one effect each, at survival ratios 2,
4 and 8. ``ONLY=diagnosis`` makes the reported campaigns, seeds 100000 and up. ``ONLY=calibrate``
makes others, seeds 80000 and up, and fits the judgement's constants to them, which it writes to
``diagnosis/calibration.json``. Cases that are done are kept: both go on from where they were.
"""

import json
import time
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from diagnosis import diagnose, verdict_of
from tests.bench.kept import cases
from truth import (
    Cause,
    Plan,
    Wanted,
    draw_campaign,
    draw_protocol,
    read_station,
    write_answer,
    write_campaign,
)
from truth.errors import NoPlaceError
from truth.grade import Case, grade, tables, to_json
from tuning import open_session

STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
RESULTS = Path(__file__).parent / "results"
WORK = Path(__file__).parent / "work"
CASES, FIRST, JOBS = 325, 100_000, 2
MEASUREMENT = (
    "drift",
    "hammer_misalignment",
    "mount_resonance",
    "sensor_delay",
    "sensor_gain",
    "sensor_misalignment",
    "sensor_polarity",
    "sensor_position",
    "sensor_swap",
)
MACHINE = (
    "appendage",
    "backlash",
    "feedback_delay",
    "flexible_body",
    "friction",
    "gyroscopic",
    "hardening",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "parallel_path",
    "structural_damping",
    "support_loss",
    "viscoelastic",
)
RATIOS = (2.0, 4.0, 8.0)
RIGID = 2  # directions of every machine that are rigid, for one of them may be what is missing


def deck() -> list[tuple[str, str, float]]:
    """Kind, effect and ratio of every case, so mixed that any first part holds some of all."""
    single = [("one", name, ratio) for ratio in RATIOS for name in MEASUREMENT] * 3
    single += [("one", name, ratio) for ratio in RATIOS for name in MACHINE] * 2
    order = np.random.default_rng(5).permutation(len(single))
    piles = [
        [("nothing", "none", 0.0)] * 100,
        [("mistuned", "none", 0.0)] * 60,
        [single[k] for k in order],
    ]
    mixed = [
        (place / len(pile), n, card)
        for n, pile in enumerate(piles)
        for place, card in enumerate(pile)
    ]
    return [card for _, _, card in sorted(mixed, key=lambda one: one[:2])]


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade the reported campaigns."""
    rows, _ = cases("diagnosis", range(CASES), partial(case, FIRST), JOBS)
    return graded(rows, "diagnosis")


def case(first: int, number: int) -> dict[str, object]:
    """Draw and diagnose one case.

    Args:
        first: seed of case 0.
        number: of the case.
    """
    place = WORK / f"{first + number}"
    with threadpool_limits(1):
        drawn = ensure(first, number)
        if drawn is None:
            return {"seed": first + number, "card": deck()[number], "verdict": None}
        begun = time.process_time()
        try:
            found = diagnose(open_session(place))
        except Exception as error:  # a failure is graded as one, the other cases go on
            said = f"{type(error).__name__}: {error}"
            return {"seed": first + number, "card": deck()[number], "answer": drawn, "error": said}
        seconds = time.process_time() - begun
    return {
        "seed": first + number,
        "card": deck()[number],
        "seconds": seconds,
        "evidence": found.evidence.model_dump(mode="json", exclude={"scored"}),  # judged without
        "verdict": verdict_of(found).model_dump(mode="json"),
        "answer": drawn,
    }


def ensure(first: int, number: int) -> str | None:
    """Draw a case unless it is there; its answer, None if the machine has no place for it."""
    kind, effect, ratio = deck()[number]
    seed = first + number
    place, answer = WORK / f"{seed}", WORK / f"{seed}.toml"
    if not answer.is_file():
        station = read_station(STATION)
        wanted = () if kind != "one" else (Wanted(effect, None, ratio),)
        cause = Cause(wanted, mistuned=kind == "mistuned", kind=kind)
        try:
            drawn = draw_campaign(
                station, Plan(seed, cause, draw_protocol(station, seed), rigid=RIGID)
            )
        except NoPlaceError:
            return None
        write_campaign(drawn, place, overwrite=True, sealed=True)
        write_answer(drawn, answer)
    return answer.read_text("utf-8")


def graded(rows: list[dict], name: str) -> list[dict[str, object]]:
    """Grade kept verdicts beside the baselines; grades and tables lie among the results."""
    given = []
    for row in rows:
        if "error" not in row and row["verdict"] is None:  # the machine has no place for it
            continue
        seed = row["seed"]
        ensure(seed - seed % 5_000, seed % 5_000)
        verdict, refit = WORK / f"{seed}.verdict.json", WORK / f"{seed}.refit.json"
        verdict.unlink(missing_ok=True)
        if "error" not in row:
            verdict.write_text(json.dumps(row["verdict"]), encoding="utf-8")
            excess = row["verdict"]["gap"]["retuned"]["excess"]
            refit.write_text(json.dumps({"excess": excess}), encoding="utf-8")
        kind = row["card"][0]
        kind = "measurement" if row["card"][1] in MEASUREMENT else kind
        given.append(
            Case(str(seed), WORK / f"{seed}", verdict, WORK / f"{seed}.toml", refit, tags=(kind,))
        )
    report = grade(given)
    (RESULTS / f"{name}.grades.json").write_text(to_json(report) + "\n", encoding="utf-8")
    (RESULTS / f"{name}.txt").write_text(tables(report), encoding="utf-8")
    seconds = np.array([row["seconds"] for row in rows if "seconds" in row])
    found: list[dict[str, object]] = [
        {"figure": "core seconds, median", "value": float(np.median(seconds)), "n": len(seconds)},
        {"figure": "core seconds, 95 %", "value": float(np.quantile(seconds, 0.95)), "n": ""},
    ]
    return found
