"""The survival ratio of the linearised refit against full refits by ``tuning``: 40 cases.

Both vary stiffness, damping and every tolerance within 2.5 of its standard deviations. Seeds 62000
and up; cases that are done are kept, an interrupted bench goes on from where it was.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from tests.bench.kept import cases
from truth import Cause, Plan, Wanted, draw_campaign, read_station, write_campaign
from truth.campaign.case_design import RATIOS
from tuning import channel_gaps, fit, open_session, predict, summarise_gaps

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
    rows, kept = cases("survival", range(CASES), _case, JOBS)
    kept.unlink()
    off = np.array([abs(np.log(row["full refit"] / row["linearised"])) for row in rows])
    whole = {
        "effect": "median of |log(full / linearised)|",
        "wanted": "",
        "linearised": float(np.median(off)),
        "full refit": float(np.quantile(off, 0.9)),
        "e0": "90 % quantile beside",
    }
    return [*rows, whole]


def _case(number: int) -> dict[str, object]:
    effect, ratio = EFFECTS[number % len(EFFECTS)], RATIOS[number // len(EFFECTS)]
    seed = FIRST + number
    with threadpool_limits(1):
        station = read_station(STATION)
        plan = Plan(seed, Cause((Wanted(effect, None, ratio),)))
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
                session = open_session(Path(folder) / name)
                model, tests = session.model, session.campaign
                found = fit(model, tests, parametrisation=session.parametrisation)
                gaps = channel_gaps(predict(model, found.theta, tests), tests)
                excess.append(summarise_gaps(gaps).excess)
        e1, e0 = excess
        return {
            "effect": effect,
            "wanted": ratio,
            "linearised": float(line.split()[2]),
            "full refit": float(np.sqrt(max(e1**2 - e0**2, 1e-6)) / e0),
            "e0": e0,
        }
