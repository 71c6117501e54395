"""What a reader of a result must know beside its figures, on the screen as in the report."""

from tuning import TunedFile


def remarks(summary: TunedFile) -> list[str]:
    """One sentence for each thing that limits what a result says."""
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
    at_bound = [row.name for row in summary.parameters if row.at_bound]
    if at_bound:
        found.append(f"At a bound, not to be trusted: {', '.join(at_bound)}.")
    if summary.not_held_by_mjcf:
        found.append(f"The tuned MJCF does not hold: {', '.join(summary.not_held_by_mjcf)}.")
    if any(test.variance_from == "differences" for test in summary.tests):
        found.append(
            "Without coherence and averages the noise was estimated from third differences along "
            "frequency."
        )
    return found
