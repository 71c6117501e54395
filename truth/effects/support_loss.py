"""A stage whose supports do not all carry: a granite on two of its four levelers."""

from dataclasses import dataclass, replace

import numpy as np

from truth.effects.effect import Answer, Scene, Sized
from truth.effects.places import DIRECTIONS, choose, draw_stage, relative_motion, springs
from truth.machine.rig import Occasion, Prepared, Rig
from truth.machine.station import Joint, Real, StageBody

LOST = (0.3, 0.9)
NEAR = (0.6, 1.0)  # of the levers that the hinges allow
SMALLEST = 1e-3
LARGEST = 1.0
LARGEST_OF_TWO = 0.95  # a machine on two points alone would tip over
CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


@dataclass(frozen=True)
class SupportLoss(Sized):
    r"""Four supports at (+-a, +-b) about the joint's point; one or two carry 1 - size.

    Each carries a quarter of what the joint's slides have in stiffness and damping. A support at
    (x, y) moves by

        (t_x - r_z g y,  t_y + r_z g x,  t_z + r_x y - r_y x)

    The joint's hinges are what the supports' levers make of the slides, or more:

        a^2 k_tz <= k_ry,   b^2 k_tz <= k_rx,   g^2 (b^2 k_tx + a^2 k_ty) <= k_rz

    with equality in the first two but for ``near``, g <= 1; the dampers likewise, no farther out
    than the springs. So stiffness and damping stay positive semidefinite, whatever is lost.

    Args:
        size: lost by the supports that do not carry all.
        stage: name of the child body.
        lost: which of the supports (+a, +b), (-a, +b), (-a, -b), (+a, -b).
        near: a and b over what the hinges allow.
    """

    stage: str
    lost: tuple[int, ...]
    near: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        """Check that nothing pulls instead of carrying."""
        super().__post_init__()
        self.require(self.size <= 1 and 0 < len(set(self.lost)) <= len(CORNERS))

    @property
    def limits(self) -> tuple[float, float]:
        """Return smallest and largest loss."""
        return SMALLEST, LARGEST if len(self.lost) == 1 else LARGEST_OF_TWO

    def answer(self) -> Answer:
        """Return what is to be found."""
        fraction = tuple(1 - self.size if corner in self.lost else 1.0 for corner in range(4))
        parameters = {"fraction": fraction}
        return Answer("support_loss", location=f"joint:{self.stage}", parameters=parameters)

    def to_rig(self, rig: Rig, tested: Prepared, occasion: Occasion) -> Rig:
        """Return the rig without what the supports have lost."""
        index = tested.station.index(self.stage)
        joints = tested.station.stages[index].joints
        motion = relative_motion(rig, tested, index, joints[0].position)
        stiffness = _along(joints, "stiffness")
        far = levers(stiffness, self.near)
        lost = self.size * self._lost_support_matrix(motion, stiffness, far)
        damping = _along(joints, "damping")
        near = np.minimum(levers(damping, self.near), far)
        slower = self.size * self._lost_support_matrix(motion, damping, near)
        return rig.with_matrices(damping=-slower, stiffness=-lost)

    def _lost_support_matrix(self, motion: Real, along: Real, levers: Real) -> Real:
        """Return what the supports that lose something carry when whole; (n, n)."""
        a, b, flat = levers
        total = np.zeros((motion.shape[1], motion.shape[1]))
        for number in self.lost:
            x, y = np.array(CORNERS[number]) * (a, b)
            tx, ty, tz, rx, ry, rz = motion
            rows = np.array([tx - rz * flat * y, ty + rz * flat * x, tz + rx * y - ry * x])
            total += springs(rows, along[:3] / len(CORNERS))
        return total


def levers(along: Real, near: tuple[float, float] = (1.0, 1.0)) -> Real:
    """Return a [m], b [m] and g of supports; of what a joint has along tx .. rz, (6,).

    Args:
        along: stiffness or damping.
        near: a and b over what the hinges allow.
    """
    tx, ty, tz, rx, ry, rz = along
    a, b = (np.sqrt(ry / tz), np.sqrt(rx / tz)) if tz > 0 else (0.0, 0.0)
    a, b = a * near[0], b * near[1]
    twist = b**2 * tx + a**2 * ty
    return np.array([a, b, 1.0 if twist <= rz else np.sqrt(rz / twist)])


def _along(joints: tuple[Joint, ...], quantity: str) -> Real:
    """Return stiffness or damping in the order tx .. rz; (6,). Guides may be a little askew."""
    values = {_nearest_axis(joint): getattr(joint, quantity) for joint in joints}
    return np.array([values[dof] for dof in DIRECTIONS])


def _nearest_axis(joint: Joint) -> str:
    """Return tx .. rz by the largest part of the joint's axis."""
    letter = "t" if joint.kind == "slide" else "r"
    return f"{letter}{'xyz'[int(np.abs(joint.axis).argmax())]}"


def _world_axis(joint: Joint) -> str | None:
    """Return tx .. rz if the joint is along or about a world axis."""
    return _nearest_axis(joint) if np.abs(joint.axis).max() > 1 - 1e-9 else None


def _stands(stage: StageBody) -> bool:
    """Tell whether a stage has six springs through one point, along and about the world axes."""
    return (
        sorted(filter(None, map(_world_axis, stage.joints))) == sorted(DIRECTIONS)
        and all(joint.stiffness > 0 for joint in stage.joints)
        and np.ptp([joint.position for joint in stage.joints], axis=0).max() < 1e-9
    )


def draw_support_loss(
    random: np.random.Generator, scene: Scene, place: str | None
) -> SupportLoss | None:
    """Draw a stage that may stand on four supports, and one or two of them."""
    stages = scene.station.stages
    choices = [index for index, stage in enumerate(stages) if _stands(stage)]
    index = draw_stage(random, scene.station, place, "joint", choices)
    if index is None:
        return None
    count, first = choose(random, (1, 2)), choose(random, range(4))
    second = (first + choose(random, (1, 2, 3))) % 4
    whole = SupportLoss(
        stage=stages[index].name,
        lost=(first,) if count == 1 else tuple(sorted((first, second))),
        size=random.uniform(*LOST),
    )
    return replace(whole, near=(random.uniform(*NEAR), random.uniform(*NEAR)))
