"""Bodies that bend, as their redundant channels prove: hypotheses and their refit."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

from diagnosis.data_checks.sensors import Gate, hypothesis_of
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.hypothesis_set import together
from diagnosis.inference.evidence import BENDS
from diagnosis.refits.refitting import (
    FROM_AFAR,
    Refit,
    RefitTask,
    add_hypothesis,
    run_refits,
    start_values,
)
from diagnosis.settings import DiagnosisSettings
from tuning import STAGES, Session

# Start of a mode's frequency, relative to that of the highest peak, which what the body stands on
# and what it carries moves.
_START_FREQUENCIES = 1.0, 2.2, 1.5, 0.67, 3.3


def proven_hypotheses(gate: Gate, session: Session, ratio: float = 1.0) -> list[Hypothesis]:
    """Return the hypotheses of the faults that redundant channels prove.

    Args:
        gate: result of the data checks.
        session: campaign and nominal model.
        ratio: start of a mode's frequency, relative to that of its highest peak.
    """
    bending = [check.body for check in gate.flexible]
    hypotheses = (
        hypothesis_of(fault, session, bending, gate.undoubted, ratio) for fault in gate.faults
    )
    return [hypothesis for hypothesis in hypotheses if hypothesis is not None]


def refit_bending(
    scene: Scene,
    null: Refit,
    gate: Gate,
    settings: DiagnosisSettings,
    say: Callable[[str], None],
) -> tuple[Refit, float] | None:
    """Refit with the modes of bodies that bend, from several starts of their frequencies.

    Starts are the null model and, since that may have moved to hide the mode, the nominal model.

    Args:
        scene: campaign and model.
        null: null model, fitted to the channels that no fault concerns.
        gate: result of the data checks.
        settings: schedule.
        say: told what is being done.

    Returns:
        The best refit and the start of its frequencies; None if the modes do not explain most of
        the gap: where set-ups share a body's sensors, a machine that changed between them looks
        like bending too.
    """
    session = replace(scene.session, campaign=gate.undoubted)
    floor = STAGES[2].model_error_floor
    (without,) = run_refits(
        scene, [RefitTask(None, session, null.fit.theta, floor)], settings.schedule
    )
    max_gap = (1 - settings.min_closed) * without.gap
    best: tuple[Refit, float] | None = None
    nominal = replace(scene, theta=scene.session.model.drawn)
    for start, ratio in product(
        (replace(scene, theta=null.fit.theta), nominal), _START_FREQUENCIES
    ):
        say("bodies that bend")
        bending = [
            hypothesis
            for hypothesis in proven_hypotheses(gate, session, ratio)
            if hypothesis.effect == BENDS and hypothesis.is_held
        ]
        joined = together(bending)
        extended = add_hypothesis(session, joined)
        task = RefitTask(
            joined, extended, start_values(start, extended, joined), floor, FROM_AFAR[1:]
        )
        (refit,) = run_refits(scene, [task], settings.schedule)
        if best is None or refit.cost < best[0].cost:
            best = refit, ratio
        if best[0].gap < settings.min_visible_excess**2 - 1:
            break
    return best if best is not None and best[0].gap < max_gap else None
