"""A joint whose centre of stiffness is not where it is drawn: off-diagonal stiffness.

Springs that act at p from the drawn joint feel a slide's elongation along a_i as q_i + a_i.(R x p),
R = sum a_j q_j over its hinges: J = 1 + B(p), B_ij = a_i.(a_j x p). So K becomes J' K J, with the
slope B_k' K + K B_k by each coordinate of p. What holds a stage where it slides, bearing or leg, is
spring and damper at once: dampers go along, C becomes J' C J.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from diagnosis.effects.points import find_own_springs, find_sprung_stages
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter, joint_coupling_writer

_OFFSET_UNIT_M = 0.01  # m per unit of the parameters


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint that both slides and turns on springs."""
    machine = scene.model.machine
    directions = {spring.name: spring.direction for spring in machine.springs}
    tuned = {parameter.name for parameter in scene.model.parameters}
    for stage in find_sprung_stages(machine):
        springs = find_own_springs(machine, stage)
        # What is drawn as zero stays zero; a free drive has a damper alone.
        stiff, damped = (
            {name for name in springs if f"{name}.{what}" in tuned}
            for what in ("stiffness", "damping")
        )
        holding = stiff | damped
        axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
        felt = np.zeros((3, len(springs), len(springs)))  # B_k per unit of p_k
        for k, unit in enumerate(np.eye(3)):
            for i, slide in enumerate(springs):
                for j, hinge in enumerate(springs):
                    if slide in holding and axles[hinge].turns and not axles[slide].turns:
                        arm = np.cross(axles[hinge].axis, _OFFSET_UNIT_M * unit)
                        felt[k, i, j] = axles[slide].axis @ arm
        if not felt.any():
            continue
        frame = np.array([directions[name] for name in springs]).T
        slides = [springs[k] for k in np.flatnonzero(felt.any(axis=(0, 2)))]
        held, slowed = ([name for name in slides if name in subset] for subset in (stiff, damped))
        acting = [[springs.index(name) for name in subset] for subset in (held, slowed)]
        coupling = _Coupling(felt, frame, acting)
        names = tuple(f"{stage}.offset_{axis}" for axis in "xyz")
        parameters = [Parameter(name, 0.0, "cm", positive=False) for name in names]
        units = {f"{name}.stiffness": "N/m" for name in held}
        units |= {f"{name}.damping": "N s/m" for name in slowed}
        drawn = [*scene.find_stiffness(tuple(held)), *scene.find_damping(tuple(slowed))]
        follow = {f"{stage}.coupling({name})": name for name in units}
        for name, measure, value in zip(follow, units.values(), drawn, strict=True):
            parameters.append(Parameter(name, float(value), measure))
        part = AddedPart(
            f"joint:{stage}",
            tuple(parameters),
            coupling.finite,
            coupling.derivatives,
            written=joint_coupling_writer(f"{stage}.coupling", machine, coupling.finite),
        )

        def state(fitted: Mapping[str, float], offset: tuple[str, ...] = names) -> dict[str, Value]:
            return {"offset": tuple(_OFFSET_UNIT_M * fitted[name] for name in offset)}

        yield Hypothesis(
            "joint_coupling", f"joint:{stage}", parts=(part,), follow=follow, state=state
        )


class _Coupling:
    """J' K J - K and J' C J - C with J = 1 + B(p); B is linear in p, and B' K B stays for large p.

    Only slides feel p. With the rows J_i of theirs it is sum k_i (J_i' J_i - e_i' e_i). Parameters
    are p, the k_i and the c_i, which follow those of the joint: fitted with others, an offset of
    some centimetres leaves far more than the noise.

    Args:
        felt: B by each coordinate of p; (3, n_spring, n_spring).
        frame: directions of the springs; (nv, n_spring).
        acting: which of them have k and which have c.
    """

    def __init__(self, felt: Real, frame: Real, acting: Sequence[list[int]]) -> None:
        self.felt, self.frame, self.acting = felt, frame, acting

    def _change(self, core: Real) -> Change:
        """Of stiffness and damping; (.., 2, n_spring, n_spring)."""
        whole = np.zeros((*core.shape[:-3], 3, *core.shape[-2:]))
        whole[..., :2, :, :] = core
        return Change("joint", self.frame, self.frame, whole)

    def _terms(self, theta: Real) -> Iterator[tuple[Real, Real, Real, Real]]:
        """Of stiffness, then of damping, J_i and e_i; B_ki; (3, n, n_spring); k_i or c_i."""
        turned = np.tensordot(theta[:3], self.felt, 1)
        sizes = np.split(theta[3:], [len(self.acting[0])])
        for size, acting in zip(sizes, self.acting, strict=True):
            unit_rows = np.eye(self.felt.shape[1])[acting]
            yield unit_rows + turned[acting], unit_rows, self.felt[:, acting], size

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Of an offset."""
        cores = [
            (rows.T * size) @ rows - (unit_rows.T * size) @ unit_rows
            for rows, unit_rows, _, size in self._terms(theta)
        ]
        return (self._change(np.array(cores)),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By its coordinates, then by each stiffness and damping."""
        core = np.zeros((len(theta), 2, *self.felt.shape[1:]))
        start = 3
        for power, (rows, unit_rows, felt, size) in enumerate(self._terms(theta)):
            half = felt.swapaxes(1, 2) @ (size[:, None] * rows)
            core[:3, power] = half + half.swapaxes(1, 2)
            end = start + len(size)
            core[start:end, power] = rows[:, :, None] * rows[:, None, :]
            core[start:end, power] -= unit_rows[:, :, None] * unit_rows[:, None, :]
            start = end
        return (self._change(core),)


EFFECT = Effect(
    propose,
    noun="a centre of stiffness elsewhere than drawn",
    means="the joint of {place} has its centre of stiffness elsewhere than drawn",
    confirm="measure where the springs or bearings of {place} act",
)
