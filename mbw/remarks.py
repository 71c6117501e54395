"""What a reader of a result must know beside its figures, on the screen as in the report."""

from collections.abc import Sequence

from tuning import TunedFile
from tuning.files.result import TUNED_JSON
from tuning.parametrisation.parametrisation import BOUND

_FEW = 4


def remarks(summary: TunedFile) -> list[str]:
    """One sentence for each thing that limits what a result says, as the screen has them."""
    found = []
    if summary.fit.doubts:
        found.append(f"Not to be trusted: {'; '.join(summary.fit.doubts)}.")
    if summary.unseen:
        found.append(f"{_some([row.sentence for row in summary.unseen], '; ')}.")
    if at_bound := sum(row.at_bound and row.prior is not None for row in summary.parameters):
        found.append(
            f"{_count(at_bound, 'tolerance')} reached {BOUND:g} standard deviations, their bound; "
            f"the largest pulls without it: {_largest(summary)}."
        )
    if lacking := not_held(summary.not_held_by_mjcf, TUNED_JSON):
        found.append(lacking)
    return found + limits(summary)


def limits(summary: TunedFile) -> list[str]:
    """What limits the figures themselves."""
    found = []
    if summary.residuals[-1] == "modal":
        found.append("Modes were fitted last: they know all lines, so that none is held out.")
    elif summary.gap.sensors.held_out is None and not summary.interrupted:
        found.append("The band is too narrow to hold lines out.")
    lost = [f"{row.frequency:.4g}" for row in summary.pairs if row.tuned is None]
    if lost:
        found.append(f"Measured modes without one of the model's: {', '.join(lost)} Hz.")
    if any(outcome != "converged" for outcome in summary.held_out_outcomes):
        found.append("Some held-out fits did not converge: the held-out error may be too high.")
    if any(test.variance_from == "differences" for test in summary.tests):
        found.append(
            "Without coherence, or with one average or none stated, the noise was estimated from "
            "third differences along frequency."
        )
    return found


def not_held(names: Sequence[str], listed: str) -> str:
    """What a tuned MJCF does not hold, gains and hits summed up; empty if it holds all.

    Args:
        names: of what it does not hold, each with its reason.
        listed: the file that lists them all.
    """
    gains = {name.split(".gain_")[0] for name in names if ".gain_" in name}
    hits = {name.split(")")[0] for name in names if name.startswith("hammer(")}
    others = [name for name in names if ".gain_" not in name and not name.startswith("hammer(")]
    found = [f"gains of {_count(len(gains), 'sensor')}"] if gains else []
    found += [f"place and aim of {_count(len(hits), 'hit')}"] if hits else []
    alike: dict[str, list[str]] = {}
    for name in others:
        what, _, why = name.partition(" (")
        alike.setdefault(why, []).append(what)
    found += [_some(names) + (f" ({why}" if why else "") for why, names in alike.items()]
    if not found:
        return ""
    return f"The tuned MJCF does not hold: {', '.join(found)} ({listed} lists them)."


def _largest(summary: TunedFile) -> str:
    """The largest pulls, by name."""
    pulls = [(row.name, row.pull) for row in summary.parameters if row.pull is not None]
    pulls.sort(key=lambda one: -abs(one[1]))
    return ", ".join(f"{name} {pull:+.1f}" for name, pull in pulls[:_FEW])


def _some(texts: list[str], between: str = ", ") -> str:
    """The first few, and how many more there are."""
    more = f" and {len(texts) - _FEW} more" if len(texts) > _FEW else ""
    return between.join(texts[:_FEW]) + more


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
