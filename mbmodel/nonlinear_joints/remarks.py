"""Remarks on what the linear model keeps of nonlinear joints."""

import mujoco

from mbmodel.nonlinear_joints.files import find_nonlinear_joints
from mbmodel.nonlinear_joints.laws import DryFriction, GapSpring, JenkinsElement, NonlinearJoint


def nonlinear_remarks(compiled: mujoco.MjModel) -> tuple[str, ...]:
    """Return a sentence for each nonlinear joint.

    Args:
        compiled: the compiled model.
    """
    return tuple(_remark(law) for law in find_nonlinear_joints(compiled))


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


def _remark(law: NonlinearJoint) -> str:
    """Return what the linear model keeps of a law."""
    if isinstance(law, JenkinsElement):
        kept = "the linear model has its sticking spring"
    elif isinstance(law, DryFriction):
        kept = "the linear model leaves it out"
    elif isinstance(law, GapSpring):
        kept = "the linear model has its stiffness at rest, none within the gap"
    else:
        kept = "the linear model has its slope at rest"
    return f"joint {law.joint!r} has {describe_law(law)}: {kept}; mbw simulate has all of it"
