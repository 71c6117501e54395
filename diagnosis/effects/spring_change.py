"""Change of one spring or damper by a factor: K += (f - 1) k g g', of stiffness or damping.

The factor is fitted as theta = ln f, so that it cannot be negative, and k follows the fitted
stiffness of the state before. Without such a state, and without a prior that knows the spring, the
change is a row of the tuned parameters: a hypothesis exists only where the prior's standard
deviation of ln k is below 0.2.
"""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.stated_values import Value
from identification.words import Real
from mbmodel import AddedPart, Change, Edit, Parameter, Spring
from tuning.parametrisation.user_specification import FREE_RANGE_LOG

Coefficient = Literal["stiffness", "damping"]
MAX_KNOWN_DEVIATION = 0.2  # of ln k under its prior: FORMATS, the effects
_START_FACTORS = (0.7, 1.4)  # narrow modes leave their bandwidth at smaller changes


def propose_changes(scene: Scene, kind: Coefficient) -> Iterator[Hypothesis]:
    """Yield the change of each spring or damper whose size a prior or a state before knows.

    Args:
        scene: fit about which it is proposed.
        kind: what changes.
    """
    varies = scene.session.parametrisation
    number_of = {parameter.name: k for k, parameter in enumerate(varies.parameters)}
    dofs = {axle.joint: axle.dof for axle in scene.model.machine.axles}
    for spring in scene.model.machine.springs:
        name = f"{spring.name}.{kind}"
        k = number_of.get(name, -1)
        place = -1 if k < 0 else int(varies.coordinate_of[k])
        if place < 0 or not varies.precision[place]:
            continue
        deviation = float(varies.scale[k] / np.sqrt(varies.precision[place]))
        if deviation < MAX_KNOWN_DEVIATION:
            yield _propose_change(scene, spring, kind, dofs.get(spring.name))


def _propose_change(scene: Scene, spring: Spring, kind: Coefficient, dof: str | None) -> Hypothesis:
    """Return the change of one spring or damper."""
    size, follower = f"{spring.name}.{kind}_change", f"{spring.name}.{kind}_changed"
    fitted = scene.find_stiffness if kind == "stiffness" else scene.find_damping
    start = float(fitted((spring.name,))[0])
    power = 0 if kind == "stiffness" else 1

    def build(core: Real) -> tuple[Change, ...]:
        whole = np.zeros((*core.shape, 3, 1, 1))
        whole[..., power, 0, 0] = core
        if spring.at_bodies is None:
            frame = spring.direction[:, None]
            return (Change("joint", frame, frame, whole),)
        frame = spring.at_bodies[:, None]
        return (Change("body", frame, frame, whole),)

    def change(theta: Real) -> tuple[Change, ...]:
        return build(np.asarray(theta[1] * np.expm1(theta[0])))

    def slopes(theta: Real) -> tuple[Change, ...]:
        return build(np.array([theta[1] * np.exp(theta[0]), np.expm1(theta[0])]))

    def write(theta: Real) -> tuple[Edit, ...]:
        return (Edit("spring", spring.name, {kind: float(theta[1] * np.exp(theta[0]))}),)

    def state(values: Mapping[str, float]) -> dict[str, Value]:
        logarithm, before = values[size], values[follower]
        return {"factor": float(np.exp(logarithm)), "change": before * float(np.expm1(logarithm))}

    units = ("N m/rad", "N m s/rad") if spring.angular else ("N/m", "N s/m")
    parameters = (
        Parameter(size, 0.0, "1", positive=False),
        Parameter(follower, start, units[power]),
    )
    return Hypothesis(
        kind,
        spring.location,
        dof,
        parts=(AddedPart(spring.location, parameters, change, slopes, written=write),),
        scored=(size,),
        follow={follower: f"{spring.name}.{kind}"},
        bounds={size: (-FREE_RANGE_LOG, FREE_RANGE_LOG)},
        otherwise=tuple({size: float(np.log(factor))} for factor in _START_FACTORS),
        state=state,
    )
