"""A link between two bodies as a Part: springs and dampers at one point (``parallel_path``)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.effects.points import find_own_springs
from diagnosis.effects.scales import ARM_UNIT_M, MASS_SHARE_UNIT, SYMMETRIC_ENTRIES
from diagnosis.hypothesis import Value
from identification.words import Real
from mbmodel import (
    AddedPart,
    Addition,
    Change,
    Machine,
    NotInMjcf,
    Parameter,
    link_elements,
    transport,
)

_ASIDE_SHARE = 0.4  # of the distance of the centres of mass: how far points lie that are scanned
_MIN_STIFFNESS_SHARE = 1e-9  # of the largest principal stiffness: none
START_POINTS = (
    (0.0, 0.0, 0.0),
    *(tuple(s * e) for e in _ASIDE_SHARE * np.eye(3) for s in (1, -1)),
)
_ENTRY_NAMES = ("x", "y", "z", "yz", "xz", "xy")


@dataclass(frozen=True, eq=False)
class Link:
    """A link between two bodies of a machine.

    Args:
        machine: the nominal machine.
        pair: numbers of the bodies.
        omega: in the middle of the band [rad/s].
        at: number of the point where it begins.
    """

    machine: Machine
    pair: tuple[int, int]
    omega: float
    at: int

    @cached_property
    def bodies(self) -> tuple[str, str]:
        """Lower and upper body."""
        low, high = (self.machine.layout.bodies[k] for k in self.pair)
        return low, high

    @property
    def name(self) -> str:
        """Such as ``lower-upper``."""
        return "-".join(self.bodies)

    @cached_property
    def _centres(self) -> Real:
        centres: Real = self.machine.layout.centres[list(self.pair)]
        return centres

    @cached_property
    def _distance(self) -> float:
        return float(np.linalg.norm(np.ptp(self._centres, axis=0)))

    @cached_property
    def _offset(self) -> Real:
        """Start of the point from halfway between the centres of mass [m]; (3,)."""
        offset: Real = self._distance * np.array(START_POINTS[self.at])
        return offset

    @cached_property
    def _units(self) -> Real:
        """Units of stiffness and damping."""
        mass = min(float(self.machine.body_mass[6 * k, 6 * k]) for k in self.pair)
        unit = MASS_SHARE_UNIT * mass * self.omega**2
        return np.array([unit, unit / self.omega])

    @cached_property
    def _frame(self) -> Real:
        frame = np.zeros((6 * len(self.machine.layout.bodies), 12))
        for side, body in enumerate(self.pair):
            frame[6 * body : 6 * body + 6, 6 * side : 6 * side + 6] = np.eye(6)
        return frame

    def _name_entries(self, entries: tuple[str, ...]) -> tuple[str, ...]:
        """Return names of entries of stiffness, then of damping."""
        # Names of bodies may hold a hyphen, numbers do not.
        prefix = f"pair{self.pair[0]}-{self.pair[1]}.link{self.at}"
        return tuple(f"{prefix}.{kind}_{e}" for kind in ("stiffness", "damping") for e in entries)

    @property
    def along_axes(self) -> tuple[str, ...]:
        """Names of stiffness and damping along the axes."""
        return self._name_entries(_ENTRY_NAMES[:3])

    @property
    def _names(self) -> tuple[str, ...]:
        """Entries along the axes, then what turns them, then the point."""
        prefix = self.along_axes[0].rpartition(".")[0]
        point = (f"{prefix}.point_{axis}" for axis in "xyz")
        return (*self.along_axes, *self._name_entries(_ENTRY_NAMES[3:]), *point)

    @property
    def firm(self) -> tuple[dict[str, float], ...]:
        """As stiff as the slides of the upper body's joint are drawn; none where none is sprung."""
        springs = find_own_springs(self.machine, self.bodies[1])
        slides = [s.stiffness for s in self.machine.springs if s.name in springs and not s.angular]
        if not any(slides):
            return ()
        size = float(np.median([value for value in slides if value > 0])) / float(self._units[0])
        return (dict.fromkeys(self.along_axes[:3], size),)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """No farther aside than the centres of mass are apart."""
        low, high = (
            (-self._distance - self._offset) / ARM_UNIT_M,
            (self._distance - self._offset) / ARM_UNIT_M,
        )
        return {name: (float(low[k]), float(high[k])) for k, name in enumerate(self._names[12:])}

    @property
    def _start(self) -> Real:
        """Where the point begins [m]."""
        start: Real = self._centres.mean(axis=0) + self._offset
        return start

    @property
    def part(self) -> AddedPart:
        """Part with the link."""
        units = [f"{self._units[0]:g} N/m"] * 3 + [f"{self._units[1]:g} N s/m"] * 3
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(
                self._names, [*units, *units, *[f"{ARM_UNIT_M:g} m"] * 3], strict=True
            )
        )
        place = f"pair:{self.name}"
        return AddedPart(place, parameters, self.finite, self.derivatives, written=self.write)

    def _matrices(self, theta: Real) -> Real:
        """K and C in their units; (2, 3, 3)."""
        matrices = np.zeros((2, 3, 3))
        for number, (row, column) in enumerate(SYMMETRIC_ENTRIES):
            entry = theta[[number, number + 3]] if number < 3 else theta[[number + 3, number + 6]]
            matrices[:, row, column] = matrices[:, column, row] = entry
        return matrices

    def _moves(self, theta: Real) -> Real:
        """R; (3, 12)."""
        point = self._start + ARM_UNIT_M * theta[12:]
        low, high = (transport(point - centre)[:3] for centre in self._centres)
        return np.hstack([-low, high])

    def _change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-3], 3, 12, 12))
        whole[..., :2, :, :] = core
        return Change("body", self._frame, self._frame, whole)

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """All of it."""
        moves = self._moves(theta)
        core = self._units[:, None, None] * (moves.T @ self._matrices(theta) @ moves)
        return (self._change(core),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By each parameter."""
        moves, both = self._moves(theta), self._matrices(theta)
        core = np.zeros((len(theta), 2, 12, 12))
        for number in range(12):
            unit = self._matrices(np.eye(15)[number])
            core[number] = moves.T @ unit @ moves
        for axis, unit in enumerate(np.eye(3)):
            turned = transport(ARM_UNIT_M * unit)[:3] - np.eye(3, 6)
            slope = np.hstack([-turned, turned])
            half = slope.T @ both @ moves
            core[12 + axis] = half + half.swapaxes(-1, -2)
        return (self._change(core * self._units[:, None, None]),)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Stiffness and damping in SI; none is less than nothing."""
        stiffness, damping = self._matrices(np.array([fitted[name] for name in self._names]))
        sizes, axes = np.linalg.eigh(stiffness)
        stiffness = (axes * np.maximum(sizes, 0.0)) @ axes.T
        weight = stiffness if stiffness.any() else np.eye(3)
        means = [np.trace(weight @ matrix) / np.trace(weight) for matrix in (stiffness, damping)]
        mean_stiffness, mean_damping = (self._units * np.maximum(means, 0.0)).tolist()
        return {"stiffness": mean_stiffness, "damping": mean_damping}

    def write(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        """A tendon along each axis of the springs, and of the dampers where these are others."""
        both = self._matrices(theta) * self._units[:, None, None]
        stiffness, damping = both
        point = self._start + ARM_UNIT_M * theta[12:]
        if np.abs(stiffness @ damping - damping @ stiffness).max() <= _MIN_STIFFNESS_SHARE * np.abs(
            stiffness @ damping
        ).max(initial=0.0):
            _, axes = np.linalg.eigh(stiffness / self._units[0] + np.pi * damping / self._units[1])
            rows = [("", axis, (axis @ stiffness @ axis, axis @ damping @ axis)) for axis in axes.T]
        else:
            of_springs, of_dampers = (np.linalg.eigh(matrix)[1].T for matrix in both)
            rows = [("k", axis, (axis @ stiffness @ axis, 0.0)) for axis in of_springs]
            rows += [("c", axis, (0.0, axis @ damping @ axis)) for axis in of_dampers]
        additions: list[Addition | NotInMjcf] = []
        largest = np.abs(both).max(axis=(1, 2))
        for number, (kind, axis, sizes) in enumerate(rows):
            name = f"{self.name}.{kind}{number % 3}"
            if any(sizes < -_MIN_STIFFNESS_SHARE * largest):
                additions.append(NotInMjcf(name, "a spring or damper of less than nothing"))
            elif any(np.abs(sizes) > _MIN_STIFFNESS_SHARE * largest):
                low, high = self.bodies
                along = point, axis
                additions += link_elements(
                    name, self.machine, (low, high), along, np.maximum(sizes, 0.0)
                )
        return tuple(additions)
