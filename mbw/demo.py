"""``mbw demo``: the whole line on the built-in station, whose test hides one effect."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis import Verdict
from identification.modal import Tolerances, Wishes
from mbw import report
from mbw.assets import asset
from mbw.diagnose import verb as diagnose
from mbw.diagnose.files import PAGE, VERDICT
from mbw.identify import verb as identify
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.messages import SCREEN
from mbw.tune import verb as tune


def run(out: Path, jobs: int) -> None:
    """Identify, tune, diagnose, write the pages, and grade the diagnosis by the sealed answer."""
    campaign = asset("demo")
    SCREEN.say("1. the measured modes")
    targets = identify.Targets(out / "modes", json=None, pictures=True, full=False)
    choices = identify.Choices(Tolerances(), Wishes(), against=None)
    modes = identify.run(campaign, targets, choices, None)
    SCREEN.say("\n2. stiffness, damping and tolerances tuned")
    tuned = report.run(tune.run(campaign, out=out, jobs=jobs), None)
    SCREEN.say("\n3. what the model lacks")
    found = diagnose.run(campaign, out=out / "diagnosis", jobs=jobs)
    verdict = Verdict.model_validate_json((found / VERDICT).read_text(encoding="utf-8"))
    answer = tomllib.loads((campaign / "answer.toml").read_text(encoding="utf-8"))
    SCREEN.say("\n4. graded by the answer, which nobody has read so far")
    for line in graded(verdict, answer):
        SCREEN.say(f"  {line}")
    SCREEN.say("")
    for page in (modes / MODES_PAGE, tuned, found / PAGE):
        SCREEN.say(f"open {page.resolve().as_uri()}")


def graded(verdict: Verdict, answer: Mapping[str, Any]) -> list[str]:
    """What was said beside what is true.

    Args:
        verdict: of the diagnosis.
        answer: of the campaign, as ``answer.toml`` holds it.
    """
    if not verdict.causes:
        return [f"said {verdict.verdict}; true is {answer['effect']} at {answer.get('location')}"]
    first = verdict.causes[0]
    pairs: list[tuple[str, str, str]] = [
        ("verdict", verdict.verdict, _word(answer)),
        ("effect", first.effect, str(answer.get("effect"))),
        ("location", first.location, str(answer.get("location"))),
    ]
    if "dof" in answer:
        pairs.append(("dof", str(first.dof), str(answer["dof"])))
    lines = [_line(*one) for one in pairs]
    for name, true in answer.get("parameters", {}).items():
        said = first.parameters.get(name)
        if said is not None:
            off = np.linalg.norm(np.subtract(said, true)) / np.linalg.norm(true)
            lines.append(f"{name}: {_number(said)}, true {_number(true)}, {off:.2%} off")
    return lines


def _word(answer: Mapping[str, Any]) -> str:
    """The verdict that an answer asks for."""
    if "cause" in answer:
        return "several"
    effect = str(answer["effect"])
    return effect if effect in ("none", "unexplained") else "explained"


def _line(name: str, said: str, true: str) -> str:
    return f"{name}: {said}, right" if said == true else f"{name}: {said}, wrong: it is {true}"


def _number(value: float | Sequence[float]) -> str:
    return ", ".join(f"{one:.4g}" for one in np.ravel(value))
