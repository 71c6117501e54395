"""The entry of this repository: ``mbw diagnose``, its verdict written as an answer."""

import json
import math
import subprocess
import sys
from pathlib import Path

from truth.grade.read_verdict import read_verdict
from truth.grade.verdict import CATALOGUE, Row, StatedVerdict, alone

NOT_CONVERGED = 4  # exit code of a diagnosis that leaves its results too
PRESENT = 0.5  # probability of the causes of the set that stands for all sets of several


def cause(row: Row) -> dict[str, object]:
    """Return a row of the verdict as a cause; the size of a stiffness is its change [N/m]."""
    name = "change" if row.effect == "stiffness" else CATALOGUE[row.effect].size
    stated: dict[str, object] = {"effect": row.effect, "places": [*(row.places or (row.location,))]}
    sizes = [size for size in row.parameters.get(name, ()) if not math.isnan(size)]
    if sizes and name == "fraction":  # of supports: the smallest that one carries
        stated["size"] = min(sizes)
    elif sizes:
        stated["size"] = sizes[0] if len(sizes) == 1 else math.hypot(*sizes)
    (low, high), *further = row.interval.get(name, ()) or ((math.nan, math.nan),)
    if not further and not math.isnan(low):
        stated["interval"] = [low, high]
    return stated


def answer(verdict: StatedVerdict) -> dict[str, object]:
    """Return the answer that a verdict gives."""
    pairs = zip(alone(verdict), verdict.causes, strict=True)
    sets = [(p, [cause(row)]) for p, row in pairs if p > 0]
    named = [row for row in verdict.causes if row.probability >= PRESENT][:6]
    if len(named) < 2:
        named = [*verdict.causes[:2]]
    if verdict.several > 0 and len(named) > 1:
        sets.append((verdict.several, [cause(row) for row in named]))
    total = max(1.0, verdict.none + verdict.unexplained + sum(p for p, _ in sets))
    gap = None if None in (verdict.retuned, verdict.after) else [verdict.retuned, verdict.after]
    return {
        "format": 1,
        "none": verdict.none / total,
        "unexplained": verdict.unexplained / total,
        "sets": [{"probability": p / total, "causes": causes} for p, causes in sets],
        "gap": gap,
    }


def main(folder: Path) -> None:
    """Diagnose a campaign and write ``answer.json`` into its folder."""
    target = folder / "verdict.json"
    command = [
        sys.executable,
        "-m",
        "mbw",
        "diagnose",
        str(folder),
        "--quiet",
        "--json",
        str(target),
    ]
    done = subprocess.run([*command, "--out", str(folder / "diagnosed")], check=False)
    if done.returncode not in (0, NOT_CONVERGED):
        sys.exit(done.returncode)
    (folder / "answer.json").write_text(json.dumps(answer(read_verdict(target))), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
