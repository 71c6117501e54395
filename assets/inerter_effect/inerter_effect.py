"""A ball screw or a flywheel that turns as two bodies move apart: force b times their acceleration.

Along one direction of a joint the dynamic stiffness gains b s^2: one Part with one parameter, the
inertance b, whose slope is the same at any b.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis import Effect, Hypothesis, Scene
from mbmodel import AddedPart, Change, Parameter

_UNIT = 0.01  # of the mass that moves: what a step of the fit is about


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each slide and hinge."""
    machine = scene.model.machine
    for axle in machine.axles:
        name = f"{axle.joint}.inertance"
        moved = machine.jacobian[:, axle.coordinate]
        unit = _UNIT * float(moved @ machine.body_mass @ moved)
        frame = np.zeros((len(machine.coordinates), 1))
        frame[axle.coordinate] = 1.0
        core = np.zeros((1, 3, 1, 1))
        core[0, 2] = unit  # the power s^2
        part = AddedPart.linear(
            f"joint:{axle.stage}",
            (Parameter(name, 0.0, f"{unit:g} {'kg m2' if axle.turns else 'kg'}", positive=False),),
            (Change("joint", frame, frame, core),),
        )

        def state(
            found: Mapping[str, float], own: str = name, unit: float = unit
        ) -> dict[str, float]:
            return {"inertance": unit * found[own]}

        yield Hypothesis(
            "inerter",
            f"joint:{axle.stage}",
            axle.dof,
            parts=(part,),
            signed=True,
            state=state,
        )


EFFECT = Effect(
    propose,
    noun="an inerter",
    means="a ball screw or flywheel turns as the bodies move apart",
    confirm="uncouple the drive of {place} {direction} and repeat",
)
