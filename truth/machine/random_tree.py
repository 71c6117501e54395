"""Random machines: trees of three to ten stages on the floor, each on springs and dampers.

Sizes, masses and frequencies are those of precision machines: the first stage is the heaviest, a
stage sits on its parent or beside its siblings, most suspension modes lie between 10 and 150 Hz.
"""

import numpy as np

from truth.machine.station import GROUND, HitPoint, Joint, Real, Sensor, Shape, StageBody, Station
from truth.random_streams import stream

STAGES = (3, 10)
_BASE_MASS = (300.0, 3000.0)  # kg
_LIGHTER = (0.15, 0.8)  # of the parent's mass
_DENSITY = (800.0, 3000.0)  # kg/m3 of a stage's box, which is partly empty
_FLATNESS = (0.3, 1.0)  # height over width
_FREQUENCY_HZ = (15.0, 120.0)  # of a stage and all that it carries, on its joint alone
_DAMPING_RATIO = (0.01, 0.06)
_RIGID = 0.25  # of the stages have one or two directions without a joint
_BRANCH = 0.25  # of the stages stand beside another on the same parent
_CORNERS = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, -1]], float)


def draw_tree(seed: int, count: int | None = None) -> Station:
    """Draw a machine of 3 to 10 stages.

    Args:
        seed: of all draws.
        count: number of stages; drawn if None.
    """
    random = stream(seed, "tree")
    number = int(random.integers(STAGES[0], STAGES[1] + 1))
    number = number if count is None else count
    parents = _parents(random, number)
    boxes = _boxes(random, parents)
    carried = [mass for _, _, mass in boxes]
    for index in range(number - 1, 0, -1):
        if parents[index] != GROUND:
            carried[parents[index]] += carried[index]
    hit = int(random.integers(number))
    stages = []
    for index, (box, mass) in enumerate(zip(boxes, carried, strict=True)):
        stages.append(_stage(random, index, parents[index], box, mass, hit == index))
    return Station(f"tree{number}", tuple(stages))  # the name is in the drawing: no seed in it


def _parents(random: np.random.Generator, number: int) -> list[int]:
    """Mostly a stack; a branch goes back to a stage further down."""
    parents = [GROUND]
    for index in range(1, number):
        back = int(random.integers(0, index))
        parents.append(back if random.random() < _BRANCH else index - 1)
    return parents


Box = tuple[Real, Real, float]  # centre [m], half sizes [m], mass [kg]


def _boxes(random: np.random.Generator, parents: list[int]) -> list[Box]:
    """Boxes, each on top of its parent."""
    boxes: list[Box] = []
    for parent in parents:
        share = random.uniform(*_LIGHTER)
        base = np.exp(random.uniform(*np.log(_BASE_MASS)))
        mass = float(base if parent == GROUND else max(share * boxes[parent][2], 2.0))
        volume = mass / random.uniform(*_DENSITY)
        wide = (volume / np.prod(ratios := np.array([1.0, 1.0, random.uniform(*_FLATNESS)]))) ** (
            1 / 3
        )
        half = wide * ratios * random.uniform(0.85, 1.15, 3) / 2
        shift = random.uniform(-0.4, 0.4, 2)
        if parent == GROUND:
            centre = np.array([0.0, 0.0, half[2]])
        else:
            below, size, _ = boxes[parent]
            centre = below + np.array([*(shift * size[:2]), size[2] + half[2] + 0.02])
        boxes.append((centre, half, mass))
    return boxes


def _stage(
    random: np.random.Generator, index: int, parent: int, box: Box, carried: float, hit: bool
) -> StageBody:
    centre, half, mass = box
    name = f"stage{index + 1}"
    com = centre + random.uniform(-0.1, 0.1, 3) * half
    square = (2 * half * random.uniform(0.9, 1.1, 3)) ** 2 / 12
    inertia = mass * np.diag(square.sum() - square)
    place = centre + np.array([0.0, 0.0, -half[2] - 0.01])
    first = 10 * (index + 1)
    sensors = tuple(
        Sensor(first + number + 1, centre + corner * half * random.uniform(0.8, 1.0, 3))
        for number, corner in enumerate(_CORNERS[: int(random.integers(3, 5))])
    )
    sizes = " ".join(f"{value:.6g}" for value in half)
    where = " ".join(f"{value:.6g}" for value in centre)
    return StageBody(
        name=name,
        parent=parent,
        mass=mass,
        com=com,
        inertia=inertia,
        joints=_joints(random, name, place, carried, half),
        sensors=sensors,
        hit_points=(HitPoint(first + 9, centre + half * [1.0, 1.0, 0.6]),) if hit else (),
        shapes=(
            Shape(
                (
                    ("type", "box"),
                    ("size", sizes),
                    ("pos", where),
                    ("contype", "0"),
                    ("conaffinity", "0"),
                    ("mass", "0"),
                )
            ),
        ),
    )


def _joints(
    random: np.random.Generator, name: str, place: Real, carried: float, half: Real
) -> tuple[Joint, ...]:
    """Springs in six directions, some of them left out: rigid there."""
    rigid: set[int] = set()
    missing = random.permutation(6)[: int(random.integers(1, 3))]
    if random.random() < _RIGID:
        rigid = set(missing.tolist())
    joints = []
    for number in range(6):
        frequency = float(np.exp(random.uniform(*np.log(_FREQUENCY_HZ))))
        damping = random.uniform(*_DAMPING_RATIO)
        axis = np.eye(3)[number % 3]
        lever = float(np.linalg.norm(np.delete(half, number % 3))) if number >= 3 else 1.0
        stiffness = carried * lever**2 * (2 * np.pi * frequency) ** 2
        joints.append(
            Joint(
                name=f"{name}_{'tr'[number // 3]}{'xyz'[number % 3]}",
                kind="slide" if number < 3 else "hinge",
                axis=axis,
                position=place,
                stiffness=stiffness,
                damping=2 * damping * stiffness / (2 * np.pi * frequency),
            )
        )
    return tuple(joint for number, joint in enumerate(joints) if number not in rigid)
