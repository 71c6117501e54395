r"""A control loop as a known Part of a machine.

The controller reads y and drives the input u of the machine with negative feedback,

    u = -K(s) exp(-s tau) y,    y = sum of w s^k (J x + L b),   b = T x + U a / s^2,

with x the joint coordinates, b the absolute motion of the bodies, a the acceleration of the floor,
and k the derivative that each output reads. The force of u is T' P + m per unit, so that the loop
adds to the dynamic stiffness of the machine the term of rank one

    (T' P + m) K(s) exp(-s tau) sum of w s^k (J + L T).

Where the floor moves, its share L U a / s^2 of the reading is a further force on the machine.
The Part has no parameters. Its ports follow T, and so do the derivatives by all other parameters.
The law of a sampled controller is the part at the frequency itself (``loop_law``).
Sensors and forces of a loop are those of the drawing: tolerances of sensors and hammer act on the
recorded channels alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import Loop, Real, UsageError
from mbmodel.control_loops.loop_law import LoopLaw, continuous_equivalent
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import MjcfLack, NotInMjcf
from mbmodel.parts import Change, Parameter, PartContext
from mbmodel.ports.ports import find_ports


@dataclass(frozen=True, eq=False)
class LoopPart:
    """A closed control loop, known and without parameters.

    Args:
        loop: input, what is measured, controller and delay.
    """

    loop: Loop

    @property
    def location(self) -> str:
        """Place in the machine: ``loop:<name>``."""
        return f"loop:{self.loop.name}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the loop is known."""
        return ()

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the change of rank one at bodies and joints.

        Raises:
            UsageError: a port that the machine does not have, or a reading of forces or weight.
        """
        del theta
        machine, measured = context.machine, self.loop.measured
        outputs = [port for port, _ in measured.terms]
        ports = find_ports(machine, outputs, (self.loop.input,))
        if ports.further is not None:
            raise UsageError(
                f"loop {self.loop.name!r} reads {measured}, which measures forces or the weight in "
                "a tilting sensor: name a motion as its output, since only mbw predict --budget "
                "closes loops of force sensors"
            )
        core = np.zeros((3, 1, len(outputs)))
        for column, ((_, weight), order) in enumerate(
            zip(measured.terms, ports.orders, strict=True)
        ):
            core[measured.derivative if order is None else order, 0, column] = weight
        return (
            Change(
                "bodies_and_joints",
                np.vstack([ports.force, ports.motor]),
                np.vstack([ports.readout.T, ports.joint_readout.T]),
                core,
                shape=LoopLaw(self.loop.controller, self.loop.delay, *ports.activations),
            ),
        )

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return no derivatives, since there are no parameters."""
        del theta, context
        return ()

    def write(self, theta: Real) -> tuple[NotInMjcf, ...]:
        """Return that an MJCF has no element for a controller."""
        del theta
        return (NotInMjcf(self.location, MjcfLack.LOOP),)

    def select_held(self, theta: Real) -> Real:
        """Return theta: there are no parameters."""
        return theta


def loop_parts(machine: Machine) -> tuple[LoopPart, ...]:
    """Return the Parts of the loops that are closed around a machine."""
    return tuple(LoopPart(loop) for loop in machine.loops)


def with_loops(machine: Machine, loops: Sequence[Loop]) -> Machine:
    """Return a machine around which these loops are closed, and no others; variants alike.

    Args:
        machine: with or without loops.
        loops: with ports of the machine, by distinct names.

    Raises:
        UsageError: a port that the machine does not have, a reading of forces or weight, or a
            sampled controller with a pole at z = -1.
    """
    variants = {name: with_loops(each, loops) for name, each in machine.variants.items()}
    closed = replace(machine, loops=tuple(loops), variants=variants)
    for part in loop_parts(closed):
        try:
            continuous_equivalent(part.loop.controller)
        except UsageError as error:
            raise UsageError(f"loop {part.loop.name!r}: {error}") from error
        part.changes(np.zeros(0), PartContext(closed))
    return closed
