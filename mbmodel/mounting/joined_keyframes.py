"""Keyframes of a machine with a stage on it: poses and controls of both."""

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.edit import Element, Values
from mbmodel.mjcf.keyframes import HOME, joint_number_behind


def join_keyframes(
    machine: mujoco.MjModel, stage: mujoco.MjModel, body: str
) -> tuple[Element, ...]:
    """Return the machine's keyframes with the pose of the stage in each.

    The stage stands in its own ``home``, or as drawn without one. If only the stage has a ``home``,
    the machine's drawing with it is ``home``. MuJoCo orders positions by body, depth first: those
    of the stage stand behind those of all bodies that its body carries. Controls of the stage stand
    last.

    Args:
        machine: compiled.
        stage: compiled.
        body: name of the body that carries the stage.
    """
    pose, control = _key(stage, HOME)
    place = np.append(machine.jnt_qposadr, machine.nq)[joint_number_behind(machine, body)]
    names = [machine.key(number).name for number in range(machine.nkey)]
    numbers: list[int | None] = list(range(machine.nkey))
    if HOME not in names and _has_key(stage, HOME):
        names, numbers = [*names, HOME], [*numbers, None]
    elements = []
    for name, number in zip(names, numbers, strict=True):
        positions = machine.qpos0 if number is None else machine.key_qpos[number]
        drive = np.zeros(machine.nu) if number is None else machine.key_ctrl[number]
        values: dict[str, str | float | tuple[float, ...]] = {
            "qpos": tuple(np.insert(positions, place, pose).tolist())
        }
        if machine.nu + stage.nu:
            values["ctrl"] = tuple(np.append(drive, control).tolist())
        if number is not None and machine.nmocap:
            values["mpos"] = tuple(machine.key_mpos[number].tolist())
            values["mquat"] = tuple(machine.key_mquat[number].tolist())
        named: Values = {"name": name, **values} if name else values
        elements.append(Element("key", named))
    return tuple(elements)


def _has_key(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, name) >= 0)


def _key(model: mujoco.MjModel, name: str) -> tuple[Real, Real]:
    """Return positions and controls of a keyframe; of the drawing if there is none of the name."""
    if not _has_key(model, name):
        return model.qpos0, np.zeros(model.nu)
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, name)
    return model.key_qpos[number], model.key_ctrl[number]
