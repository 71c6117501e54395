r"""A stage on four supports of which some do not carry: a granite on two of four levelers.

A joint with three slides and three hinges along the world axes stands for four supports at
(+-a, +-b) about its point, each with a quarter of the slides' stiffness. Their levers are what
makes the hinges' stiffness,

    a^2 k_tz = k_ry,   b^2 k_tz = k_rx,   g^2 (b^2 k_tx + a^2 k_ty) <= k_rz,   g <= 1,

z the world's third axis. A support at p = (x, y) stretches slide i by q_i + a_i.(R x p), p
shrunk by g for the horizontal ones, and one that has lost theta takes

    theta / 4 (k_i g_i g_i' + s c_i g_i g_i')   summed over the slides

from the joint; dampers stand no farther out than their hinges allow.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from diagnosis.effects.points import jointed, springs_of
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter, by_joints

_CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
_ALONG = 1 - 1e-6  # cosine with a world axis


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint that may stand on four supports."""
    machine = scene.model.machine
    for stage in jointed(machine):
        springs = _six(scene, stage)
        if springs is None:
            continue
        stiffness, damping = scene.stiffness(springs), scene.damping(springs)
        if not (stiffness > 0).all():
            continue
        far = _levers(stiffness)
        near = np.minimum(_levers(damping), far)
        directions = {spring.name: spring.direction for spring in machine.springs}
        frame = np.array([directions[name] for name in springs]).T
        core = np.zeros((4, 3, 6, 6))
        for number, corner in enumerate(_CORNERS):
            for power, values, levers in ((0, stiffness, far), (1, damping, near)):
                rows = _felt(corner, levers)
                core[number, power] = -(rows.T * values[:3]) @ rows / 4
        names = tuple(f"{stage}.lost{number}" for number in range(4))
        parameters = tuple(Parameter(name, 0.0, "1", positive=False) for name in names)
        part = AddedPart.linear(
            f"joint:{stage}", parameters, (Change("joint", frame, frame, core),)
        )
        part = replace(part, written=by_joints(f"{stage}.lost", machine, part.finite))

        def state(found: Mapping[str, float], lost: tuple[str, ...] = names) -> dict[str, Value]:
            return {"fraction": tuple(1 - found[name] for name in lost)}

        yield Hypothesis(
            "support_loss",
            f"joint:{stage}",
            parts=(part,),
            signed=True,
            at_most=1.0,
            springs=springs,
            state=state,
        )


def _six(scene: Scene, stage: str) -> tuple[str, ...] | None:
    """Springs in the order tx .. rz, if the stage has just these, through one point."""
    machine = scene.model.machine
    springs = springs_of(machine, stage)
    axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
    if len(springs) != 6 or len(axles) != 6:
        return None
    places: dict[int, str] = {}
    for name in springs:
        axle = axles[name]
        axis = int(np.abs(axle.axis).argmax())
        if axle.axis[axis] > _ALONG:
            places[axis + 3 * axle.turns] = name
    anchors = np.array([axle.anchor for axle in axles.values() if axle.turns])
    if len(places) != 6 or np.ptp(anchors, axis=0).max() > 1e-9:
        return None
    return tuple(places[k] for k in range(6))


def _levers(along: Real) -> Real:
    """A, b [m] and g that the hinges allow; (3,)."""
    tx, ty, tz, rx, ry, rz = along
    a, b = (np.sqrt(ry / tz), np.sqrt(rx / tz)) if tz > 0 else (0.0, 0.0)
    twist = b**2 * tx + a**2 * ty
    return np.array([a, b, np.sqrt(min(1.0, rz / twist)) if twist > 0 else 1.0])


def _felt(corner: tuple[int, int], levers: Real) -> Real:
    """Stretch of the three slides at a support per joint coordinate tx .. rz; (3, 6)."""
    a, b, flat = levers
    x, y = corner[0] * a, corner[1] * b
    rows = np.eye(3, 6)
    rows[0, 5], rows[1, 5] = -flat * y, flat * x
    rows[2, 3], rows[2, 4] = y, -x
    return rows


EFFECT = Effect(
    propose,
    noun="supports that do not carry",
    means="a support of the joint carries nothing",
    confirm="shim or adjust the support of {place} that has lost most and repeat",
)
