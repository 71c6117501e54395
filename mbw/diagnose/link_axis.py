"""Direction of a link between two bodies, from the stiffness matrix that a diagnosis fitted."""

import re
from collections.abc import Mapping

import numpy as np

from diagnosis import Diagnosis
from diagnosis.effects.passive_matrix import build_passive
from mbw.results.diagnosed_schema import Point

_ENTRY = re.compile(r"\.link\d+\.(?:stiffness|axes)_([xyz]{1,2})$")
_MIN_STIFFNESS_RATIO = 2.0  # of the two largest principal stiffnesses; below, no axis stands out


def link_axis(diagnosis: Diagnosis, location: str) -> Point | None:
    """Return the direction along which the link of a diagnosis is stiffest, in world axes.

    Args:
        diagnosis: diagnosis whose first cause may be a link.
        location: location of the link, such as ``pair:base-head``.

    Returns:
        A unit vector whose largest component is positive; None for no link, or for one without a
        direction that stands out.
    """
    gap = diagnosis.after
    if gap is None or not location.startswith("pair:"):
        return None
    model = gap.refit.session.model
    theta = diagnosis.parameters.theta if diagnosis.parameters else gap.theta
    values = {
        entry[1]: float(value)
        for parameter, place, value in zip(model.parameters, model.locations, theta, strict=True)
        if place == location and (entry := _ENTRY.search(parameter.name))
    }
    return principal_axis(values)


def principal_axis(entries: Mapping[str, float]) -> Point | None:
    """Return the stiffest axis of a link.

    Args:
        entries: sizes ``x``, ``y``, ``z`` and entries ``xy``, ``xz``, ``yz`` of N, as in
            ``diagnosis.effects.passive_matrix``; those that are missing are zero.
    """
    values = np.array([entries.get(name, 0.0) for name in ("x", "y", "z", "xy", "xz", "yz")])
    sizes, axes = np.linalg.eigh(build_passive(values[:3], values[3:]))
    if not sizes[2] > _MIN_STIFFNESS_RATIO * sizes[1]:
        return None
    axis = axes[:, 2]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return (float(axis[0]), float(axis[1]), float(axis[2]))


def axis_words(axis: Point | None) -> str:
    """Return the direction of a link in words."""
    if axis is None:
        return "alike in several directions"
    return f"along ({', '.join(f'{component:.2f}' for component in axis)})"
