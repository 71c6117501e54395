"""Blind tests on machines of every kind: legs, files that the workbench wrote, gantry, servo axis.

Each case is one of ``mbw blind MODEL --effect EFFECT --ratio 4 --seed 447000``: drawn, diagnosed
and graded. The machines take turns, and each has the effects in one order, so that any first part
is balanced. ``tuned.xml`` and ``augmented.xml`` are made by ``mbw tune`` and ``mbw diagnose`` of
the two-body campaign.

Rows that are done are kept. In the environment: ``LIMIT=40`` for the first forty, ``JOBS=1`` for
the number of processes.
"""

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from typer.testing import CliRunner

from mbw.blind.case import run_case
from mbw.blind.case_files import BlindCase
from mbw.blind.grading import graded_case
from mbw.blind.request import build_request, prepare_folder
from mbw.command import app
from tests.bench.kept import cases, of
from tests.helpers.any_machines import GANTRY, SERVO_AXIS
from truth import Choice
from truth.campaign.case_design import deal_cards
from truth.grade import grade
from truth.grade.rates import wilson

NAME, SEED, RATIO = "machine_kinds", 447_000, 4.0
ASSETS = Path(__file__).resolve().parents[2] / "assets"
MACHINES = ("servo axis", "gantry", "tuned.xml", "augmented.xml", "station_legs.xml")
NOTHING = "nothing"
EFFECTS = (
    "mass_error",
    NOTHING,
    "joint_coupling",
    "sensor_misalignment",
    "structural_damping",
    "missing_dof",
    "hammer_misalignment",
    "appendage",
    "sensor_gain",
    "feedback_delay",
    "friction",
    "flexible_body",
    NOTHING,
    "parallel_path",
    "viscoelastic",
    "sensor_swap",
    "gyroscopic",
    "support_loss",
    "hardening",
    "sensor_delay",
    "drift",
    "hammer_position",
    "backlash",
    "sensor_polarity",
    "mount_resonance",
    "sensor_position",
    "hammer_delay",
    "hammer_gain",
)
MARKS = ("both_or_twin", "place_first", "where_first", "false_alarm")


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the rates of each machine."""
    count = len(MACHINES) * len(EFFECTS)
    limit = int(os.environ.get("LIMIT", count))
    cases(NAME, range(min(limit, count)), _case, int(os.environ.get("JOBS", "1")))
    rows = list(of(NAME).values())
    return [_rates(machine, rows) for machine in (*MACHINES, "all")]


def _case(number: int) -> dict[str, object]:
    """Return the grades of one case."""
    machine, effect = MACHINES[number % len(MACHINES)], EFFECTS[number // len(MACHINES)]
    repeated = EFFECTS[: number // len(MACHINES)].count(effect)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "blind"
        out.mkdir()
        model = str(_make_model(machine, Path(folder)))
        choice = Choice((EFFECTS[0] if effect == NOTHING else effect,), ratios=(RATIO,))
        fitting = (
            k
            for k, card in enumerate(deal_cards(SEED, choice))
            if (card.kind == NOTHING) == (effect == NOTHING)
        )
        for _ in range(repeated):
            next(fitting)
        case = BlindCase(model, SEED, next(fitting), out, None, choice)
        prepare_folder(build_request(model, SEED, None, choice=choice), out, overwrite=False)
        start = time.process_time()
        outcome = run_case(case)
        row: dict[str, object] = {"machine": machine, "effect": effect, "case": case.number}
        if outcome.error:
            return {**row, "failed": outcome.error, "refused": outcome.is_refused}
        seconds = time.process_time() - start
        (line,) = grade([graded_case(case)], baselines=False).lines
    marks = {name: line.marks[name] for name in MARKS}
    return {
        **row,
        "places": list(line.places),
        "verdict": line.verdict,
        "first": line.first,
        "where": line.where,
        **marks,
        "core s": seconds,
    }


def _make_model(machine: str, folder: Path) -> Path:
    """Return the MJCF of a machine, made where it is none of the assets."""
    if machine == "station_legs.xml":
        return ASSETS / "microstation" / machine
    if machine in ("gantry", "servo axis"):
        path = folder / "machine.xml"
        path.write_text(GANTRY if machine == "gantry" else SERVO_AXIS, encoding="utf-8")
        return path
    verb = "tune" if machine == "tuned.xml" else "diagnose"
    out = folder / verb
    command = [verb, str(ASSETS / "two_bodies"), "--out", str(out), "--quiet"]
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    if result.exit_code:
        raise RuntimeError(f"mbw {' '.join(command)} ended with {result.exit_code}")
    return out / machine


def _rates(machine: str, rows: Sequence[dict]) -> dict[str, object]:
    """Return how often the cause, its place and its absence are found, with Wilson intervals."""
    machine_rows = [row for row in rows if machine in (row["machine"], "all")]
    drawn = [row for row in machine_rows if "failed" not in row]
    rates: dict[str, object] = {"machine": machine, "cases": len(drawn)}
    for name in MARKS:
        of_effects = name != "false_alarm"
        marks = [row[name] for row in drawn if (row["effect"] != NOTHING) == of_effects]
        graded_marks = [mark for mark in marks if mark is not None]
        low, high = (
            wilson(round(sum(graded_marks)), len(graded_marks)) if graded_marks else (0.0, 1.0)
        )
        rates |= {name: round(sum(graded_marks)), f"{name} of": len(graded_marks)}
        rates |= {f"{name} from": low, f"{name} to": high}
    rates["no place"] = sum("failed" in row for row in machine_rows)
    rates["core s"] = sum(row["core s"] for row in drawn) / max(len(drawn), 1)
    return rates
