"""Keyframes of an MJCF: the pose and the controls at which the search for equilibrium starts."""

from pathlib import Path

import mujoco

from identification.words import InputError

HOME = "home"  # the keyframe that is used unless the user states another
DRAWING = ""  # states that no keyframe is used


def choose_keyframe(model: mujoco.MjModel, path: Path, stated: str | None) -> str:
    """Return the name of the keyframe that is used, or ``DRAWING`` for none.

    A keyframe without a name goes by its number, from 0.

    Args:
        model: the compiled model.
        path: of the MJCF, for messages.
        stated: name that the user states; None for ``home`` if there is one, else the drawing.

    Raises:
        InputError: the file has no keyframe of this name.
    """
    names = _names(model)
    if stated is None:
        return HOME if HOME in names else DRAWING
    if stated != DRAWING and stated not in names:
        choice = f"choose one of {', '.join(names)}" if names else "it has none"
        raise InputError(f"{path} has no keyframe {stated!r}: {choice}")
    return stated


def _names(model: mujoco.MjModel) -> list[str]:
    """Return the names of the keyframes, or their numbers."""
    return [model.key(number).name or str(number) for number in range(model.nkey)]


def pose_data(model: mujoco.MjModel, keyframe: str) -> mujoco.MjData:
    """Return a machine in the pose of a keyframe, at rest, or in that of the drawing.

    Joints, controls and mocap bodies are those of the keyframe. Its velocities are not used.

    Args:
        model: the compiled model.
        keyframe: as ``choose_keyframe`` returns it.
    """
    data = mujoco.MjData(model)
    if keyframe != DRAWING:
        mujoco.mj_resetDataKeyframe(model, data, _names(model).index(keyframe))
        data.qvel[:] = 0.0
        data.time = 0.0
    return data


def keyframe_remarks(model: mujoco.MjModel, keyframe: str) -> tuple[str, ...]:
    """Return which keyframe is used, or that there are keyframes of which none is used.

    Args:
        model: the compiled model.
        keyframe: as ``choose_keyframe`` returns it.
    """
    names = _names(model)
    if not names:
        return ()
    if keyframe == DRAWING:
        return (
            f"the file has keyframes ({', '.join(names)}), of which none is used: state one by "
            "key, or name it home",
        )
    remark = f"keyframe {keyframe!r} gives pose and controls"
    if model.key_qvel[names.index(keyframe)].any():
        remark += "; its velocities are not used: state rates of hinges by spin"
    return (remark,)
