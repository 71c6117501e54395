"""A spinning rotor in a body."""

from dataclasses import dataclass

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import choose, draw_stage
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import GROUND, Real, Station

SPEED = (30.0, 300.0)
LIMITS = (0.1, 1000.0)  # rad/s
ALL_DIRECTIONS = 6


@dataclass(frozen=True)
class Gyroscopic(Sized):
    r"""Angular momentum h along an axis e that turns with the body.

    At a small rotation theta the rotor's axis is e + theta x e, so that the body's angular
    momentum about its centre of mass is L = I theta' + h (e + theta x e), to first order. What
    turns it is its rate:

        tau = dL/dt = I theta'' + h theta' x e = I theta'' - h [e]x theta',   [e]x v = e x v

    which adds -h [e]x to the damping of theta: skew, so that no energy is lost. For e = z the
    moment about x is I_x theta_x'' + h theta_y'; FRFs stop being reciprocal.

    Args:
        size: h over the body's mean moment of inertia [rad/s].
        body: name of the body.
        moment: its mean moment of inertia [kg m2].
        axis: e, unit vector, world axes.
    """

    body: str
    moment: float
    axis: tuple[float, ...]
    limits = LIMITS

    @property
    def angular_momentum(self) -> float:
        """Return h [kg m2/s]."""
        return self.size * self.moment

    def answer(self) -> Answer:
        """Return what is to be found."""
        parameters = {"angular_momentum": self.angular_momentum}
        return Answer("gyroscopic", location=f"body:{self.body}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig with the rotor's torques."""
        damping = np.zeros_like(rig.equations.damping)
        start = 6 * tested.station.index(self.body) + 3
        turning = slice(start, start + 3)
        # Column j of [e]x is e x (unit vector j).
        damping[turning, turning] = -self.angular_momentum * np.cross(self.axis, np.eye(3)).T
        return rig.with_matrices(damping=damping)


def draw_gyroscopic(
    random: np.random.Generator, scene: Scene, place: str | None
) -> Gyroscopic | None:
    """Draw a body that can tilt its rotor, the rotor's axis among its hinges', and h."""
    station = scene.station
    axes = [_axes(station, index) for index in range(len(station.stages))]
    choices = [index for index, some in enumerate(axes) if some]
    index = draw_stage(random, station, place, "body", choices)
    if index is None:
        return None
    stage = station.stages[index]
    axis: tuple[float, ...] = tuple(choose(random, axes[index]).tolist())
    return Gyroscopic(
        body=stage.name,
        moment=float(np.trace(stage.inertia)) / 3,
        axis=axis,
        size=random.uniform(*SPEED),
    )


def _axes(station: Station, index: int) -> list[Real]:
    """Return the axes of a rotor that the body, on its parents, can turn about two others.

    With less there is no effect: h theta' x e does no work on a rotation about one axis alone. A
    body with six joints, or whose last hinge is about z, or with no hinge, spins about z.
    """
    stage = station.stages[index]
    hinges = [joint.axis for joint in stage.joints if joint.kind == "hinge"]
    z = np.eye(3)[2]
    if not hinges or len(stage.joints) == ALL_DIRECTIONS or abs(hinges[-1] @ z) > 1 - 1e-9:
        candidates = [z]
    else:
        candidates = hinges
    turns, at = [], index
    while at != GROUND:
        turns += [joint.axis for joint in station.stages[at].joints if joint.kind == "hinge"]
        at = station.stages[at].parent
    if not turns:
        return []
    return [e for e in candidates if np.linalg.matrix_rank(np.cross(turns, e), tol=1e-6) > 1]
