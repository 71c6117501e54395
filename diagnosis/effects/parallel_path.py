r"""A link that bypasses joints, between bodies that no joint joins: a hose, a cable, a bridge.

At a point p the upper body moves against the lower one by

    r = R u,   R = [-G(p - c_low), G(p - c_high)],   G(d) = [1, -[d]x]

and the link answers with K r + s C r, K and C symmetric: springs and dampers along any three axes,
or along one alone. So it adds R' (K + s C) R, and no force on both bodies together. It is scored
along the world's axes, halfway between the centres of mass and at six points about that; from the
best of them point and axes are fitted, with dR/dp linear in p. A fit may also begin with a link as
stiff in all directions as the upper body's slides are drawn: from none at all to a strong one it is
many steps, while joints give way that a fit without it made too stiff. A strut is the same anywhere
along its line. What is stated is the mean, weighted by the stiffness,

    k = tr(K K) / tr K,   c = tr(K C) / tr K:

of a link that is alike in all directions what it has in each, of one that pulls along an axis what
it has there.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from diagnosis.effects.points import are_joined, springs_of
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
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

_PART = 0.01  # of the softer body's mass times the square of a frequency in the middle of the band
_ARM = 0.1  # m per unit of the point's parameters
_ASIDE = 0.4  # of the distance of the centres of mass: how far points lie that are scanned
_SLIGHT = 1e-9  # of the largest principal stiffness: none
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))  # entries of a symmetric matrix
_SCANNED = ((0.0, 0.0, 0.0), *(tuple(s * e) for e in _ASIDE * np.eye(3) for s in (1, -1)))
_ENTRIES = ("x", "y", "z", "yz", "xz", "xy")


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each pair of bodies."""
    machine = scene.model.machine
    bodies = machine.layout.bodies
    band = scene.session.campaign.freq_hz
    omega = 2 * np.pi * float(np.sqrt(band[band > 0].min() * band[-1]))
    for low, high in combinations(range(len(bodies)), 2):
        if not are_joined(machine, bodies[low], bodies[high]):
            for at in range(len(_SCANNED)):
                link = _Link(machine, (low, high), omega, at)
                yield Hypothesis(
                    "parallel_path",
                    f"pair:{link.name}",
                    parts=(link.part,),
                    scored=link.along_axes,
                    signed=True,
                    bounds=link.bounds,
                    otherwise=link.firm,
                    state=link.state,
                )


class _Link:
    """A link between two bodies of a machine.

    Args:
        machine: as drawn.
        pair: numbers of the bodies.
        omega: in the middle of the band [rad/s].
        at: number of the point where it begins.
    """

    def __init__(self, machine: Machine, pair: tuple[int, int], omega: float, at: int) -> None:
        self._machine, self._pair = machine, pair
        self._centres = machine.layout.centres[list(pair)]
        self._far = float(np.linalg.norm(np.ptp(self._centres, axis=0)))
        self._begin = self._far * np.array(_SCANNED[at])
        self._bodies = tuple(machine.layout.bodies[k] for k in pair)
        self.name = "-".join(self._bodies)
        mass = min(float(machine.body_mass[6 * k, 6 * k]) for k in pair)
        unit = _PART * mass * omega**2
        self._units = np.array([unit, unit / omega])
        frame = np.zeros((6 * len(machine.layout.bodies), 12))
        for side, body in enumerate(pair):
            frame[6 * body : 6 * body + 6, 6 * side : 6 * side + 6] = np.eye(6)
        self._frame = frame
        kinds = ("stiffness", "damping")
        # Along the axes first, of stiffness and of damping; then what turns them; then the point.
        called = f"pair{pair[0]}-{pair[1]}.link{at}"  # names of bodies may hold the same sign
        self.along_axes = tuple(f"{called}.{kind}_{e}" for kind in kinds for e in _ENTRIES[:3])
        across = tuple(f"{called}.{kind}_{e}" for kind in kinds for e in _ENTRIES[3:])
        self._names = (*self.along_axes, *across, *(f"{called}.point_{axis}" for axis in "xyz"))

    @property
    def firm(self) -> tuple[dict[str, float], ...]:
        """As stiff as the slides of the upper body's joint are drawn; none where none is sprung."""
        springs = springs_of(self._machine, self._bodies[1])
        slides = [s.stiffness for s in self._machine.springs if s.name in springs and not s.angular]
        if not any(slides):
            return ()
        size = float(np.median([value for value in slides if value > 0])) / float(self._units[0])
        return (dict.fromkeys(self.along_axes[:3], size),)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """No farther aside than the centres of mass are apart."""
        low, high = (-self._far - self._begin) / _ARM, (self._far - self._begin) / _ARM
        return {name: (float(low[k]), float(high[k])) for k, name in enumerate(self._names[12:])}

    @property
    def _start(self) -> Real:
        """Where the point begins [m]."""
        start: Real = self._centres.mean(axis=0) + self._begin
        return start

    @property
    def part(self) -> AddedPart:
        """As a Part."""
        units = [f"{self._units[0]:g} N/m"] * 3 + [f"{self._units[1]:g} N s/m"] * 3
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self._names, [*units, *units, *[f"{_ARM:g} m"] * 3], strict=True)
        )
        place = f"pair:{self.name}"
        return AddedPart(place, parameters, self.finite, self.derivatives, written=self.written)

    def _matrices(self, theta: Real) -> Real:
        """K and C in their units; (2, 3, 3)."""
        matrices = np.zeros((2, 3, 3))
        for number, (row, column) in enumerate(_PAIRS):
            entry = theta[[number, number + 3]] if number < 3 else theta[[number + 3, number + 6]]
            matrices[:, row, column] = matrices[:, column, row] = entry
        return matrices

    def _moves(self, theta: Real) -> Real:
        """R; (3, 12)."""
        point = self._start + _ARM * theta[12:]
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
            turned = transport(_ARM * unit)[:3] - np.eye(3, 6)
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

    def written(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        """A tendon along each axis of the springs, and of the dampers where these are others."""
        both = self._matrices(theta) * self._units[:, None, None]
        stiffness, damping = both
        point = self._start + _ARM * theta[12:]
        if np.abs(stiffness @ damping - damping @ stiffness).max() <= _SLIGHT * np.abs(
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
            if any(sizes < -_SLIGHT * largest):
                additions.append(NotInMjcf(name, "a spring or damper of less than nothing"))
            elif any(np.abs(sizes) > _SLIGHT * largest):
                low, high = self._bodies
                along = point, axis
                additions += link_elements(
                    name, self._machine, (low, high), along, np.maximum(sizes, 0.0)
                )
        return tuple(additions)


EFFECT = Effect(
    propose,
    noun="a link that bypasses joints",
    means="a link between {place} bypasses the joints: a hose, a cable, a bridge",
    confirm="take cables and hoses between {place} off and repeat: the stiffness goes",
    undoes=True,
)
