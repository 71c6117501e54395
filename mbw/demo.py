"""``mbw demo``: the whole line on the built-in station."""

from pathlib import Path

from mbw import report, tune
from mbw.assets import asset
from mbw.messages import SCREEN


def run(out: Path, jobs: int) -> None:
    """Tune the built-in virtual campaign and write its report."""
    folder = tune.run(asset("demo"), out=out, jobs=jobs)
    target = report.run(folder, None)
    SCREEN.say(f"open {target.resolve().as_uri()}")
