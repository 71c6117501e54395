"""Next experiment where drift may look like a law: the first level once more, at the end."""

from diagnosis.algorithm import Diagnosis
from diagnosis.inference.evidence import Key
from diagnosis.labels import LEVELS
from diagnosis.levels.free_levels import LAW_EFFECTS
from identification.level_check import group_visits


def propose_return(diagnosis: Diagnosis) -> str | None:
    """Return the experiment that tells a law from a drift between the levels.

    Args:
        diagnosis: the diagnosis.

    Returns:
        None if the tests return to a level, or if no such cause leads.
    """
    causes = diagnosis.posterior.causes
    if not causes or not _changes_with_level(causes[0][0]):
        return None
    visits = group_visits(diagnosis.session.campaign)
    level, first = visits[0]
    if level is None or len({level for level, _ in visits}) < len(visits):
        return None
    place = causes[0][0][1].partition(":")[2]
    text = first.tests[0].condition.level_text
    return (
        f"repeat the tests at {text} after all others: if the joint of {place} depends on the "
        "level, it is then as before; if it drifts between the levels, it is not"
    )


def _changes_with_level(cause: Key) -> bool:
    effect, _, dof = cause
    return effect in LAW_EFFECTS or dof == LEVELS
