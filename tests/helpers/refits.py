"""Refits of small machines, made one by one for tests of the diagnosis."""

from diagnosis import EFFECTS, Hypothesis, Scene
from diagnosis.null_model import fit_null_model
from diagnosis.refits.refitting import Refit, add_to, run_refits
from diagnosis.settings import SETTINGS
from tuning import STAGES, Session, fit


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
    (refit,) = run_refits(scene, [add_to(base, hypothesis)], SETTINGS.schedule)
    return refit


def propose_at(scene: Scene, effect: str, location: str) -> list[Hypothesis]:
    """Return what an effect proposes at a place."""
    return [one for one in EFFECTS[effect](scene) if one.location == location]
