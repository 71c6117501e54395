"""Small machines with known answers, and the nominal station."""

from pathlib import Path

import numpy as np
import pytest

from truth.campaign.measure import Measurement
from truth.machine.mjcf_reader import read_station
from truth.machine.station import GROUND, Hammer, Joint, Sensor, StageBody, Station

NOMINAL = Path(__file__).parents[2] / "assets" / "microstation" / "station.xml"
SPRINGS = {"tx": 3e6, "ty": 5e6, "tz": 7e6, "rx": 2e5, "ry": 3e5, "rz": 4e5}


def six_joints(stage: str, position: list[float], *, scale: float = 1.0) -> tuple[Joint, ...]:
    """Springs of six different stiffnesses and dampers, through one point."""
    return tuple(
        Joint(
            name=f"{stage}_{name}",
            kind="slide" if name[0] == "t" else "hinge",
            axis=np.eye(3)["xyz".index(name[1])],
            position=np.array(position),
            stiffness=scale * stiffness,
            damping=scale * stiffness * 2e-4,
        )
        for name, stiffness in SPRINGS.items()
    )


@pytest.fixture(scope="session")
def nominal_path() -> Path:
    return NOMINAL


@pytest.fixture(scope="session")
def nominal() -> Station:
    return read_station(NOMINAL)


@pytest.fixture(scope="session")
def one_body() -> Station:
    """One body, its joint at its centre of mass, so that the six directions do not mix."""
    com = [0.1, 0.2, 0.3]
    stage = StageBody(
        name="table",
        parent=GROUND,
        mass=120.0,
        com=np.array(com),
        inertia=np.diag([3.0, 4.0, 5.0]),
        joints=six_joints("table", com),
        sensors=(Sensor(3, np.array(com)), Sensor(1, np.add(com, [0.5, 0.0, 0.0]))),
    )
    return Station("one", (stage,))


@pytest.fixture(scope="session")
def two_bodies(one_body: Station) -> Station:
    """A second body on the first, nothing aligned with anything."""
    inertia = np.array([[2.0, 0.1, -0.2], [0.1, 2.5, 0.3], [-0.2, 0.3, 1.5]])
    upper = StageBody(
        name="holder",
        parent=0,
        mass=40.0,
        com=np.array([0.05, 0.3, 0.6]),
        inertia=inertia,
        joints=six_joints("holder", [0.2, 0.1, 0.45], scale=0.6),
        sensors=(Sensor(2, np.array([0.3, 0.5, 0.9])),),
    )
    return Station("two", (*one_body.stages, upper))


@pytest.fixture(scope="session")
def hammers_at() -> object:
    """Exact hits in x, y, z on a stage at a point."""

    def hit(stage: int, position: np.ndarray, node: int = 1) -> tuple[Hammer, ...]:
        return tuple(Hammer(node, stage, position, axis) for axis in np.eye(3))

    return hit


@pytest.fixture(scope="session")
def silence() -> object:
    """Makes draws quick by a patch: FRFs are left zero, and sizes are not sought."""

    def silent(machine, protocol, files, seed):
        del machine, seed
        references = tuple((node, axis) for node in protocol.nodes for axis in (1, 2, 3))
        for take in files:
            shape = (protocol.lines, len(take.channels), len(references))
            zero = np.zeros(shape) if protocol.coherence else None
            freq = protocol.freq_hz
            yield Measurement(freq, np.zeros(shape, complex), zero, take.channels, references)

    def apply(patch: pytest.MonkeyPatch) -> None:
        patch.setattr("truth.campaign.virtual_test.hammer_tests", silent)
        patch.setattr("truth.campaign.virtual_test._refit", lambda *_: None)

    return apply
