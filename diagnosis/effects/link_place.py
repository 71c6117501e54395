"""Where a link between two bodies acts, and what the motion of the machine shows of it.

The link acts at one point, in the box about its bodies (``body_box``). The scan starts in the
middle of the centres of mass, and halfway from there to each face of the box.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.effects.body_box import bound_place, find_box, find_moved
from diagnosis.effects.scales import ARM_UNIT_M
from diagnosis.settings import HALF_PRECISION
from identification.words import Mask, Real
from mbmodel import Machine, transport


@dataclass(frozen=True, eq=False)
class LinkPlace:
    """Point of a link between two bodies of a machine, or from the ground to a body.

    Args:
        machine: the nominal machine.
        jacobian: motion of the bodies per coordinate that gives way; (6 n_body, nv).
        pair: numbers of the bodies; None first for the ground.
        at: number of its start point.
        start: its start point [m]; (3,).
    """

    machine: Machine
    jacobian: Real
    pair: tuple[int | None, int]
    at: int
    start: Real

    @cached_property
    def moving(self) -> list[int]:
        """Numbers of the bodies that move."""
        return [k for k in self.pair if k is not None]

    @cached_property
    def _centres(self) -> Real:
        return self.machine.layout.centres[[self.moving[0], self.moving[-1]]]

    def bound_offset(self) -> Real:
        """Return the lowest and highest offset from the start, by axis [units]; (3, 2)."""
        return np.array(bound_place(self.machine, self.moving, self.start)) / ARM_UNIT_M

    def locate(self, offset: Real) -> Real:
        """Return the point at an offset from the start [m]; (3,).

        Args:
            offset: in units; (3,).
        """
        return self.start + ARM_UNIT_M * offset

    @cached_property
    def frame(self) -> Real:
        """Coordinates of both bodies among those of all; (6 n_body, 12), zero for the ground."""
        frame = np.zeros((6 * len(self.machine.layout.bodies), 12))
        for side, body in enumerate(self.pair):
            if body is not None:
                frame[6 * body : 6 * body + 6, 6 * side : 6 * side + 6] = np.eye(6)
        return frame

    def find_motion(self, offset: Real) -> Real:
        """Return R, the relative motion at the point per motion of both bodies; (3, 12).

        Args:
            offset: of the point from the start [units]; (3,).
        """
        low, high = (transport(self.locate(offset) - centre)[:3] for centre in self._centres)
        return np.hstack([-low, high])

    @cached_property
    def motion_slopes(self) -> Real:
        """Slopes of R by the point; (3, 3, 12)."""
        turned = [transport(ARM_UNIT_M * unit)[:3] - np.eye(3, 6) for unit in np.eye(3)]
        return np.array([np.hstack([-turn, turn]) for turn in turned])

    @cached_property
    def _moved_rows(self) -> Real:
        """Relative motion at points among which the turns of the bodies show; (3, 4, 6 n_body)."""
        points = (np.zeros(3), *np.eye(3))
        rows: Real = np.stack([self.find_motion(point) for point in points], axis=1)
        return rows @ self.frame.T

    @cached_property
    def moved(self) -> Mask:
        """World axes along which something moves both bodies apart; (3,)."""
        return find_moved(self.jacobian, self._moved_rows)

    @cached_property
    def shown(self) -> Mask:
        """Components of the point that show: its turns move another axis; (3,)."""
        return find_moved(self.jacobian, self.motion_slopes[:, self.moved] @ self.frame.T)

    @cached_property
    def projection(self) -> Real:
        """Projection on the directions in which something moves both bodies apart; (3, 3)."""
        motion = (self._moved_rows @ self.jacobian).reshape(3, -1)
        directions, sizes, _ = np.linalg.svd(motion, full_matrices=False)
        kept = directions[:, sizes > HALF_PRECISION * np.abs(self.jacobian).max(initial=0.0)]
        return kept @ kept.T


def list_places(
    machine: Machine, jacobian: Real, pair: tuple[int | None, int]
) -> Iterator[LinkPlace]:
    """Yield the places of the scan.

    Args:
        jacobian: motion of the bodies per coordinate that gives way; (6 n_body, nv).
        pair: numbers of the bodies; None first for the ground.
    """
    moving = [k for k in pair if k is not None]
    middle = machine.layout.centres[moving].mean(axis=0)
    aside = 0.5 * (find_box(machine, moving) - middle)[:, :, None] * np.eye(3)
    for at, offset in enumerate((np.zeros(3), *aside.reshape(-1, 3))):
        yield LinkPlace(machine, jacobian, pair, at, middle + offset)
