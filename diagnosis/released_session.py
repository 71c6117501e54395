"""A session whose rigid directions may give way."""

from dataclasses import replace

from mbmodel import RigidDirection, release_rigid_directions
from tuning import Session, build_toleranced_model, parametrise


def release_session(session: Session) -> tuple[Session, tuple[RigidDirection, ...]]:
    """The session with a coordinate for each direction that the drawing holds rigid.

    A joint that only slides sits nowhere; one that may turn does, within its tolerance.
    """
    campaign = session.campaign
    machine, held = release_rigid_directions(session.model.machine, float(campaign.freq_hz.max()))
    model = build_toleranced_model(machine, campaign)
    varies = session.parametrisation.extend(parametrise(model, campaign.tolerance))
    return replace(session, model=model, parametrisation=varies), held
