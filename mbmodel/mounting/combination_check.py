"""Check that a combined MJCF has the masses and elements of the files that it is made of."""

from collections.abc import Sequence

import mujoco
import numpy as np

from identification.words import InputError

_MAX_MASS_ERROR = 1e-9  # relative: MuJoCo keeps masses in double precision


def check_combination(
    combined: mujoco.MjModel,
    origins: Sequence[tuple[str, str, mujoco.MjModel]],
    added_masses: Sequence[float],
) -> None:
    """Refuse a combined machine that lacks elements, or in which settings change masses.

    MuJoCo drops what it cannot attach, such as a tendon around a geom that is left out, and the
    compiler settings of one file may act on masses of the other.

    Args:
        combined: compiled.
        origins: for each file its name, the prefix of its names, and the file compiled alone.
        added_masses: point masses [kg].

    Raises:
        InputError: elements that are missing; a body, or all bodies together, with another mass.
    """
    for kind, attribute in _COUNTED.items():
        lost = sum(int(getattr(model, attribute)) for _, _, model in origins)
        lost -= int(getattr(combined, attribute))
        if lost:
            raise InputError(
                f"{origins[-1][0]}: {lost} of its {kind} cannot be mounted, since they use an "
                "element of its world that is left out: draw that element in a body"
            )
    bodies = 1 + len(added_masses) + sum(model.nbody - 1 for _, _, model in origins)
    has_fused = bodies != combined.nbody  # fusestatic, which the combined file does not have
    for file, prefix, model in () if has_fused else origins:
        for number in range(1, model.nbody):
            name = model.body(number).name
            copy = mujoco.mj_name2id(combined, mujoco.mjtObj.mjOBJ_BODY, prefix + name)
            if name and copy > 0 and not _is_alike(combined, copy, model, number):
                raise InputError(
                    f"{file}: body {name!r} has {combined.body_mass[copy]:g} kg in the combined "
                    f"file and {model.body_mass[number]:g} kg in its own: {_ADVICE}"
                )
    expected = sum(added_masses) + sum(float(model.body_mass[1:].sum()) for _, _, model in origins)
    total = float(combined.body_mass[1:].sum())
    if abs(total - expected) > _MAX_MASS_ERROR * expected:
        raise InputError(
            f"{' and '.join(file for file, _, _ in origins)}: the combined file has {total:g} kg "
            f"instead of {expected:g} kg: {_ADVICE}"
        )


_COUNTED = {
    "joints": "njnt",
    "tendons": "ntendon",
    "actuators": "nactuator",
    "sensors": "nsensor",
    "equality constraints": "neq",
}  # MuJoCo's counts of what acts on a machine
_ADVICE = (
    "remove settotalmass, boundmass and boundinertia from <compiler>, and state masses by "
    "<inertial>"
)


def _is_alike(combined: mujoco.MjModel, copy: int, model: mujoco.MjModel, number: int) -> bool:
    """Return whether mass and principal inertias of a body are those of its own file."""
    values = np.append(combined.body_inertia[copy], combined.body_mass[copy])
    expected = np.append(model.body_inertia[number], model.body_mass[number])
    return bool((np.abs(values - expected) <= _MAX_MASS_ERROR * expected.max()).all())
