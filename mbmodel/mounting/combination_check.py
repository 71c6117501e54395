"""Check that a combined MJCF has the elements, masses and springs of the files it is made of."""

from collections.abc import Sequence

import mujoco

from identification.words import InputError
from mbmodel.mjcf.difference import MAX_RELATIVE_DIFFERENCE, Difference, compare_compiled

_COUNTED = {
    "joints": "njnt",
    "tendons": "ntendon",
    "actuators": "nactuator",
    "sensors": "nsensor",
    "equality constraints": "neq",
}  # MuJoCo's counts of what acts on a machine


def compare_combination(
    combined: mujoco.MjModel,
    origins: Sequence[tuple[str, str, mujoco.MjModel]],
    added_masses: Sequence[float],
) -> Difference | None:
    """Return where settings of one file change masses, springs or actuators of another, or None.

    MuJoCo drops what it cannot attach, such as a tendon around a geom that is left out.

    Args:
        combined: compiled.
        origins: for each file its name, the prefix of its names, and the file compiled alone.
        added_masses: point masses [kg].

    Raises:
        InputError: elements that are missing.
    """
    for kind, attribute in _COUNTED.items():
        lost = sum(int(getattr(model, attribute)) for _, _, model in origins)
        lost -= int(getattr(combined, attribute))
        if lost:
            raise InputError(
                f"{origins[-1][0]}: {lost} of its {kind} cannot be mounted, since they use an "
                "element of its world that is left out: draw that element in a body"
            )
    for _, prefix, model in origins:
        if (difference := compare_compiled(model, combined, prefix=prefix)) is not None:
            return difference
    expected = sum(added_masses) + sum(float(model.body_mass[1:].sum()) for _, _, model in origins)
    relative = abs(float(combined.body_mass[1:].sum()) - expected) / expected
    if relative > MAX_RELATIVE_DIFFERENCE:
        return Difference("mass of all bodies", "the combined machine", relative)
    return None
