r"""A direction that is rigid in the nominal model gives way, along or about an axis of its joint.

The machine of the scene has a coordinate for each rigid direction, on a spring k0 far stiffer than
anything in the band, and a damper k0 tau (``mbmodel.compliance.released_directions``). A direction
of a joint that stands askew has the name of the nearest world axis. A compliance theta u, theta >=
0, in series with the spring makes them

    k + s c,   k = 1 / (1 / k0 + theta u),   c = k tau.

FRFs change in proportion to a small theta, and the slope for the score test is

    d(k + s c) / dtheta = -u k^2 (1 + s tau).

This slope tells little: the fit without the effect has softer springs instead, and another bit of
compliance explains nothing. Refits also begin at a stiffness like its neighbours'.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.effects.scales import LOG_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs
from diagnosis.stated_values import Value
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
    """Yield one for each rigid direction of each joint."""
    for rigid in scene.rigid_directions:
        frame = np.zeros((len(scene.model.machine.coordinates), 1))
        frame[rigid.coordinate] = 1.0
        released = _ReleasedDirection(scene.model.machine, rigid, frame)
        compliance, time_constant = released.names
        start = released.find_compliance(_guess_stiffness(scene, rigid))
        yield Hypothesis(
            "missing_dof",
            f"joint:{rigid.stage}",
            rigid.dof,
            parts=(released.part,),
            scored=(compliance,),
            signed=True,
            is_slope_informative=False,
            bounds={time_constant: (-MAX_LOG_STEPS, MAX_LOG_STEPS)},
            otherwise=({compliance: start},),
            state=released.state,
        )


def _guess_stiffness(scene: Scene, rigid: RigidDirection) -> float:
    """Return the median stiffness of the slides, or hinges, of the joint.

    Without one it is a stiffness that shows in the band.
    """
    machine = scene.model.machine
    turns = {axle.joint: axle.turns for axle in machine.axles if axle.stage == rigid.stage}
    springs = find_own_springs(machine, rigid.stage)
    is_hinge = rigid.dof.startswith("r")
    sizes = scene.find_stiffness(tuple(name for name in springs if turns.get(name) is is_hinge))
    return float(np.median(sizes[sizes > 0])) if (sizes > 0).any() else rigid.reference


@dataclass(frozen=True, eq=False)
class _ReleasedDirection:
    """Compliance in series with the spring that locks a rigid direction.

    Args:
        machine: machine with a coordinate for the direction.
        rigid: rigid direction.
        frame: its coordinate; (nv, 1).
    """

    machine: Machine
    rigid: RigidDirection
    frame: Real

    @property
    def names(self) -> tuple[str, str]:
        """Names of compliance and time constant."""
        name = f"{self.rigid.stage}.{self.rigid.dof}"
        return f"{name}.compliance", f"{name}.time_constant"

    @property
    def _unit(self) -> float:
        """Unit u of the compliance [m/N, rad/(N m)]."""
        return 1 / self.rigid.reference

    @property
    def part(self) -> AddedPart:
        """Part with the compliance."""
        compliance, time_constant = self.names
        parameters = (
            Parameter(compliance, 0.0, f"{self._unit:g} /k", positive=False),
            Parameter(time_constant, 0.0, f"{LOG_UNIT:.0%}", positive=False),
        )
        place = f"joint:{self.rigid.stage}"
        return AddedPart(
            place, parameters, self.compute_change, self.compute_slopes, written=self.write
        )

    def _spring_and_time(self, theta: Real) -> tuple[float, float]:
        """Return stiffness and time constant [s]."""
        compliance = 1 / self.rigid.stiffness + max(float(theta[0]), 0.0) * self._unit
        return 1 / compliance, self.rigid.time_constant * float(np.exp(LOG_UNIT * theta[1]))

    def find_compliance(self, stiffness: float) -> float:
        """Return the compliance parameter of a stiffness."""
        return max(1 / stiffness - 1 / self.rigid.stiffness, 0.0) / self._unit

    def _build_change(self, core: Real) -> Change:
        return Change("joint", self.frame, self.frame, core[..., None, None])

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return what remains of stiffness and damping, less the original ones."""
        stiffness, tau = self._spring_and_time(theta)
        locked = self.rigid.stiffness
        damping = stiffness * tau - locked * self.rigid.time_constant
        return (self._build_change(np.array([stiffness - locked, damping, 0.0])),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by the compliance and by the logarithm of the time constant."""
        stiffness, tau = self._spring_and_time(theta)
        softer = -self._unit * stiffness**2
        # While the direction is locked, the time constant has next to no curvature: a wild step.
        damping = LOG_UNIT * stiffness * tau if theta[0] > 0 else 0.0
        core = np.array([[softer, softer * tau, 0.0], [0.0, damping, 0.0]])
        return (self._build_change(core),)

    def write(self, theta: Real) -> tuple[Addition, ...]:
        """Return a joint on a spring and a damper."""
        stiffness, tau = self._spring_and_time(theta)
        coordinate = self.rigid.coordinate
        axle = next(
            candidate for candidate in self.machine.axles if candidate.coordinate == coordinate
        )
        sizes = np.array([stiffness, stiffness * tau])
        name = self.machine.written_name(self.machine.coordinates[coordinate])
        return released_joint_elements(name, self.machine, axle, sizes)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return stiffness and damping [SI]."""
        stiffness, tau = self._spring_and_time(np.array([fitted[name] for name in self.names]))
        return {"stiffness": stiffness, "damping": stiffness * tau}


EFFECT = Effect(
    propose,
    noun="a direction drawn rigid that gives way",
    means="the joint of {place} gives way {direction}, where the drawing holds it rigid",
    confirm="put sensors on both sides of the joint of {place}: {direction}, or its own axis "
    "nearest to that, they differ",
)
