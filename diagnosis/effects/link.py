"""A link between two bodies as a Part: springs and dampers at one point (``parallel_path``).

Springs and dampers are passive, so K and C have no negative eigenvalue. Each spring has a damper
beside it, so that both have the same axes (``passive_matrix``),

    K = (1 + N) diag(k) (1 + N),   C = (1 + N) diag(c) (1 + N).

The point is in the box about its bodies (``body_box``). Springs along axes in which nothing moves
both bodies apart are none, nor do springs turn towards such an axis; a component of the point that
no motion shows stays where it starts. None of these is stated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.effects.body_box import (
    bound_place,
    find_box,
    find_moved_axes,
    hold_at_zero,
    select_names,
    state_shown,
)
from diagnosis.effects.passive_matrix import build_columns, build_passive, slope_passive
from diagnosis.effects.points import find_own_springs, name_vector
from diagnosis.effects.scales import ARM_UNIT_M, MASS_SHARE_UNIT
from diagnosis.hypothesis import Value
from diagnosis.rounding import HALF_PRECISION
from identification.words import Mask, Real
from mbmodel import (
    WORLD,
    AddedPart,
    Addition,
    Change,
    Machine,
    NotInMjcf,
    Parameter,
    link_elements,
    transport,
)

_AWAY = np.array([3.0, 2.0, 1.0])  # units: a point at which turns of the bodies show
_ASIDE_SHARE = 0.4  # of the distance of the centres of mass: points of the scan beside the middle


def list_start_points() -> Real:
    """Return the points of the scan, relative to the distance of the centres of mass; (7, 3).

    They lie halfway between the centres, and beside that to both sides along each axis.
    """
    aside = _ASIDE_SHARE * np.eye(3)
    return np.vstack([np.zeros(3), np.stack([aside, -aside], axis=1).reshape(-1, 3)])


@dataclass(frozen=True, eq=False)
class Link:
    """A link between two bodies of a machine, or from the ground to a body.

    A link to the ground starts at the body's centre of mass or beside it.

    Args:
        machine: the nominal machine.
        jacobian: motion of the bodies per coordinate that gives way; (6 n_body, nv).
        pair: numbers of the bodies; None first for the ground.
        omega: frequency in the middle of the band [rad/s].
        at: number of its start point.
    """

    machine: Machine
    jacobian: Real
    pair: tuple[int | None, int]
    omega: float
    at: int

    @cached_property
    def bodies(self) -> tuple[str, str]:
        """Lower and upper body."""
        low, high = (WORLD if k is None else self.machine.layout.bodies[k] for k in self.pair)
        return low, high

    @cached_property
    def _moving(self) -> list[int]:
        """Numbers of the bodies that move."""
        return [k for k in self.pair if k is not None]

    @property
    def name(self) -> str:
        """Such as ``lower-upper``."""
        return "-".join(self.bodies)

    @cached_property
    def _centres(self) -> Real:
        centres: Real = self.machine.layout.centres[[self._moving[0], self._moving[-1]]]
        return centres

    @cached_property
    def _distance(self) -> float:
        if len(self._moving) == 2:
            return float(np.linalg.norm(np.ptp(self._centres, axis=0)))
        return float(np.ptp(find_box(self.machine, self._moving), axis=0).max()) / 2

    @cached_property
    def units(self) -> Real:
        """Units of stiffness and damping."""
        mass = min(float(self.machine.body_mass[6 * k, 6 * k]) for k in self._moving)
        unit = MASS_SHARE_UNIT * mass * self.omega**2
        return np.array([unit, unit / self.omega])

    @cached_property
    def _frame(self) -> Real:
        frame = np.zeros((6 * len(self.machine.layout.bodies), 12))
        for side, body in enumerate(self.pair):
            if body is not None:
                frame[6 * body : 6 * body + 6, 6 * side : 6 * side + 6] = np.eye(6)
        return frame

    @property
    def _prefix(self) -> str:
        low, high = self.pair  # names of bodies may hold a hyphen, numbers do not
        return f"pair{WORLD if low is None else low}-{high}.link{self.at}"

    @property
    def along_axes(self) -> tuple[str, ...]:
        """Names of the sizes of stiffness and damping, which lie along the axes where N = 0."""
        kinds = (f"{self._prefix}.{kind}_" for kind in ("stiffness", "damping"))
        return tuple(name for kind in kinds for name in name_vector(kind))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sizes k and c, of the entries of N, and of the point."""
        axes = (f"{self._prefix}.axes_{entry}" for entry in ("xy", "xz", "yz"))
        return (*self.along_axes, *axes, *name_vector(f"{self._prefix}.point_"))

    @property
    def stiff_starts(self) -> tuple[dict[str, float], ...]:
        """Start with the stiffness of the slides of the upper body's joint; none without one."""
        springs = find_own_springs(self.machine, self.bodies[1])
        slides = [s.stiffness for s in self.machine.springs if s.name in springs and not s.angular]
        if not any(slides):
            return ()
        size = float(np.median([value for value in slides if value > 0])) / float(self.units[0])
        return (dict.fromkeys(self.scored[: self.moved.sum()], size),)

    @cached_property
    def moved(self) -> Mask:
        """World axes along which something moves both bodies apart; (3,)."""
        return find_moved_axes(self.jacobian, self._find_motion(_AWAY) @ self._frame.T)

    @cached_property
    def _shown(self) -> Mask:
        """Components of the point that show: its turns move another axis; (3,)."""
        sizes = [
            np.abs(slope[self.moved] @ self._frame.T @ self.jacobian).max(initial=0.0)
            for slope in self._motion_slopes
        ]
        is_shown: Mask = np.array(sizes) > HALF_PRECISION * np.abs(self.jacobian).max()
        return is_shown

    @property
    def scored(self) -> tuple[str, ...]:
        """Names of the sizes along axes that move."""
        return select_names(self.along_axes, np.tile(self.moved, 2))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of N and of the point, and of what no motion shows."""
        turned = dict.fromkeys(self.names[6:9], (-1.0, 1.0))
        ends = bound_place(self.machine, self._moving, self.start)
        places = zip(self.names[9:], ends, strict=True)
        bounds = {name: (low / ARM_UNIT_M, high / ARM_UNIT_M) for name, (low, high) in places}
        rows, columns = np.triu_indices(3, k=1)
        return (
            turned
            | bounds
            | hold_at_zero(
                [
                    *select_names(self.along_axes, np.tile(~self.moved, 2)),
                    *select_names(self.names[6:9], ~(self.moved[rows] & self.moved[columns])),
                    *select_names(self.names[9:], ~self._shown),
                ]
            )
        )

    @cached_property
    def start(self) -> Real:
        """Start point [m]; (3,)."""
        aside = self._distance * list_start_points()[self.at]
        start: Real = np.clip(
            self._centres.mean(axis=0) + aside, *find_box(self.machine, self._moving)
        )
        return start

    @property
    def part(self) -> AddedPart:
        """Part with the link."""
        units = [f"{self.units[0]:g} N/m"] * 3 + [f"{self.units[1]:g} N s/m"] * 3 + ["1"] * 3
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, [*units, *[f"{ARM_UNIT_M:g} m"] * 3], strict=True)
        )
        place = f"pair:{self.name}"
        return AddedPart(
            place, parameters, self.compute_change, self.compute_slopes, written=self.write
        )

    def _build_matrices(self, theta: Real) -> Real:
        """Return K and C in their units; (2, 3, 3)."""
        return np.array([build_passive(theta[3 * k : 3 * k + 3], theta[6:9]) for k in range(2)])

    def _build_slopes(self, theta: Real) -> Real:
        """Return the slopes of K and C by the sizes of both and by N; (9, 2, 3, 3)."""
        slopes = np.zeros((9, 2, 3, 3))
        for k in range(2):
            by_entry = slope_passive(theta[3 * k : 3 * k + 3], theta[6:9])
            slopes[3 * k : 3 * k + 3, k], slopes[6:, k] = by_entry[:3], by_entry[3:]
        return slopes

    def _find_motion(self, offset: Real) -> Real:
        """Return R, the relative motion at the point per motion of both bodies; (3, 12).

        Args:
            offset: of the point from the start [units]; (3,).
        """
        point = self.start + ARM_UNIT_M * offset
        low, high = (transport(point - centre)[:3] for centre in self._centres)
        return np.hstack([-low, high])

    @cached_property
    def _motion_slopes(self) -> Real:
        """Slopes of R by the point; (3, 3, 12)."""
        turned = [transport(ARM_UNIT_M * unit)[:3] - np.eye(3, 6) for unit in np.eye(3)]
        return np.array([np.hstack([-turn, turn]) for turn in turned])

    def _build_change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-3], 3, 12, 12))
        whole[..., :2, :, :] = core
        return Change("body", self._frame, self._frame, whole)

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change by springs and dampers."""
        motion = self._find_motion(theta[9:])
        core = self.units[:, None, None] * (motion.T @ self._build_matrices(theta) @ motion)
        return (self._build_change(core),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by each parameter."""
        motion, both = self._find_motion(theta[9:]), self._build_matrices(theta)
        core = np.zeros((len(theta), 2, 12, 12))
        core[:9] = motion.T @ self._build_slopes(theta) @ motion
        for axis, slope in enumerate(self._motion_slopes):
            half = slope.T @ both @ motion
            core[9 + axis] = half + half.swapaxes(-1, -2)
        return (self._build_change(core * self.units[:, None, None]),)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return stiffness and damping along the world axes [SI], and the point [m].

        Only P K P is felt, with P the projection on the directions in which something moves.
        """
        theta = np.array([fitted[name] for name in self.names])
        felt = self._projection @ self._build_matrices(theta) @ self._projection
        sizes = self.units[:, None] * np.diagonal(felt, axis1=1, axis2=2)
        point = self.start + ARM_UNIT_M * theta[9:]
        stated = (*sizes.tolist(), point.tolist())
        shown = (self.moved.tolist(), self.moved.tolist(), self._shown.tolist())
        vectors = map(state_shown, stated, shown)
        return dict(zip(("stiffness", "damping", "position"), vectors, strict=True))

    @cached_property
    def _projection(self) -> Real:
        """Projection on the directions in which something moves both bodies apart; (3, 3)."""
        motion = self._find_motion(_AWAY) @ self._frame.T @ self.jacobian
        directions, sizes, _ = np.linalg.svd(motion, full_matrices=False)
        kept = directions[:, sizes > HALF_PRECISION * sizes.max(initial=0.0)]
        projection: Real = kept @ kept.T
        return projection

    def write(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        """Return a tendon along each axis, with a spring and a damper."""
        sizes = self.units[:, None] * theta[:6].reshape(2, 3)
        point = self.start + ARM_UNIT_M * theta[9:]
        largest = sizes.max(axis=1, initial=0.0)
        additions: list[Addition] = []
        for number, axis in enumerate(build_columns(theta[6:9]).T):
            length = float(np.linalg.norm(axis))
            along = sizes[:, number] * length**2
            if any(along > HALF_PRECISION * largest):
                line = point, axis / length
                name = f"{self.name}.{number}"
                additions += link_elements(name, self.machine, self.bodies, line, along)
        return tuple(additions)
