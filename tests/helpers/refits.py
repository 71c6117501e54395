"""Refits of small machines, made one by one for tests of the diagnosis."""

from pathlib import Path

from diagnosis import EFFECTS, Hypothesis, Scene
from diagnosis.null_model import fit_null_model
from diagnosis.refits.refit import Refit
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.settings import SETTINGS
from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.machine.random_tree import draw_tree
from tuning import STAGES, Session, fit, open_session


def early_scene(session: Session, jobs: int = 1) -> Scene:
    """Return the scene of a session about a fit of its first stages alone."""
    early = fit(
        session.model, session.campaign, parametrisation=session.parametrisation, stages=STAGES[:3]
    )
    return Scene(session, early.theta, jobs=jobs)


def refit_null(scene: Scene) -> Refit:
    """Return the null model, fitted at its own floor from the nominal model."""

    return fit_null_model(scene, SETTINGS)


def refit_with(scene: Scene, base: Refit, hypothesis: Hypothesis) -> Refit:
    """Return a refit with one more cause."""
    (refit,) = run_refits(scene, [add_cause(base, hypothesis)], SETTINGS.schedule)
    return refit


def propose_at(scene: Scene, effect: str, location: str) -> list[Hypothesis]:
    """Return what an effect proposes at a place."""
    return [one for one in EFFECTS[effect](scene) if one.location == location]


def draw_imperfect(
    folder: Path, seed: int, *effects: str, dirt: float, ratio: float = 6.0, lines: int = 161
) -> tuple[Session, str]:
    """Return a session of a machine with small errors everywhere, and its answer as text.

    Args:
        folder: where the campaign is written.
        seed: of machine, test, effects and errors.
        effects: what the drawing lacks beside the errors.
        dirt: part of the motion that the errors leave of a re-tuned machine [per cent].
        ratio: survival ratio of each effect.
        lines: of 1 Hz.
    """
    tree = draw_tree(seed, 3)
    cause = Cause(tuple(Wanted(effect, None, ratio) for effect in effects))
    protocol = Protocol(nodes=(tree.first_aim(),), lines=lines, resolution_hz=1.0)
    campaign = draw_campaign(tree, Plan(seed, cause, protocol=protocol, dirt=dirt))
    write_campaign(campaign, folder / "campaign")
    return open_session(folder / "campaign"), campaign.answer.decode()
