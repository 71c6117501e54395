"""Remarks on what the linear model keeps of nonlinear joints."""

import mujoco
import numpy as np

from mbmodel.mjcf.names import joint_name
from mbmodel.nonlinear_joints.files import find_nonlinear_joints
from mbmodel.nonlinear_joints.friction_solver import creep_rate, is_replaced, reversal_rate
from mbmodel.nonlinear_joints.laws import DryFriction, GapSpring, JenkinsElement, NonlinearJoint

_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE


def nonlinear_remarks(compiled: mujoco.MjModel) -> tuple[str, ...]:
    """Return a sentence for each nonlinear joint.

    Args:
        compiled: the compiled model.
    """
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
