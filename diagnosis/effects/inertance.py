r"""Mass that acts across a joint: a lever, a screw, a rotor behind a gear (an inerter).

An inertance b along the direction g of a joint answers the relative acceleration with a force,

    M += b g g',   Z += b s^2 g g'   (Smith 2002, IEEE Trans. Autom. Control 47, 1648-1662).

b is fitted in units of the mass or moment of inertia that the direction moves. A refit begins from
none and from that unit, as a Maxwell branch begins from one as stiff as its spring. An MJCF holds b
as the joint's ``armature``. Along the only direction in which a body on the ground moves, b is mass
of the body, an effect of its own, and is not proposed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.stated_values import Value
from identification.words import Real
from mbmodel import AddedPart, Change, Edit, Machine, Parameter


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each slide and hinge of the nominal model that moves a mass."""
    machine = scene.model.machine
    rigid, count = {r.coordinate for r in scene.rigid_directions}, len(machine.coordinates)
    for axle in machine.axles:
        coordinate, start = axle.coordinate, 6 * machine.layout.bodies.index(axle.stage)
        moving = np.flatnonzero(machine.jacobian[start : start + 6].any(axis=0))
        is_mass = set(moving.tolist()) - rigid == {coordinate}
        motion = axle.motion(count)
        mass = float(motion @ machine.mass @ motion) / float(motion @ motion) ** 2
        if coordinate in rigid or is_mass or not mass > 0:
            continue
        inerter = _Inerter(machine, axle.joint, motion, mass)
        place = f"joint:{axle.stage}"
        yield Hypothesis(
            "inertance",
            place,
            axle.dof,
            parts=(inerter.build_part(place, "kg m2" if axle.turns else "kg"),),
            signed=True,
            otherwise=({inerter.name: 1.0},),
            state=inerter.state,
        )


@dataclass(frozen=True, eq=False)
class _Inerter:
    """Inertance along a joint direction.

    Args:
        machine: machine with the joint.
        joint: name of the joint.
        motion: of the joint per coordinate of the machine; (nv,).
        unit: mass or moment of inertia that the joint moves [kg, kg m^2].
    """

    machine: Machine
    joint: str
    motion: Real
    unit: float

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return f"{self.joint}.inertance"

    def build_part(self, location: str, unit: str) -> AddedPart:
        """Return the Part with the inertance.

        Args:
            unit: kg or kg m2.
        """
        frame = self.motion[:, None]
        core = np.zeros((1, 3, 1, 1))
        core[0, 2] = self.unit
        parameter = Parameter(self.name, 0.0, f"{self.unit:g} {unit}", positive=False)
        part = AddedPart.linear(location, (parameter,), (Change("joint", frame, frame, core),))
        return replace(part, written=self.write)

    def write(self, theta: Real) -> tuple[Edit, ...]:
        """Return the armature of the joint, with that of the nominal model."""
        drawn = self.machine.drawing.joints[self.joint].armature
        return (Edit("spring", self.joint, {"armature": drawn + self.unit * float(theta[0])}),)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the inertance [kg, kg m^2]."""
        return {"inertance": self.unit * max(fitted[self.name], 0.0)}


EFFECT = Effect(
    propose,
    noun="mass that acts across a joint",
    means="the joint of {place} accelerates a mass {direction}: a lever, a screw, a rotor behind "
    "a gear",
    confirm="uncouple the drive or lever of {place} {direction} and repeat: the effect goes",
    undoes=True,
)
