"""A joint whose centre of stiffness is not where it is drawn: off-diagonal stiffness.

Springs that act at p from the drawn joint feel a slide's elongation along a_i as q_i + a_i.(R x p),
R = sum a_j q_j over its hinges: J = 1 + B(p), B_ij = a_i.(a_j x p). So K becomes J' K J, with the
slope B_k' K + K B_k by each coordinate of p.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.effects.points import jointed, springs_of
from diagnosis.hypothesis import Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter

_UNIT = 0.01  # m per unit of the parameters


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint that both slides and turns on springs."""
    machine = scene.model.machine
    directions = {spring.name: spring.direction for spring in machine.springs}
    for stage in jointed(machine):
        springs = springs_of(machine, stage)
        axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
        stiffness = np.diag(scene.stiffness(springs))
        felt = np.zeros((3, len(springs), len(springs)))  # B_k per unit of p_k
        for k, unit in enumerate(np.eye(3)):
            for i, slide in enumerate(springs):
                for j, hinge in enumerate(springs):
                    if axles[hinge].turns and not axles[slide].turns:
                        arm = np.cross(axles[hinge].axis, _UNIT * unit)
                        felt[k, i, j] = axles[slide].axis @ arm
        if not felt.any():
            continue
        frame = np.array([directions[name] for name in springs]).T
        coupling = _Coupling(felt, stiffness, frame)
        names = tuple(f"{stage}.offset_{axis}" for axis in "xyz")
        parameters = tuple(Parameter(name, 0.0, "cm", positive=False) for name in names)
        part = AddedPart(f"joint:{stage}", parameters, coupling.finite, coupling.derivatives)

        def state(found: Mapping[str, float], offset: tuple[str, ...] = names) -> dict[str, Value]:
            return {"offset": tuple(_UNIT * found[name] for name in offset)}

        yield Hypothesis("joint_coupling", f"joint:{stage}", parts=(part,), state=state)


class _Coupling:
    """J' K J - K with J = 1 + B(p); B is linear in p, and B' K B stays where p is large."""

    def __init__(self, felt: Real, stiffness: Real, frame: Real) -> None:
        self.felt, self.stiffness, self.frame = felt, stiffness, frame

    def _change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
        whole[..., 0, :, :] = core
        return Change("joint", self.frame, self.frame, whole)

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Of an offset."""
        moved = np.eye(len(self.stiffness)) + np.tensordot(theta, self.felt, 1)
        return (self._change(moved.T @ self.stiffness @ moved - self.stiffness),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By its coordinates."""
        moved = np.eye(len(self.stiffness)) + np.tensordot(theta, self.felt, 1)
        half = self.felt.swapaxes(1, 2) @ self.stiffness @ moved
        return (self._change(half + half.swapaxes(1, 2)),)
