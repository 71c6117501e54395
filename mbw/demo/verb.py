"""``mbw demo``: all steps on the built-in station, whose measurement contains a hidden effect."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import Verdict
from identification.modal import ModeChoices, ModeCriteria
from mbw.assets import asset_path
from mbw.diagnose import verb as diagnose
from mbw.diagnose.files import PAGE, VERDICT
from mbw.identify import verb as identify
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.messages import SCREEN
from mbw.report import verb as report
from mbw.tune import verb as tune


def run(out: Path, jobs: int) -> None:
    """Identify, tune and diagnose, write the pages, and grade the diagnosis by the answer.

    Args:
        out: folder of the results.
        jobs: number of processes.
    """
    campaign = asset_path("demo")
    SCREEN.say("1. identification of the measured modes")
    targets = identify.IdentifyOutputs(out / "modes", json=None, pictures=True, full=False)
    choices = identify.IdentifyChoices(ModeCriteria(), ModeChoices(), against=None)
    modes = identify.run(campaign, targets, choices, None)
    SCREEN.say("\n2. tuning of stiffness, damping and tolerances")
    tuned = report.run(tune.run(campaign, out=out, jobs=jobs), None)
    SCREEN.say("\n3. diagnosis of the effect that the model lacks")
    diagnosis = diagnose.run(campaign, out=out / "diagnosis", jobs=jobs)
    verdict = Verdict.model_validate_json((diagnosis / VERDICT).read_text(encoding="utf-8"))
    answer = tomllib.loads((campaign / "answer.toml").read_text(encoding="utf-8"))
    SCREEN.say("\n4. grading by the answer, which no step has read so far")
    for line in grade_verdict(verdict, answer):
        SCREEN.say(f"  {line}")
    SCREEN.say("")
    for page in (modes / MODES_PAGE, tuned, diagnosis / PAGE):
        SCREEN.say(f"open {page.resolve().as_uri()}")


def run_options(out: Path, jobs: int) -> None:
    """Run the verb with the values of its options."""
    run(out, jobs)


def grade_verdict(verdict: Verdict, answer: Mapping[str, Any]) -> list[str]:
    """Return lines that compare a verdict with the truth.

    Args:
        verdict: verdict of the diagnosis.
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
            off = np.linalg.norm(np.subtract(estimate, true)) / np.linalg.norm(true)
            lines.append(f"{name}: {_number(estimate)}, true {_number(true)}, {off:.2%} off")
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
