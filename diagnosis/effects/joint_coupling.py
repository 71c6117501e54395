"""A joint whose centre of stiffness is not where it is drawn: off-diagonal stiffness.

Springs that act at p from the drawn joint feel a slide's elongation along a_i as q_i + a_i.(R x p),
R = sum a_j q_j over its hinges: J = 1 + B(p), B_ij = a_i.(a_j x p). So K becomes J' K J, with the
slope B_k' K + K B_k by each coordinate of p.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.effects.points import jointed, springs_of
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter, by_joints

_UNIT = 0.01  # m per unit of the parameters


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint that both slides and turns on springs."""
    machine = scene.model.machine
    directions = {spring.name: spring.direction for spring in machine.springs}
    tuned = {parameter.name for parameter in scene.model.parameters}
    for stage in jointed(machine):
        springs = springs_of(machine, stage)
        axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
        felt = np.zeros((3, len(springs), len(springs)))  # B_k per unit of p_k
        for k, unit in enumerate(np.eye(3)):
            for i, slide in enumerate(springs):
                for j, hinge in enumerate(springs):
                    stiff = f"{slide}.stiffness" in tuned  # drawn as zero it has none
                    if stiff and axles[hinge].turns and not axles[slide].turns:
                        arm = np.cross(axles[hinge].axis, _UNIT * unit)
                        felt[k, i, j] = axles[slide].axis @ arm
        if not felt.any():
            continue
        frame = np.array([directions[name] for name in springs]).T
        slides = [springs[k] for k in np.flatnonzero(felt.any(axis=(0, 2)))]
        coupling = _Coupling(felt, frame, [springs.index(name) for name in slides])
        names = tuple(f"{stage}.offset_{axis}" for axis in "xyz")
        parameters = [Parameter(name, 0.0, "cm", positive=False) for name in names]
        follow = {f"{stage}.coupling({name})": f"{name}.stiffness" for name in slides}
        for name, value in zip(follow, scene.stiffness(tuple(slides)).tolist(), strict=True):
            parameters.append(Parameter(name, value, "N/m"))
        part = AddedPart(
            f"joint:{stage}",
            tuple(parameters),
            coupling.finite,
            coupling.derivatives,
            written=by_joints(f"{stage}.coupling", machine, coupling.finite),
        )

        def state(found: Mapping[str, float], offset: tuple[str, ...] = names) -> dict[str, Value]:
            return {"offset": tuple(_UNIT * found[name] for name in offset)}

        yield Hypothesis(
            "joint_coupling", f"joint:{stage}", parts=(part,), follow=follow, state=state
        )


class _Coupling:
    """J' K J - K with J = 1 + B(p); B is linear in p, and B' K B stays where p is large.

    Only slides feel p. With the rows J_i of theirs it is sum k_i (J_i' J_i - e_i' e_i). Parameters
    are p and the k_i, which follow those of the joint: fitted with another one, an offset of some
    centimetres leaves far more than the noise.
    """

    def __init__(self, felt: Real, frame: Real, slides: list[int]) -> None:
        self.felt, self.frame, self.slides = felt, frame, slides

    def _change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
        whole[..., 0, :, :] = core
        return Change("joint", self.frame, self.frame, whole)

    def _rows(self, offset: Real) -> tuple[Real, Real]:
        """J_i, e_i of the slides; (n_slide, n_spring) each."""
        own = np.eye(self.felt.shape[1])[self.slides]
        return own + np.tensordot(offset, self.felt, 1)[self.slides], own

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Of an offset."""
        rows, own = self._rows(theta[:3])
        stiffness = theta[3:]
        return (self._change((rows.T * stiffness) @ rows - (own.T * stiffness) @ own),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By its coordinates, then by each stiffness."""
        rows, own = self._rows(theta[:3])
        half = self.felt[:, self.slides].swapaxes(1, 2) @ (theta[3:, None] * rows)
        by_stiffness = rows[:, :, None] * rows[:, None, :] - own[:, :, None] * own[:, None, :]
        return (self._change(np.concatenate([half + half.swapaxes(1, 2), by_stiffness])),)


EFFECT = Effect(
    propose,
    noun="a centre of stiffness elsewhere than drawn",
    means="the centre of stiffness is elsewhere than drawn",
    confirm="measure where the springs or bearings of {place} act",
)
