"""Labels at one point: their rows among all labels, and the directions that they mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Integers, Port, Real


@dataclass(frozen=True, eq=False)
class PointChannels:
    """The labels at one point.

    Args:
        rows: their numbers among all labels; (n,).
        axes: axis 0..5 of each; (n,).
        signs: sign of each; 0 for a signal, which is no single direction of the point; (n,).
    """

    rows: Integers
    axes: Integers
    signs: Real

    @property
    def selection(self) -> Real:
        """1 where a label reads a direction, whatever its sign; (n, 6)."""
        return np.eye(6)[self.axes]

    @property
    def directions(self) -> Real:
        """Signed direction of each label; (n, 6)."""
        return self.signs[:, None] * self.selection


NO_CHANNELS = PointChannels(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))


def group_by_point(labels: Sequence[Port]) -> dict[str, PointChannels]:
    """Return the labels at each point.

    Args:
        labels: outputs or inputs.
    """
    members: dict[str, list[tuple[int, int, int]]] = {}
    for row, label in enumerate(labels):
        sign = label.sign if isinstance(label, Dof) else 0
        members.setdefault(label.point, []).append((row, label.axis, sign))
    groups = {}
    for point, of_point in members.items():
        rows, axes, signs = np.array(of_point).T
        groups[point] = PointChannels(rows, axes, signs.astype(float))
    return groups
