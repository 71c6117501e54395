"""Gap at one place: which hypotheses act there, and which shapes of them are worth a refit."""

from collections.abc import Sequence

from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import ForceGain
from diagnosis.search.score_test import Score, list_peaks
from diagnosis.settings import DiagnosisSettings
from mbmodel import WORLD


def find_local_force(forces: Sequence[ForceGain], settings: DiagnosisSettings) -> ForceGain | None:
    """Return the force of any spectrum that explains much of the gap; None if it is everywhere.

    Args:
        forces: free force of each place.
        settings: part of the gap that it explains.
    """
    first = max(forces, key=lambda force: force.share, default=None)
    return first if first and first.share >= settings.min_local_share else None


def acts_at(hypothesis: Hypothesis, place: str | None) -> bool:
    """Return whether the force of a hypothesis acts at a place and nowhere else.

    A link to the ground is a force on its body alone.
    """
    kind, _, name = (place or "").partition(":")
    on_ground = f"pair:{WORLD}-{name}" if kind == "body" else place
    return hypothesis.location in (place, on_ground)


def acts_along(hypothesis: Hypothesis, force: ForceGain | None) -> bool:
    """Return whether a linear effect acts at the place of a force alone, in its direction."""
    if force is None or hypothesis.dof != force.dof or hypothesis.spring is not None:
        return False
    return acts_at(hypothesis, force.location)


def list_further_peaks(ranked: Sequence[Score], place: str | None, count: int) -> list[Hypothesis]:
    """Return the further peaks of the scans of effects at a place, the most promising first.

    Args:
        ranked: scores of all hypotheses, the most promising first.
        place: the place; None for none.
        count: how many are returned at most.
    """
    scans: dict[str, list[Score]] = {}
    for score in ranked:
        if acts_at(score.hypothesis, place) and score.hypothesis.spring is None:
            scans.setdefault(score.hypothesis.site, []).append(score)
    peaks = [peak for scan in scans.values() for peak in list_peaks(scan) if peak is not scan[0]]
    best = sorted(peaks, key=lambda score: -score.gain)[:count]
    return [peak.hypothesis for peak in best]
