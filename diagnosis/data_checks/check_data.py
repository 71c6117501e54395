"""Data checks before any fit: changing tests, sensors and bodies by redundant channels.

Session whose rigid directions are released.
"""

from dataclasses import dataclass, replace

from diagnosis.data_checks.sensors import SensorChecks, check_sensors
from diagnosis.settings import DiagnosisSettings
from identification import find_overstated_noise, remove_overstated_noise
from identification.words import Campaign, UsageError
from mbmodel import Model, RigidDirection, release_rigid_directions
from mbmodel.parts import AttachedPart
from tuning import Session, build_toleranced_model, parametrise
from tuning.assessment.held_out import MIN_BLOCK_LINES


@dataclass(frozen=True, eq=False)
class CheckedData:
    """Result of the data checks.

    Args:
        session: campaign without useless channels; model whose rigid directions may give way.
        checks: faults that redundant channels prove.
        directions: rigid directions.
        unsteady: number of tests that met different machines from hit to hit.
    """

    session: Session
    checks: SensorChecks
    directions: tuple[RigidDirection, ...]
    unsteady: int


def check_data(session: Session, settings: DiagnosisSettings) -> CheckedData:
    """Check the data without a model, and let rigid directions of the model give way.

    Of a campaign with states, the tests before are checked; those after by ``states``.

    Raises:
        UsageError: the band holds too few lines.
    """
    count = len(session.campaign.freq_hz)
    if count < MIN_BLOCK_LINES:
        raise UsageError(
            f"a diagnosis needs {MIN_BLOCK_LINES} frequency lines or more, and the band holds "
            f"{count}: widen it"
        )
    campaign = session.campaign.select_state("before")
    checks, unsteady = check_tests(replace(session, campaign=campaign), settings)
    released, directions = release_session(replace(session, campaign=checks.alive))
    return CheckedData(released, checks, directions, unsteady)


def check_tests(
    session: Session, settings: DiagnosisSettings, before: Campaign | None = None
) -> tuple[SensorChecks, int]:
    """Compare the channels of a campaign, and count the tests that change from hit to hit.

    Args:
        before: tests before a change, with which these are compared.
    """
    changing = find_overstated_noise(session.campaign)
    campaign = remove_overstated_noise(session.campaign, changing)
    doubt = "a control loop is closed" if session.model.machine.loops else ""
    return check_sensors(campaign, settings, doubt, before), len(changing)


def release_session(session: Session) -> tuple[Session, tuple[RigidDirection, ...]]:
    """Return the session with a coordinate for each rigid direction, and these directions.

    The point of a joint that only slides has no effect. If the joint may turn, its point has one,
    and varies within its tolerance. Instruments that hang on the machine stay on it.
    """
    campaign = session.campaign
    machine, rigid = release_rigid_directions(session.model.machine, float(campaign.freq_hz.max()))
    attached = (part for part in session.model.parts if isinstance(part, AttachedPart))
    model = Model(machine, (*build_toleranced_model(machine, campaign).parts, *attached))
    varies = session.parametrisation.extend(parametrise(model, campaign.tolerance))
    return replace(session, model=model, parametrisation=varies), rigid
