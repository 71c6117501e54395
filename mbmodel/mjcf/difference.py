"""Difference of a written machine from the one that was meant, also by its compiled values.

Nonlinear joints have no linear machine to compare with. What is compared instead is what MuJoCo
compiles: every spring, damper, friction, mass and actuator is that of the source, or as edited.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.edit import Addition, Edit
from mbmodel.mjcf.names import actuator_name, body_name, joint_name, tendon_name

# Of the largest entry of a matrix: two ways to compute it in double precision agree better.
MAX_RELATIVE_DIFFERENCE = 1e-9
_Values = dict[tuple[str, str], Real]  # by name of the element and attribute


@dataclass(frozen=True)
class Difference:
    """Largest difference of a written machine.

    Args:
        what: quantity that differs, such as ``mass``, ``stiffness``, ``point`` or ``motor``.
        place: joint coordinate, body, point or motor at which it is largest.
        relative: difference over the largest entry.
    """

    what: str
    place: str
    relative: float

    def __str__(self) -> str:
        """Return it in words."""
        return f"the {self.what} at {self.place} differs by {100 * self.relative:.2g} %"


def compare_compiled(
    before: mujoco.MjModel,
    after: mujoco.MjModel,
    changes: Sequence[Edit | Addition] = (),
    prefix: str = "",
) -> Difference | None:
    """Return the first value of a written file that is neither the source's nor an edit's, or None.

    Args:
        before: the source, compiled.
        after: the written file, compiled.
        changes: edits of springs, and tendons that were added.
        prefix: of the source's names in the written file.
    """
    expected = _read_values(before)
    for change in changes:
        values = change.values if isinstance(change, Edit) else change.element.values
        for attribute, value in values.items():
            if (change.name, attribute) in expected or isinstance(change, Addition):
                expected[change.name, attribute] = _numbers(value)
    read_values = _read_values(after)
    for (name, attribute), wanted in expected.items():
        if (prefix + name, attribute) not in read_values:
            continue
        read = read_values[prefix + name, attribute][: len(wanted)]
        scale = float(np.abs(wanted).max(initial=0.0)) or 1.0
        relative = float(np.abs(read - wanted).max(initial=0.0)) / scale
        if relative > MAX_RELATIVE_DIFFERENCE:
            return Difference(attribute, name, relative)
    return None


def _numbers(value: str | float | Sequence[float]) -> Real:
    """Return the numbers of an attribute, empty for a text."""
    try:
        return np.atleast_1d(np.array(value, np.float64))
    except ValueError:
        return np.zeros(0)


def _read_values(model: mujoco.MjModel) -> _Values:
    """Return springs, dampers, friction, masses and actuators by name and attribute."""
    values: _Values = {}
    for joint in range(model.njnt):
        name, dof = joint_name(model, joint), model.jnt_dofadr[joint]
        values[name, "stiffness"] = np.append(
            model.jnt_stiffness[joint], model.jnt_stiffnesspoly[joint]
        )
        values[name, "damping"] = np.append(model.dof_damping[dof], model.dof_dampingpoly[dof])
        values[name, "frictionloss"] = model.dof_frictionloss[dof : dof + 1]
        values[name, "armature"] = model.dof_armature[dof : dof + 1]
    for tendon in range(model.ntendon):
        name = tendon_name(model, tendon)
        values[name, "stiffness"] = np.append(
            model.tendon_stiffness[tendon], model.tendon_stiffnesspoly[tendon]
        )
        values[name, "damping"] = np.append(
            model.tendon_damping[tendon], model.tendon_dampingpoly[tendon]
        )
        values[name, "springlength"] = model.tendon_lengthspring[tendon]
    for body in range(1, model.nbody):
        inertia = np.sort(model.body_inertia[body])
        name = body_name(model, body)
        values[name, "mass of the body"] = np.append(model.body_mass[body], inertia)
    for actuator in range(model.nu):
        name = actuator_name(model, actuator)
        values[name, "gain of the actuator"] = model.actuator_gainprm[actuator]
        values[name, "bias of the actuator"] = model.actuator_biasprm[actuator]
    return values
