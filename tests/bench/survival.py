"""The survival ratio of the linearised refit against full refits by ``tuning``: 40 cases.

Stiffness and damping alone are free in both, and no tolerance is at work, since ``tuning`` does
not fit tolerances yet. Seeds 62000 and up.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from truth import Cause, Plan, Wanted, draw_campaign, read_station, write_campaign
from truth.deck import RATIOS
from truth.draw import NO_TOLERANCE
from tuning import open_session, tune

STATION = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
CASES, JOBS, FIRST = 40, 2, 62_000
EFFECTS = (
    "mass_error",
    "appendage",
    "gyroscopic",
    "joint_coupling",
    "structural_damping",
    "viscoelastic",
    "parallel_path",
    "sensor_gain",
    "sensor_misalignment",
    "drift",
)


def run() -> list[dict[str, object]]:
    """Ratio that was wanted, ratio that full refits find."""
    rows = Parallel(n_jobs=JOBS)(
        delayed(_case)(
            EFFECTS[number % len(EFFECTS)], RATIOS[number // len(EFFECTS)], FIRST + number
        )
        for number in range(CASES)
    )
    off = np.array([abs(np.log(row["full refit"] / row["linearised"])) for row in rows])
    whole = {
        "effect": "median of |log(full / linearised)|",
        "wanted": "",
        "linearised": float(np.median(off)),
        "full refit": float(np.quantile(off, 0.9)),
        "e0": "90 % quantile beside",
    }
    return [*rows, whole]


def _case(effect: str, ratio: float, seed: int) -> dict[str, object]:
    with threadpool_limits(1):
        station = read_station(STATION)
        plan = Plan(seed, Cause((Wanted(effect, None, ratio),)), tolerance=NO_TOLERANCE)
        excess = []
        with TemporaryDirectory() as folder:
            for name, own in (("with", plan), ("without", replace(plan, cause=Cause()))):
                campaign = draw_campaign(station, own)
                if name == "with":
                    (line,) = [
                        one
                        for one in campaign.answer.decode().splitlines()
                        if one.startswith("ratio")
                    ][:1]
                write_campaign(campaign, Path(folder) / name)
                tuned = tune(open_session(Path(folder) / name))
                excess.append(tuned.sensors.gap(tuned.sensors.tuned).excess)
        e1, e0 = excess
        return {
            "effect": effect,
            "wanted": ratio,
            "linearised": float(line.split()[2]),
            "full refit": float(np.sqrt(max(e1**2 - e0**2, 1e-6)) / e0),
            "e0": e0,
        }
