"""``mbw demo``: all steps on the built-in station, whose measurement contains a hidden effect."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import Verdict
from mbw.assets import asset_path
from mbw.diagnose import verb as diagnose
from mbw.identify import verb as identify
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions
from mbw.results.diagnosed_files import PAGE
from mbw.tune import verb as tune
from mbw.tune.page import PAGE as TUNED_PAGE
from tuning.files.plant_folder import VERDICT

# Values at which parameters change nothing; it is zero for all others.
NEUTRAL = {"fraction": 1.0, "factor": 1.0, "gain": 1.0}


def run(
    outputs: ResultOptions,
    *,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    seed: int = 0,
) -> None:
    """Identify, tune and diagnose, write the pages, and grade the diagnosis by the answer.

    Args:
        outputs: folder of all results, JSON of the verdict, and whether files are replaced.
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.
    """
    campaign, out = asset_path("demo"), outputs.out or Path("mbw-demo")
    without_json = replace(outputs, json=None)
    SCREEN.say("1. identification of the measured modes")
    choices = identify.IdentifyChoices()
    modes = identify.run(campaign, replace(without_json, out=out / "modes"), choices, band)
    SCREEN.say("\n2. tuning of stiffness, damping and tolerances")
    tuned = tune.run(campaign, without_json, band=band, jobs=jobs, seed=seed)
    SCREEN.say("\n3. diagnosis of the effect that the model lacks")
    diagnosed = replace(outputs, out=out / "diagnosis")
    diagnosis = diagnose.run(campaign, diagnosed, band=band, jobs=jobs)
    verdict = Verdict.model_validate_json((diagnosis / VERDICT).read_text(encoding="utf-8"))
    answer = tomllib.loads((campaign / "answer.toml").read_text(encoding="utf-8"))
    SCREEN.say("\n4. grading by the answer, which no step has read so far")
    for line in grade_verdict(verdict, answer):
        SCREEN.say(f"  {line}")
    SCREEN.say("")
    for page in (modes / MODES_PAGE, tuned / TUNED_PAGE, diagnosis / PAGE):
        SCREEN.say(f"open {page.resolve().as_uri()}")


def grade_verdict(verdict: Verdict, answer: Mapping[str, Any]) -> list[str]:
    """Return lines that compare a verdict with the truth.

    A parameter is off by |stated - true| / |true - neutral|, a share of what the effect changes.

    Args:
        answer: true effect of the campaign, as in ``answer.toml``.
    """
    if not verdict.causes:
        return [
            f"verdict {verdict.verdict}, wrong: it is {answer['effect']} at "
            f"{answer.get('location')}"
        ]
    first = verdict.causes[0]
    pairs: list[tuple[str, str, str]] = [
        ("verdict", verdict.verdict, _word(answer)),
        ("effect", first.effect, str(answer.get("effect"))),
        ("location", first.location, str(answer.get("location"))),
    ]
    if "dof" in answer:
        pairs.append(("dof", str(first.dof), str(answer["dof"])))
    lines = [_line(*pair) for pair in pairs]
    for name, true in answer.get("parameters", {}).items():
        estimate = first.parameters.get(name)
        if estimate is not None:
            stated = np.ravel(np.array(estimate, float))
            is_stated = np.isfinite(stated)  # components that no motion shows are null
            size = np.linalg.norm(np.ravel(true) - NEUTRAL.get(name, 0.0))
            off = np.linalg.norm((stated - np.ravel(true))[is_stated]) / size
            said = _number(stated[is_stated].tolist())
            lines.append(f"{name}: {said}, true {_number(true)}, {off:.2%} off")
    return lines


def _word(answer: Mapping[str, Any]) -> str:
    """Return the verdict that is right for an answer."""
    if "cause" in answer:
        return "several"
    effect = str(answer["effect"])
    return effect if effect in ("none", "unexplained") else "explained"


def _line(name: str, value: str, true: str) -> str:
    return f"{name}: {value}, right" if value == true else f"{name}: {value}, wrong: it is {true}"


def _number(value: float | Sequence[float]) -> str:
    return ", ".join(f"{component:.4g}" for component in np.ravel(value))
