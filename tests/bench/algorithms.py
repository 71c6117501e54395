"""Which algorithm and which residual should open a tuning, in which coordinates, and which end it.

Synthetic data of 1 % noise, starts exp(N(0, 0.5)) off. The seeds are reported only.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
from rich.progress import track

from mbmodel import load_machine
from tests.bench.starts import NEAR, STATION
from tests.helpers.tuning_case import TuningCase, tuning_case
from tuning import GAUSS_NEWTON, STAGES, Misfit, Parametrisation, Stage, fit, parametrise
from tuning.fitting.stage_search import thin_lines
from tuning.solvers.nlopt_solver import minimise

SEED = 65000
STARTS = 5
OPENING = tuple(stage for stage in STAGES if not stage.tolerances_vary)
FINISH = STAGES[len(OPENING) :]
NAMED = (
    "LD_LBFGS",
    "LD_SLSQP",
    "LD_VAR2",
    "LD_MMA",
    "LD_CCSAQ",
    "LD_TNEWTON_PRECOND_RESTART",
)


@dataclass(frozen=True)
class Way:
    """By which algorithm the stages are gone through, and of which residual the first are.

    Args:
        opening: algorithm of the first stages.
        logarithmic: whether their residual is the logarithm of the ratio.
        allowance: whether they have their allowance, or the noise's weights alone.
        finish: algorithm of the other stages.
        whitened: whether an algorithm of NLopt opens in whitened coordinates.
    """

    opening: str
    logarithmic: bool = True
    has_error_floor: bool = True
    finish: str = GAUSS_NEWTON
    whitened: bool = True

    @property
    def coordinates(self) -> str:
        """In words; Gauss-Newton steps do not depend on them."""
        if self.opening == GAUSS_NEWTON:
            return "any"
        return "whitened" if self.whitened else "plain"

    @property
    def residual(self) -> str:
        """In words."""
        name = "logarithm" if self.logarithmic else "difference"
        return name if self.has_error_floor else f"{name}, by noise alone"


@dataclass(frozen=True)
class Run:
    """One start: evaluations and core seconds of the opening and in all, cost at the end."""

    opening: int
    opening_s: float
    evaluations: int
    seconds: float
    cost: float


WAYS = (
    Way(GAUSS_NEWTON),
    *(Way(name) for name in NAMED),
    *(Way(name, whitened=False) for name in NAMED),
    Way("LD_LBFGS", finish="LD_LBFGS"),
    *(
        Way(name, logarithmic=logarithmic, has_error_floor=has_error_floor)
        for name in (GAUSS_NEWTON, "LD_LBFGS")
        for logarithmic, has_error_floor in ((False, True), (True, False), (False, False))
    ),
)


def run() -> list[dict[str, object]]:
    """All ways from the same starts."""
    case = tuning_case(load_machine(STATION), SEED)
    starts = [case.start(seed) for seed in range(SEED, SEED + STARTS)]
    runs = {
        way: [_run(case, way, start) for start in starts]
        for way in track(WAYS, description="algorithms")
    }
    best = min(one.cost for found in runs.values() for one in found)
    return [_row(way, found, best) for way, found in runs.items()]


def _run(case: TuningCase, way: Way, start: np.ndarray) -> Run:
    model, campaign = case.model, case.campaign
    varies = parametrise(model, campaign.tolerance)
    opening = tuple(
        replace(
            stage,
            logarithmic=way.logarithmic,
            model_error_floor=stage.model_error_floor if way.has_error_floor else 0.0,
        )
        for stage in OPENING
    )
    before = time.process_time()
    if way.whitened:
        opened = fit(
            model,
            campaign,
            parametrisation=varies,
            starts=(start,),
            stages=opening,
            algorithm=way.opening,
        )
        theta, evaluations = opened.theta, opened.evaluations
    else:
        theta, evaluations = _open_plainly(case, varies, opening, start, way.opening)
    between = time.process_time()
    ended = fit(
        model,
        campaign,
        parametrisation=varies,
        starts=(theta,),
        stages=FINISH,
        algorithm=way.finish,
    )
    after = time.process_time()
    misfit = Misfit(model, campaign, varies, model_error_floor=0.0)
    return Run(
        opening=evaluations,
        opening_s=between - before,
        evaluations=evaluations + ended.evaluations,
        seconds=after - before,
        cost=misfit.value(ended.x),
    )


def _open_plainly(
    case: TuningCase,
    varies: Parametrisation,
    stages: tuple[Stage, ...],
    start: np.ndarray,
    algorithm: str,
) -> tuple[np.ndarray, int]:
    """The first stages by NLopt in the coordinates of the parameters, without whitening."""
    x, evaluations = varies.coordinates(start), 0
    for stage in stages:
        problem = stage.build_problem(case.model, thin_lines(case.campaign, stage.stride), varies)
        end = minimise(problem, x, (varies.lower, varies.upper), algorithm=algorithm)
        x, evaluations = end.x, evaluations + end.evaluations
    return varies.theta(x), evaluations


def _row(way: Way, runs: list[Run], best: float) -> dict[str, object]:
    cost = np.array([one.cost for one in runs])
    return {
        "opening": way.opening,
        "coordinates": way.coordinates,
        "residual": way.residual,
        "finish": way.finish,
        "within 5 %": f"{int((cost <= NEAR * best).sum())} of {len(runs)}",
        "worst / best cost": float(cost.max() / best),
        "opening evaluations": float(np.median([one.opening for one in runs])),
        "opening core s": float(np.median([one.opening_s for one in runs])),
        "evaluations": float(np.median([one.evaluations for one in runs])),
        "core s": float(np.median([one.seconds for one in runs])),
    }
