"""NLopt beside Gauss-Newton from five starts: evaluations, core seconds, and the minimum of both.

Two cases: the demo campaign, whose tolerances vary in the last stages, and synthetic data of which
stiffness and damping alone vary. Both algorithms go in turn from the same starts. The seeds are
reported only.
"""

import time
from dataclasses import dataclass

import numpy as np
from rich.progress import track

from identification.words import Campaign
from mbmodel import Model, load_machine
from tests.bench.starts import STATION
from tests.helpers.tuning_case import tuning_case
from tuning import (
    GAUSS_NEWTON,
    TUNING_ALGORITHM,
    Parametrisation,
    fit,
    open_session,
    parametrise,
    random_starts,
)

SEED = 66000
STARTS = 5
DEMO = STATION.parents[1] / "demo"


@dataclass(frozen=True, eq=False)
class Case:
    """A model, its measurement and starts."""

    name: str
    model: Model
    campaign: Campaign
    parametrisation: Parametrisation
    starts: tuple[np.ndarray, ...]


def run() -> list[dict[str, object]]:
    """The nominal model and five random starts of the demo; five of the synthetic data."""
    cases = [_demo(), _synthetic()]
    work = [(case, number) for case in cases for number in range(len(case.starts))]
    return [_row(case, number) for case, number in track(work, description="nlopt_starts")]


def _demo() -> Case:
    session = open_session(DEMO)
    starts = random_starts(session.model, STARTS + 1, SEED, parametrisation=session.parametrisation)
    return Case("demo", session.model, session.campaign, session.parametrisation, starts)


def _synthetic() -> Case:
    case = tuning_case(load_machine(STATION), SEED)
    varies = parametrise(case.model, case.campaign.tolerance)
    starts = tuple(case.start(seed) for seed in range(SEED, SEED + STARTS))
    return Case("stiffness and damping alone", case.model, case.campaign, varies, starts)


def _row(case: Case, number: int) -> dict[str, object]:
    """Both algorithms from one start."""
    (newton, newton_s), (nlopt, nlopt_s) = (
        _timed_fit(case, number, algorithm) for algorithm in (GAUSS_NEWTON, TUNING_ALGORITHM)
    )
    is_nominal = case.name == "demo" and number == 0
    return {
        "case": case.name,
        "start": "nominal" if is_nominal else f"random {number + (case.name != 'demo')}",
        "evaluations Gauss-Newton": newton.evaluations,
        "evaluations NLopt": nlopt.evaluations,
        "core s Gauss-Newton": newton_s,
        "core s NLopt": nlopt_s,
        "cost Gauss-Newton": newton.cost,
        "cost NLopt / Gauss-Newton - 1": nlopt.cost / newton.cost - 1,
        "both converged": newton.converged and nlopt.converged,
    }


def _timed_fit(case: Case, number: int, algorithm: str):  # type: ignore[no-untyped-def]
    start = time.process_time()
    result = fit(
        case.model,
        case.campaign,
        parametrisation=case.parametrisation,
        starts=(case.starts[number],),
        algorithm=algorithm,
    )
    return result, time.process_time() - start
