"""Bodies that bend, as their redundant channels prove: hypotheses and their refit."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

from diagnosis.data_checks.sensors import Gate, hypothesis_of
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import together
from diagnosis.inference.evidence import BENDS
from diagnosis.refits.refitting import FIRST, LAST, SHAPED, Refit, refit
from tuning import Session

_BENT = 0.3  # of the gap, what a body's mode may leave
_NEARLY = 0.5  # of the variance: where it leaves more, its frequency may begin elsewhere
_BEGINS = 1.0, 2.2, 1.5, 0.67, 3.3  # times that of the highest peak


def proven_hypotheses(gate: Gate, session: Session, times: float = 1.0) -> list[Hypothesis]:
    """Hypotheses of what the gate has proven."""
    bending = [check.body for check in gate.flexible]
    good = gate.undoubted
    found = (hypothesis_of(fault, session, bending, good, times) for fault in gate.faults)
    return [one for one in found if one is not None]


def refit_bending(
    scene: Scene, gate: Gate, session: Session, say: Callable[[str], None]
) -> tuple[Refit, float] | None:
    """The refit with the modes of bodies that seem to bend, and where their frequencies began.

    They begin about the fit without them and, since that may have wandered, about the drawing.
    None where they do not explain it: where set-ups share a body's sensors, a machine that was
    another one in each of them looks like bending too.
    """
    without = refit(scene, None, gate.undoubted, (*FIRST, *LAST))
    least = _BENT * without.gap
    best: tuple[Refit, float] | None = None
    drawn = replace(scene, theta=scene.session.model.drawn)
    for start, times in product((scene, drawn), _BEGINS):
        say("bodies that bend")
        bent = [
            one
            for one in proven_hypotheses(gate, session, times)
            if one.effect == BENDS and one.is_held
        ]
        found = refit(start, together(bent), gate.undoubted, SHAPED)
        if best is None or found.chi_square < best[0].chi_square:
            best = found, times
        if best[0].gap < min(least, _NEARLY):
            break
    return best if best is not None and best[0].gap < least else None
