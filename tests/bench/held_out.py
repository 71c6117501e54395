"""Ways to hold data out, compared on withheld machines: lines, whole references, whole bodies.

Of each campaign the sets that the search has fitted are fitted once more without each part of the
data: without causes, the true set, and the true set less its largest cause. A way is good if

* the true set is not rejected (``diagnosis.decision.held_out_check``);
* the true set predicts better than without its largest cause, by the same rule;
* the gap of the true set on data that a fit did not see is close to that of the data it saw.

``peaks``: blocks of lines from resonance to resonance (``tuning.assessment.held_out``).
``bandwidths``: blocks of three bandwidths wherever modes lie. ``references``: one hit point and
direction after another. ``bodies``: all channels of a body.

Seeds 720000 and up, one or several effects beside dirt or none. ``LIMIT=24`` for the first ones.
"""

import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from diagnosis import diagnose
from diagnosis.algorithm import Diagnosis
from diagnosis.inference.calibration import load_calibration
from diagnosis.inference.posterior import read_site
from diagnosis.refits.refit import Refit
from identification.words import Campaign, Integers, Mask
from mbmodel import model_modes
from tests.bench.kept import cases
from tests.bench.scorecard_draws import ensure, reported_designs
from truth.grade.answer import answer_from
from truth.grade.rates import wilson
from tuning import (
    FloorSchedule,
    channel_gaps,
    open_session,
    predict,
    summarise_gaps,
    thin_lines,
)
from tuning.assessment.held_out import MIN_BLOCK_LINES, assign_folds, find_blocks
from tuning.fitting.stage_search import minimise_stage
from tuning.misfit.residual_statistics import residual_statistics

FIRST, CASES = 720_000, 60
CELLS = ("dirt 5 %", "dirt 15 %", "2 effects", "clean")
WAYS = ("peaks", "bandwidths", "references", "bodies")
_MIN_GAIN_NATS = 0.05  # as for the folds of the product


@dataclass(frozen=True, eq=False)
class HeldOutPart:
    """Data that are left out together: lines, tests, or the channels of a body.

    Args:
        lines: lines that are left out; (n_freq,).
        blocks: number of the block of each line; (n_freq,).
        tests: tests that are left out; (n_test,).
        body: body whose channels are left out.
    """

    lines: Mask | None = None
    blocks: Integers | None = None
    tests: Mask | None = None
    body: str = ""

    def keep(self, campaign: Campaign) -> Campaign:
        """Return all other data."""
        if self.lines is not None:
            return campaign.select_lines(~self.lines)
        if self.tests is not None:
            kept = zip(campaign.tests, self.tests, strict=True)
            return replace(campaign, tests=tuple(test for test, is_held in kept if not is_held))
        return self._select_body(campaign, is_kept=False)

    def hold(self, campaign: Campaign) -> list[Campaign]:
        """Return what is left out, in the pieces whose residual has a floor of its own."""
        if self.lines is not None:
            chosen = [self.blocks == block for block in np.unique(self.blocks[self.lines])]
            return [campaign.select_lines(lines) for lines in chosen]
        if self.tests is not None:
            kept = zip(campaign.tests, self.tests, strict=True)
            return [replace(campaign, tests=tuple(test for test, is_held in kept if is_held))]
        return [self._select_body(campaign, is_kept=True)]

    def pick(self, campaign: Campaign, row: int) -> tuple[Mask, Mask]:
        """Return the lines and outputs of a test that are left out; (n_freq,), (n_out,)."""
        outputs = campaign.tests[row].estimate.frf.outputs
        lines, of_test = np.ones(len(campaign.freq_hz), bool), np.ones(len(outputs), bool)
        if self.lines is not None:
            return self.lines, of_test
        if self.tests is not None:
            return lines, of_test & self.tests[row]
        return lines, np.array([campaign.layout.owner_name(dof) == self.body for dof in outputs])

    def _select_body(self, campaign: Campaign, *, is_kept: bool) -> Campaign:
        tests = []
        for row, test in enumerate(campaign.tests):
            counted = test.estimate.measured & (self.pick(campaign, row)[1] == is_kept)[:, None]
            tests.append(replace(test, estimate=replace(test.estimate, measured=counted)))
        return replace(campaign, tests=tuple(tests))


def run() -> list[dict[str, object]]:
    """Diagnose and compare what is missing; return the rates of each way."""
    limit = int(os.environ.get("LIMIT", CASES))
    chosen = [n for n, design in enumerate(reported_designs()) if design.cell in CELLS][:limit]
    kept, _ = cases("held_out", chosen, _case, int(os.environ.get("JOBS", "1")))
    return [_row(way, [row[way] for row in kept if way in row]) for way in WAYS]


def _row(way: str, rows: list[dict]) -> dict[str, object]:
    """Return the rates of a way, each with its 95 % interval."""
    row: dict[str, object] = {"held out": way, "n": len(rows)}
    for name in ("true set admitted", "largest cause needed"):
        marks = [each[name] for each in rows if each[name] is not None]
        low, high = wilson(sum(marks), max(len(marks), 1))
        row |= {name: sum(marks), f"{name}, n": len(marks), f"{name} from": low, f"{name} to": high}
    ratios = [each["excess"] / each["fitted"] for each in rows] or [np.nan]
    row |= {f"excess over fitted, {q} %": float(np.percentile(ratios, q)) for q in (50, 90)}
    return row


def _case(number: int) -> dict[str, object]:
    """Return how each way judges the true set of a campaign, if the search has fitted it."""
    design = reported_designs()[number]
    stored = ensure(design, FIRST + number)
    row: dict[str, object] = {"seed": stored.seed, "effects": design.effects, "dirt": design.dirt}
    if stored.answer is None:
        return row | {"left out": "no place"}
    with threadpool_limits(1):
        diagnosis = diagnose(open_session(stored.folder))
        sets = _find_sets(diagnosis, stored.answer)
        if sets is None:
            return row | {"left out": "the true set was not fitted"}
        return row | {way: judged for way in WAYS if (judged := _judge(way, diagnosis, *sets))}


def _find_sets(diagnosis: Diagnosis, answer: str) -> tuple[Refit, Refit] | None:
    """Return the refits of the true set, and of it without its largest cause."""
    truth = answer_from(tomllib.loads(answer), "answer")
    wanted = {(cause.effect, cause.location) for cause in truth.causes}
    sets: dict[frozenset, Refit] = {frozenset(): diagnosis.search.null}
    for refit in sorted(diagnosis.search.refits, key=lambda refit: -refit.objective):
        sets[frozenset(map(read_site, refit.keys))] = refit
    whole = sets.get(frozenset(wanted))
    less = [sets[each] for site in wanted if (each := frozenset(wanted - {site})) in sets]
    return None if whole is None or not less else (whole, max(less, key=lambda refit: refit.gap))


def _judge(way: str, diagnosis: Diagnosis, whole: Refit, less: Refit) -> dict | None:
    """Return how a way judges the true set; None where it cannot hold anything out."""
    null, price = diagnosis.search.null, diagnosis.evidence.price_causes
    parts = _split(way, null)
    if len(parts) < 2:
        return None
    settings, campaign = diagnosis.scene.settings, null.session.campaign
    schedule = settings.schedule.thin(len(campaign.freq_hz), diagnosis.scene.stride_factor)
    results = [_predict_parts(refit, parts, schedule) for refit in (null, less, whole)]
    costs, gaps = zip(*results, strict=True)
    count = whole.summary.count_independent(load_calibration())
    admitted = count * (costs[0] - costs[2]) > price(whole.keys)
    needed = count * (costs[1] - costs[2]) > price(whole.keys) - price(less.keys)
    fitted = predict(whole.session.model, whole.fit.theta, whole.session.campaign)
    return {
        "true set admitted": bool(admitted),
        "largest cause needed": bool(needed),
        "nats": [count * (costs[0] - costs[2]), count * (costs[1] - costs[2])],
        "null": gaps[0],
        "excess": gaps[2],
        "fitted": summarise_gaps(channel_gaps(fitted, whole.session.campaign)).excess,
        "parts": len(parts),
    }


def _split(way: str, refit: Refit) -> list[HeldOutPart]:
    """Return the parts that are held out in turn."""
    campaign = refit.session.campaign
    count = len(campaign.freq_hz)
    if way in ("peaks", "bandwidths"):
        starts = find_blocks(campaign) if way == "peaks" else _start_by_bandwidth(refit)
        folds = assign_folds(starts, count)
        blocks = np.searchsorted(starts, np.arange(count), side="right")
        return [
            HeldOutPart(lines=folds == fold, blocks=blocks)
            for fold in range(int(folds.max(initial=0)) + 1)
        ]
    if way == "references":
        names = [str(test.condition.reference.positive) for test in campaign.tests]
        return [HeldOutPart(tests=np.array(names) == name) for name in sorted(set(names))]
    layout = campaign.layout
    return [
        HeldOutPart(body=name) for name in sorted({layout.owner_name(d) for d in campaign.outputs})
    ]


def _start_by_bandwidth(refit: Refit) -> Integers:
    """Return the first lines of blocks of three lower quartiles of the modes' bandwidths."""
    freq = refit.session.campaign.freq_hz
    modes = model_modes(refit.session.model, refit.fit.theta)
    inside = (modes.freq_hz >= freq[0]) & (modes.freq_hz <= freq[-1]) & (modes.poles.imag > 0)
    widths = 2 * modes.damping[inside] * modes.freq_hz[inside] / np.diff(freq).mean()
    width = 3 * np.quantile(widths, 0.25) if inside.any() else np.inf
    return np.arange(0, len(freq), max(MIN_BLOCK_LINES, round(min(width, len(freq) // 15))))


def _predict_parts(
    refit: Refit, parts: Sequence[HeldOutPart], schedule: FloorSchedule
) -> tuple[float, float]:
    """Return mean -ln L and excess on what fits without each part foretell."""
    model, varies = refit.session.model, refit.fit.parametrisation
    campaign = refit.session.campaign
    stage = replace(schedule.stage(refit.floor), stride=schedule.stride // 2)
    whole = [np.zeros_like(test.estimate.frf.values) for test in campaign.tests]
    statistics = []
    for part in parts:
        kept = thin_lines(part.keep(campaign), stage.stride)
        problem = stage.build_problem(model, kept, varies)
        end = minimise_stage(problem, varies, refit.fit.x, stage, min_gain_nats=_MIN_GAIN_NATS)
        theta = varies.theta(end.x)
        for row, values in enumerate(predict(model, theta, campaign)):
            lines, outputs = part.pick(campaign, row)
            whole[row][np.ix_(lines, outputs)] = values[np.ix_(lines, outputs)]
        for piece in part.hold(campaign):
            statistics.append(residual_statistics(predict(model, theta, piece), piece))
    moving = [piece for piece in statistics if piece is not None]
    cost = np.average([piece.cost for piece in moving], weights=[piece.values for piece in moving])
    return float(cost), float(summarise_gaps(channel_gaps(whole, campaign)).excess)
