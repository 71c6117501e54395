"""Session whose rigid directions are released."""

from dataclasses import replace

from mbmodel import RigidDirection, release_rigid_directions
from tuning import Session, build_toleranced_model, parametrise


def release_session(session: Session) -> tuple[Session, tuple[RigidDirection, ...]]:
    """Return the session with a coordinate for each rigid direction, and these directions.

    The point of a joint that only slides has no effect. If the joint may turn, its point has one,
    and varies within its tolerance.
    """
    campaign = session.campaign
    machine, rigid = release_rigid_directions(session.model.machine, float(campaign.freq_hz.max()))
    model = build_toleranced_model(machine, campaign)
    varies = session.parametrisation.extend(parametrise(model, campaign.tolerance))
    return replace(session, model=model, parametrisation=varies), rigid
