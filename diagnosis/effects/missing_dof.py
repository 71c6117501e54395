r"""A direction that the drawing holds rigid gives way, along or about an axis of the joint's own.

The machine of the scene has a coordinate for each such direction, on a spring k0 far stiffer than
anything in the band and a damper k0 tau (``mbmodel.compliance.released_directions``). Where the
joint stands askew, the direction has the name of the world axis that it is nearest to. In series
with a compliance theta u, theta >= 0, they become

    k + s c,   k = 1 / (1 / k0 + theta u),   c = k tau.

For small compliances FRFs change in proportion to theta: that is the score's slope,
d(k + s c) / dtheta = -u k^2 (1 + s tau), a compliance u / (1 + s tau).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.effects.points import find_own_springs
from diagnosis.effects.scales import LOG_TIME_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import (
    AddedPart,
    Addition,
    Change,
    Machine,
    Parameter,
    RigidDirection,
    released_joint_elements,
)


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each rigid direction of each joint."""
    for held in scene.rigid_directions:
        frame = np.zeros((len(scene.model.machine.coordinates), 1))
        frame[held.coordinate] = 1.0
        way = _Way(scene.model.machine, held, frame)
        yield Hypothesis(
            "missing_dof",
            f"joint:{held.stage}",
            held.dof,
            parts=(way.part,),
            scored=(way.names[0],),
            signed=True,
            bounds={way.names[1]: (-MAX_LOG_STEPS, MAX_LOG_STEPS)},
            otherwise=({way.names[0]: way.compliance(_usual(scene, held))},),
            state=way.state,
        )


def _usual(scene: Scene, held: RigidDirection) -> float:
    """Stiffness of the joint's own springs of the kind, else one that shows in the band."""
    machine = scene.model.machine
    kind = {axle.joint: axle.turns for axle in machine.axles if axle.stage == held.stage}
    turns = held.dof.startswith("r")
    alike = tuple(
        spring for spring in find_own_springs(machine, held.stage) if kind.get(spring) is turns
    )
    sizes = scene.find_stiffness(alike)
    return float(np.median(sizes[sizes > 0])) if (sizes > 0).any() else held.reference


class _Way:
    """Stiffness that a direction has lost of the one that holds it."""

    def __init__(self, machine: Machine, held: RigidDirection, frame: Real) -> None:
        self.machine, self.held, self.frame = machine, held, frame
        name = f"{held.stage}.{held.dof}"
        self.unit = 1 / held.reference
        self.names = f"{name}.compliance", f"{name}.time_constant"

    @property
    def part(self) -> AddedPart:
        """As a Part."""
        parameters = (
            Parameter(self.names[0], 0.0, f"{self.unit:g} /k", positive=False),
            Parameter(self.names[1], 0.0, "50 %", positive=False),
        )
        place = f"joint:{self.held.stage}"
        return AddedPart(place, parameters, self.finite, self.derivatives, written=self.write)

    def _at(self, theta: Real) -> tuple[float, float]:
        stiffness = 1 / (1 / self.held.stiffness + max(float(theta[0]), 0.0) * self.unit)
        return stiffness, self.held.time_constant * float(np.exp(LOG_TIME_UNIT * theta[1]))

    def compliance(self, stiffness: float) -> float:
        """The parameter for a stiffness."""
        return max(1 / stiffness - 1 / self.held.stiffness, 0.0) / self.unit

    def _change(self, core: Real) -> Change:
        return Change("joint", self.frame, self.frame, core[..., None, None])

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Stiffness that remains, less the original one."""
        stiffness, tau = self._at(theta)
        held = self.held.stiffness
        damping = stiffness * tau - held * self.held.time_constant
        return (self._change(np.array([stiffness - held, damping, 0.0])),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By the compliance and by the logarithm of the time constant."""
        stiffness, tau = self._at(theta)
        softer = -self.unit * stiffness**2
        # While all is held nothing shows the time constant: next to no curvature, a wild step.
        damping = LOG_TIME_UNIT * stiffness * tau if theta[0] > 0 else 0.0
        core = np.array([[softer, softer * tau, 0.0], [0.0, damping, 0.0]])
        return (self._change(core),)

    def write(self, theta: Real) -> tuple[Addition, ...]:
        """A joint."""
        stiffness, tau = self._at(theta)
        coordinate = self.held.coordinate
        axle = next(
            candidate for candidate in self.machine.axles if candidate.coordinate == coordinate
        )
        sizes = np.array([stiffness, stiffness * tau])
        return released_joint_elements(
            f"{self.held.stage}_{self.held.dof}", self.machine, axle, sizes
        )

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Stiffness and damping in SI."""
        stiffness, tau = self._at(np.array([fitted[name] for name in self.names]))
        return {"stiffness": stiffness, "damping": stiffness * tau}


EFFECT = Effect(
    propose,
    noun="a direction drawn rigid that gives way",
    means="the joint of {place} gives way {direction}, where the drawing holds it rigid",
    confirm="put sensors on both sides of the joint of {place}: {direction}, or its own axis "
    "nearest to that, they differ",
)
