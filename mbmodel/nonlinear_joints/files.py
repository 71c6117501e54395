"""Nonlinear joints written into an MJCF, and read from one.

Remarks on what the linear model keeps of nonlinear joints.
"""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, UsageError
from mbmodel.mjcf.edit import Addition, Edit
from mbmodel.mjcf.names import joint_name
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.mjcf.tendons import is_fixed_tendon
from mbmodel.mjcf.written_file import refuse_difference, write_copy
from mbmodel.nonlinear_joints.friction_solver import creep_rate, is_replaced, reversal_rate
from mbmodel.nonlinear_joints.laws import (
    PRELOAD_STIFFNESS_RATIO,
    DryFriction,
    GapSpring,
    JenkinsElement,
    NonlinearJoint,
    PolynomialSpring,
)

_SINGLE = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
# Part of a joint that each law replaces.
_REPLACED_PARTS: dict[type, str] = {
    PolynomialSpring: "own spring (hardening, backlash)",
    GapSpring: "own spring (hardening, backlash)",
    JenkinsElement: "friction that sticks as a spring",
    DryFriction: "dry friction",
}
_RATIO_MARGIN = 10.0  # a spring this many times stiffer than a preload's is no preload


def write_nonlinear_joints(source: Path, target: Path, joints: Sequence[NonlinearJoint]) -> None:
    """Write a copy of an MJCF in which some joints are nonlinear.

    Args:
        target: the new file; its folder exists.
        joints: laws by the name of a slide or hinge.

    Raises:
        InputError: the file has no such joint, or cannot hold the law there.
        UsageError: two laws replace the same part of a joint.
    """
    compiled, _ = compile_with_remarks(source, without_friction=True)
    numbers = {joint_name(compiled, k): k for k in _single_joints(compiled)}
    _refuse_two_springs(joints)
    changes: list[Edit | Addition] = []
    for law in joints:
        if law.joint not in numbers:
            raise InputError(
                f"{source}: there is no slide or hinge {law.joint!r}: choose one of "
                f"{', '.join(numbers)}"
            )
        changes += law.changes(_spring_reference(compiled, numbers[law.joint]))
    written = write_copy(source, target, changes)
    refuse_difference(target.name, written.difference)


def _refuse_two_springs(joints: Sequence[NonlinearJoint]) -> None:
    """Refuse laws of a joint of which one would overwrite the other.

    A polynomial spring and a gap both replace the joint's own spring. A Jenkins element and dry
    friction stand beside it, so a joint may have one of each besides.
    """
    named: set[tuple[str, str]] = set()
    for law in joints:
        part = _REPLACED_PARTS[type(law)]
        if (law.joint, part) in named:
            raise UsageError(f"joint {law.joint!r} has two laws of its {part}: state one of them")
        named.add((law.joint, part))


def read_nonlinear_joints(path: Path) -> tuple[NonlinearJoint, ...]:
    """Read the nonlinear joints of an MJCF.

    Args:
        path: of the MJCF.

    Raises:
        InputError: the file cannot be read.
    """
    compiled, _ = compile_with_remarks(path, without_friction=True)
    return find_nonlinear_joints(compiled)


def find_nonlinear_joints(compiled: mujoco.MjModel) -> tuple[NonlinearJoint, ...]:
    """Return the nonlinear joints of a compiled model, in the order of the joints."""
    laws: list[NonlinearJoint] = []
    for joint in _single_joints(compiled):
        laws += _read_joint(compiled, joint)
    return tuple(laws)


def _single_joints(compiled: mujoco.MjModel) -> list[int]:
    """Return the numbers of the slides and hinges."""
    kinds = [mujoco.mjtJoint(kind) for kind in compiled.jnt_type]
    return [joint for joint, kind in enumerate(kinds) if kind in _SINGLE]


def _read_joint(compiled: mujoco.MjModel, joint: int) -> list[NonlinearJoint]:
    """Return the laws of one joint: polynomial, friction, gap."""
    name, laws = joint_name(compiled, joint), list[NonlinearJoint]()
    k2, k3 = (float(value) for value in compiled.jnt_stiffnesspoly[joint][:2])
    k = float(compiled.jnt_stiffness[joint])
    if compiled.jnt_plasticadr[joint] >= 0:
        laws.append(JenkinsElement(name, k, k * float(compiled.jnt_springyield[joint])))
    elif k2 or k3:
        laws.append(PolynomialSpring(name, k, k2, k3))
    loss = float(compiled.dof_frictionloss[compiled.jnt_dofadr[joint]])
    if loss > 0:
        laws.append(DryFriction(name, loss))
    tendons = _tendons_over(compiled, joint)
    for tendon in tendons:
        stiffness = float(compiled.tendon_stiffness[tendon])
        low, high = (float(value) for value in compiled.tendon_lengthspring[tendon])
        if compiled.tendon_plasticadr[tendon] >= 0:
            limit = stiffness * float(compiled.tendon_springyield[tendon])
            laws.append(JenkinsElement(name, stiffness, limit))
        elif high > low:
            preload = _preload(compiled, tendons, stiffness, (low + high) / 2)
            laws.append(GapSpring(name, stiffness, (high - low) / 2, preload))
    return laws


def _tendons_over(compiled: mujoco.MjModel, joint: int) -> list[int]:
    """Return the fixed tendons whose length is the coordinate of one joint."""
    tendons = []
    for tendon in range(compiled.ntendon):
        first = int(compiled.tendon_adr[tendon])
        is_single = is_fixed_tendon(compiled, tendon) and compiled.tendon_num[tendon] == 1
        if (
            is_single
            and compiled.wrap_objid[first] == joint
            and compiled.wrap_prm[first] == 1.0
            and compiled.tendon_stiffness[tendon] > 0
        ):
            tendons.append(tendon)
    return tendons


def _preload(
    compiled: mujoco.MjModel, tendons: Sequence[int], stops: float, centre: float
) -> float:
    """Return the force of the weak springs over a joint at the middle of its gap."""
    largest = _RATIO_MARGIN * PRELOAD_STIFFNESS_RATIO * stops
    return sum(
        float(
            compiled.tendon_stiffness[tendon] * (compiled.tendon_lengthspring[tendon, 0] - centre)
        )
        for tendon in tendons
        if compiled.tendon_stiffness[tendon] <= largest
    )


def _spring_reference(compiled: mujoco.MjModel, joint: int) -> float:
    """Return the coordinate at which a joint's spring is free."""
    return float(compiled.qpos_spring[compiled.jnt_qposadr[joint]])


_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE


def nonlinear_remarks(compiled: mujoco.MjModel) -> tuple[str, ...]:
    """Return a sentence for each nonlinear joint."""
    coordinates = {
        joint_name(compiled, joint): int(compiled.jnt_dofadr[joint])
        for joint in range(compiled.njnt)
    }
    return tuple(
        _dry_friction_remark(law, compiled, coordinates[law.joint])
        if isinstance(law, DryFriction)
        else _remark(law)
        for law in find_nonlinear_joints(compiled)
    )


def describe_law(law: NonlinearJoint) -> str:
    """Return a law and its parameters in words."""
    numbers = ", ".join(
        f"{name} = {value:.4g}" for name, value in vars(law).items() if name != "joint" and value
    )
    kinds = {
        JenkinsElement: "friction that sticks as a spring",
        DryFriction: "dry friction",
        GapSpring: "play",
    }
    return f"{kinds.get(type(law), 'a polynomial spring')} ({numbers})"


def _dry_friction_remark(law: DryFriction, compiled: mujoco.MjModel, coordinate: int) -> str:
    """Return how the linear model and a simulation treat the dry friction of a coordinate."""
    reference, impedance = compiled.dof_solref[coordinate], compiled.dof_solimp[coordinate]
    start = f"joint {law.joint!r} has {describe_law(law)}: the linear model leaves it out; "
    if is_replaced(reference, impedance):
        return (
            f"{start}mbw simulate has all of it, with a harder setting of MuJoCo's solver than the "
            "file's, which creeps or leads the motion"
        )
    rate = reversal_rate(reference, impedance)
    if rate is None:
        return f"{start}mbw simulate has all of it"
    creep = creep_rate(rate, impedance) / float(compiled.dof_invweight0[coordinate])
    is_slide = mujoco.mjtJoint(compiled.jnt_type[compiled.dof_jntid[coordinate]]) == _SLIDE
    unit = "N s/m" if is_slide else "N m s/rad"
    return (
        f"{start}mbw simulate has it with the solreffriction and solimpfriction of the file: its "
        f"force leads the motion by 45 deg at {rate / (2 * np.pi):.3g} Hz, and below its limit it "
        f"creeps like a damper of {creep:.3g} {unit}: remove both for friction without lead"
    )


def _remark(law: NonlinearJoint) -> str:
    """Return what the linear model keeps of a law."""
    if isinstance(law, JenkinsElement):
        kept = "the linear model has its sticking spring"
    elif isinstance(law, GapSpring):
        kept = "the linear model has its stiffness at rest, none within the gap"
    else:
        kept = "the linear model has its slope at rest"
    return f"joint {law.joint!r} has {describe_law(law)}: {kept}; mbw simulate has all of it"
