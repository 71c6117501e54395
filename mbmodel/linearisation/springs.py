"""Linear springs and dampers of joints and tendons, at static equilibrium."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from identification.words import Complex, InputError, Real
from mbmodel.linearisation.force_slopes import symmetrise_rotations
from mbmodel.linearisation.tendon_slopes import (
    tendon_curvature,
    tendon_elongation,
    tendon_jacobian,
)
from mbmodel.mjcf.names import body_name, coordinate_names, tendon_name
from mbmodel.mjcf.stages import stage_of
from mbmodel.mjcf.tendons import tendon_body_jacobian


@dataclass(frozen=True)
class DrawnLaw:
    """A law of the nominal model that adds size k f(s) to a spring of stiffness k; f(0) = 0.

    Args:
        name: ``loss_factor`` or ``maxwell``.
        size: loss factor, or ratio of a Maxwell branch to the static stiffness.
        shape: f(s).
    """

    name: str
    size: float
    shape: Callable[[Complex], Complex]


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring and damper along one direction of the joint coordinates.

    Args:
        name: of the joint or tendon in the MJCF.
        location: ``joint:<child body>`` or ``tendon:<name>``.
        direction: elongation per joint coordinate; (nv,).
        stiffness: [N/m] or [N m/rad].
        damping: [N s/m] or [N m s/rad].
        angular: whether it is rotational.
        geometric: for a tendon under tension, elongation at rest times the derivative of the
            direction by the joint coordinates: it adds stiffness * geometric; (nv, nv).
        at_bodies: for a tendon between sites, elongation per motion of the centres of mass: with
            T it gives the direction; (6 n_body,).
        laws: loss factor and Maxwell branches of the nominal model; they scale with the stiffness.
        has_law_text: whether a text of the MJCF states the laws.
    """

    name: str
    location: str
    direction: Real
    stiffness: float
    damping: float
    angular: bool
    geometric: Real | None = None
    at_bodies: Real | None = None
    laws: tuple[DrawnLaw, ...] = ()
    has_law_text: bool = False


def find_springs(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    path: Path,
    stages: list[int],
    centres: tuple[Real, ...],
) -> tuple[Spring, ...]:
    """Return every spring of a machine at rest, joints first.

    Args:
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.

    Raises:
        InputError: a tendon and a joint with one name.
    """
    pulls = tendon_body_jacobian(model, data, stages, centres)
    springs = _joint_springs(model) + _tendon_springs(model, data, pulls)
    names = [spring.name for spring in springs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: a tendon and a joint are both named {name!r}: rename one")
    return springs


def _joint_springs(model: mujoco.MjModel) -> tuple[Spring, ...]:
    """Return a spring for each slide and hinge, and a damper for each ball or free coordinate."""
    springs = []
    names = coordinate_names(model)
    for dof in range(model.nv):
        joint = model.dof_jntid[dof]
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        single = kind in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
        translating_free = kind == mujoco.mjtJoint.mjJNT_FREE and dof - model.jnt_dofadr[joint] < 3
        stage = stage_of(model, model.dof_bodyid[dof])
        direction = np.zeros(model.nv)
        direction[dof] = 1.0
        springs.append(
            Spring(
                name=names[dof],
                location=f"joint:{body_name(model, stage)}",
                direction=direction,
                stiffness=float(model.jnt_stiffness[joint]) if single else 0.0,
                damping=float(model.dof_damping[dof]),
                angular=kind != mujoco.mjtJoint.mjJNT_SLIDE and not translating_free,
            )
        )
    return tuple(springs)


def _tendon_springs(
    model: mujoco.MjModel, data: mujoco.MjData, pulls: Mapping[int, Real]
) -> tuple[Spring, ...]:
    """Return a spring for each tendon; inside its dead band it has no stiffness."""
    rows = tendon_jacobian(model, data)
    slack = (model.tendon_lengthspring[:, 0] < data.ten_length) & (
        data.ten_length < model.tendon_lengthspring[:, 1]
    )
    length, curvature = (
        tendon_elongation(model, data),
        symmetrise_rotations(model, tendon_curvature(model, data)),
    )
    springs = []
    for tendon in range(model.ntendon):
        name = tendon_name(model, tendon)
        springs.append(
            Spring(
                name=name,
                location=f"tendon:{name}",
                direction=rows[tendon],
                stiffness=0.0 if slack[tendon] else float(model.tendon_stiffness[tendon]),
                damping=float(model.tendon_damping[tendon]),
                angular=False,
                geometric=curvature[tendon] * length[tendon] if length[tendon] else None,
                at_bodies=pulls.get(tendon),
            )
        )
    return tuple(springs)
