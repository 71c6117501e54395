"""A joint whose centre of stiffness lies elsewhere than drawn: off-diagonal stiffness.

A slide i along a_i, whose spring acts at p from the drawn joint, is stretched by q_i + a_i.(R x p),
with R = sum a_j q_j over the hinges of the joint. So K becomes J' K J with

    J = 1 + B(p),   B_ij = a_i.(a_j x p),

and the slope by p_k is B_k' K J + J' K B_k. The bearing or leg that carries a stage along a slide
is spring and damper at once, so that C becomes J' C J.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.effects.scales import ARM_UNIT_M
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages, name_vector
from diagnosis.stated_values import Value
from identification.words import Real
from mbmodel import AddedPart, Change, Machine, Parameter, joint_coupling_writer


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint that both slides and turns on springs."""
    for stage in find_sprung_stages(scene.model.machine):
        coupling = _Coupling.find(scene, stage)
        if coupling is not None:
            yield Hypothesis(
                "joint_coupling",
                f"joint:{stage}",
                parts=(coupling.build_part(scene.model.machine),),
                follow=coupling.follow,
                state=coupling.state,
            )


@dataclass(frozen=True, eq=False)
class _Coupling:
    """Change J' K J - K and J' C J - C by an offset p of the springs and dampers of a joint.

    Only slides feel p. With their rows J_i, the change of K is sum k_i (J_i' J_i - e_i' e_i). The
    parameters are p, the k_i and the c_i, which follow those of the joint: fitted with fixed ones,
    an offset of some centimetres leaves far more than the noise.

    Args:
        stage: stage of the joint.
        arms: B by each coordinate of p, per unit of its parameter; (3, n_spring, n_spring).
        frame: directions of the springs; (nv, n_spring).
        acting: numbers of the slides whose stiffness varies, and of those whose damping does.
        follow: parameter of the model that each k_i and c_i follows, by name.
        start: fitted values of the k_i and c_i.
    """

    stage: str
    arms: Real
    frame: Real
    acting: tuple[list[int], list[int]]
    follow: Mapping[str, str]
    start: tuple[float, ...]

    @classmethod
    def find(cls, scene: Scene, stage: str) -> "_Coupling | None":
        """Return the coupling of a stage; None if its springs couple no slide with a hinge."""
        machine = scene.model.machine
        springs = find_own_springs(machine, stage)
        tuned = {parameter.name for parameter in scene.model.parameters}
        # A stiffness or damping that is drawn as zero stays zero: a free drive has a damper alone.
        stiff, damped = (
            [name for name in springs if f"{name}.{kind}" in tuned]
            for kind in ("stiffness", "damping")
        )
        arms = _find_arms(machine, stage, springs, {*stiff, *damped})
        slides = [springs[k] for k in np.flatnonzero(arms.any(axis=(0, 2)))]
        if not slides:
            return None
        stiff, damped = ([name for name in slides if name in names] for names in (stiff, damped))
        targets = [f"{name}.stiffness" for name in stiff] + [f"{name}.damping" for name in damped]
        values = [*scene.find_stiffness(tuple(stiff)), *scene.find_damping(tuple(damped))]
        directions = {spring.name: spring.direction for spring in machine.springs}
        return cls(
            stage,
            arms,
            np.array([directions[name] for name in springs]).T,
            ([springs.index(name) for name in stiff], [springs.index(name) for name in damped]),
            {f"{stage}.coupling({target})": target for target in targets},
            tuple(float(value) for value in values),
        )

    @property
    def offset_names(self) -> tuple[str, ...]:
        """Names of the components of p."""
        return name_vector(f"{self.stage}.offset_")

    def build_part(self, machine: Machine) -> AddedPart:
        """Return the Part with the coupling."""
        parameters = [
            Parameter(name, 0.0, f"{ARM_UNIT_M:g} m", positive=False) for name in self.offset_names
        ]
        units = ["N/m"] * len(self.acting[0]) + ["N s/m"] * len(self.acting[1])
        for name, unit, value in zip(self.follow, units, self.start, strict=True):
            parameters.append(Parameter(name, value, unit))
        written = joint_coupling_writer(f"{self.stage}.coupling", machine, self.compute_change)
        return AddedPart(
            f"joint:{self.stage}",
            tuple(parameters),
            self.compute_change,
            self.compute_slopes,
            written=written,
        )

    def _build_change(self, core: Real) -> Change:
        """Return the change by cores of stiffness and damping; (.., 2, n_spring, n_spring)."""
        whole = np.zeros((*core.shape[:-3], 3, *core.shape[-2:]))
        whole[..., :2, :, :] = core
        return Change("joint", self.frame, self.frame, whole)

    def _list_terms(self, theta: Real) -> Iterator[tuple[Real, Real, Real, Real]]:
        """Yield the rows J_i, e_i and B_ki and the sizes, of stiffness and then of damping."""
        turned = np.tensordot(theta[:3], self.arms, 1)
        sizes = np.split(theta[3:], [len(self.acting[0])])
        for size, acting in zip(sizes, self.acting, strict=True):
            unit_rows = np.eye(self.arms.shape[1])[acting]
            yield unit_rows + turned[acting], unit_rows, self.arms[:, acting], size

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change by an offset."""
        cores = [
            (rows.T * size) @ rows - (unit_rows.T * size) @ unit_rows
            for rows, unit_rows, _, size in self._list_terms(theta)
        ]
        return (self._build_change(np.array(cores)),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by the offset, then by each stiffness and damping."""
        core = np.zeros((len(theta), 2, *self.arms.shape[1:]))
        start = 3
        for power, (rows, unit_rows, arms, size) in enumerate(self._list_terms(theta)):
            half = arms.swapaxes(1, 2) @ (size[:, None] * rows)
            core[:3, power] = half + half.swapaxes(1, 2)
            end = start + len(size)
            core[start:end, power] = rows[:, :, None] * rows[:, None, :]
            core[start:end, power] -= unit_rows[:, :, None] * unit_rows[:, None, :]
            start = end
        return (self._build_change(core),)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the offset [m]."""
        return {"offset": tuple(ARM_UNIT_M * fitted[name] for name in self.offset_names)}


def _find_arms(machine: Machine, stage: str, springs: Sequence[str], acting: set[str]) -> Real:
    """Return B by each coordinate of p, per unit of its parameter; (3, n_spring, n_spring).

    Args:
        springs: names of its springs.
        acting: names of those with a stiffness or damping that varies.
    """
    axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
    arms = np.zeros((3, len(springs), len(springs)))
    for i, slide in enumerate(springs):
        for j, hinge in enumerate(springs):
            if slide in acting and axles[hinge].turns and not axles[slide].turns:
                turned = np.cross(axles[hinge].axis, ARM_UNIT_M * np.eye(3))
                arms[:, i, j] = turned @ axles[slide].axis
    return arms


EFFECT = Effect(
    propose,
    noun="a centre of stiffness elsewhere than drawn",
    means="the joint of {place} has its centre of stiffness elsewhere than drawn",
    confirm="measure where the springs or bearings of {place} act",
)
