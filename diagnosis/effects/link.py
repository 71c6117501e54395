"""A link between two bodies as a Part: springs and dampers at one point (``parallel_path``).

Springs and dampers are passive, so K and C have no negative eigenvalue. Each spring has a damper
beside it, so that both have the same axes (``passive_matrix``),

    K = (1 + N) diag(k) (1 + N),   C = (1 + N) diag(c) (1 + N).

Springs along axes in which nothing moves both bodies apart are none, nor do springs turn towards
such an axis; a component of the point that no motion shows stays where it starts (``link_place``).
None of these is stated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.effects.body_box import hold_at_zero, select_names
from diagnosis.effects.link_place import LinkPlace
from diagnosis.effects.passive_matrix import build_columns, build_passive, slope_passive
from diagnosis.effects.scales import ARM_UNIT_M, MASS_SHARE_UNIT
from diagnosis.scene_points import find_own_springs, name_vector
from diagnosis.settings import HALF_PRECISION
from diagnosis.stated_values import Value, state_shown
from identification.words import Real
from mbmodel import (
    WORLD,
    AddedPart,
    Addition,
    Change,
    Machine,
    NotInMjcf,
    Parameter,
    link_elements,
)


@dataclass(frozen=True, eq=False)
class Link:
    """A link between two bodies of a machine, or from the ground to a body.

    Args:
        place: its bodies and its point.
        omega: frequency in the middle of the band [rad/s].
    """

    place: LinkPlace
    omega: float

    @property
    def machine(self) -> Machine:
        """The nominal machine."""
        return self.place.machine

    @cached_property
    def bodies(self) -> tuple[str, str]:
        """Lower and upper body."""
        low, high = (WORLD if k is None else self.machine.layout.bodies[k] for k in self.place.pair)
        return low, high

    @property
    def name(self) -> str:
        """Such as ``lower-upper``."""
        return "-".join(self.bodies)

    @cached_property
    def units(self) -> Real:
        """Units of stiffness and damping."""
        mass = min(float(self.machine.body_mass[6 * k, 6 * k]) for k in self.place.moving)
        unit = MASS_SHARE_UNIT * mass * self.omega**2
        return np.array([unit, unit / self.omega])

    @property
    def _prefix(self) -> str:
        low, high = self.place.pair  # names of bodies may hold a hyphen, numbers do not
        return f"pair{WORLD if low is None else low}-{high}.link{self.place.at}"

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
        return (dict.fromkeys(self.scored[: self.place.moved.sum()], size),)

    @property
    def scored(self) -> tuple[str, ...]:
        """Names of the sizes along axes that move."""
        return select_names(self.along_axes, np.tile(self.place.moved, 2))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of N and of the point, and of what no motion shows."""
        moved, (rows, columns) = self.place.moved, np.triu_indices(3, k=1)
        ends = [*[(-1.0, 1.0)] * 3, *map(tuple, self.place.bound_offset().tolist())]
        is_felt = [*np.tile(moved, 2), *(moved[rows] & moved[columns]), *self.place.shown]
        held = select_names(self.names, ~np.array(is_felt))
        return dict(zip(self.names[6:], ends, strict=True)) | hold_at_zero(held)

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
            place,
            parameters,
            self.compute_change,
            self.compute_slopes,
            written=self.write,
            goes_with=self.machine.layout.bodies[self.place.moving[0]],
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

    def _build_change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-3], 3, 12, 12))
        whole[..., :2, :, :] = core
        return Change("body", self.place.frame, self.place.frame, whole)

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change by springs and dampers."""
        motion = self.place.find_motion(theta[9:])
        core = self.units[:, None, None] * (motion.T @ self._build_matrices(theta) @ motion)
        return (self._build_change(core),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by each parameter."""
        motion, both = self.place.find_motion(theta[9:]), self._build_matrices(theta)
        core = np.zeros((len(theta), 2, 12, 12))
        core[:9] = motion.T @ self._build_slopes(theta) @ motion
        for axis, slope in enumerate(self.place.motion_slopes):
            half = slope.T @ both @ motion
            core[9 + axis] = half + half.swapaxes(-1, -2)
        return (self._build_change(core * self.units[:, None, None]),)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return stiffness and damping along the world axes [SI], and the point [m].

        Only P K P is felt, with P the projection on the directions in which something moves.
        """
        theta = np.array([fitted[name] for name in self.names])
        projection = self.place.projection
        felt = projection @ self._build_matrices(theta) @ projection
        sizes = self.units[:, None] * np.diagonal(felt, axis1=1, axis2=2)
        point = self.place.locate(theta[9:])
        stated = (*sizes.tolist(), point.tolist())
        moved = self.place.moved.tolist()
        vectors = map(state_shown, stated, (moved, moved, self.place.shown.tolist()))
        return dict(zip(("stiffness", "damping", "position"), vectors, strict=True))

    def write(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        """Return a tendon along each axis, with a spring and a damper."""
        sizes = self.units[:, None] * theta[:6].reshape(2, 3)
        point = self.place.locate(theta[9:])
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
