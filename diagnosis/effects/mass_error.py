"""A body that is heavier or lighter than its tolerance allows: a forgotten payload.

A mass m at p from the drawn centre of mass adds [[m 1, -[m p]x], [[m p]x, I]] to the spatial
inertia. All ten numbers vary, so that the mass may be distributed. p is in a tetrahedron about the
body with the corners v_i,

    m = sum w_i,   m p = sum w_i v_i,   w_i >= 0,

which is linear, so that fits and score tests need no start. One shape adds w_i, another takes them
off. Corners lie at 1.5 times the half edges of the box of the body (``body_box``): what the
drawing shows of the body is within. The whole mass is at most four times the drawn one. The prior
of the six numbers of I has a standard deviation of the mass at the radius of gyration: if no hit
and no sensor shows one of them, nothing but the prior keeps the whole inertia positive.

A component of p that no motion of the body shows, as along slides, stays zero and is not stated:
the tetrahedron is then a triangle, a line or the centre of mass. I about an axis about which the
body does not turn stays zero, too.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations_with_replacement

import numpy as np

from diagnosis.effects.body_box import (
    bound_place,
    find_jacobian,
    find_moved,
    find_shown_offsets,
    hold_at_zero,
)
from diagnosis.effects.scales import MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.movable import Movable
from diagnosis.stated_values import Value, state_shown
from identification.words import Mask, Real
from mbmodel import AddedPart, Change, Machine, Parameter, transport


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield added and missing mass for each body with mass and moment of inertia."""
    machine, jacobian = scene.model.machine, find_jacobian(scene)
    for number, body in enumerate(machine.layout.bodies):
        span = slice(6 * number, 6 * number + 6)
        inertia = machine.body_mass[span, span]
        if not (inertia[0, 0] > 0 and np.trace(inertia[3:, 3:]) > 0):
            continue  # a point, or the coordinate of a body's mode: it has no radius of gyration
        shown = find_shown_offsets(jacobian, number, jacobian[span][:3])
        turned = find_moved(jacobian[span], np.eye(6)[3:])
        corners = _find_corners(machine, number, shown)
        for sign in (1.0, -1.0):
            added = _AddedMass(machine, number, shown, corners, sign)
            held = [
                added.spread[k]
                for k, pair in enumerate(_list_entries())
                if not turned[[*pair]].all()
            ]
            yield Hypothesis(
                "mass_error",
                f"body:{body}",
                parts=(added.part,),
                bounds=added.find_bounds(scene.settings.max_added_mass_share) | hold_at_zero(held),
                believed=dict.fromkeys({*added.spread} - {*held}, 1 / MASS_SHARE_UNIT),
                movable=Movable((body,), added.read, added.start),
                state=added.state,
            )


def _find_corners(machine: Machine, number: int, shown: Mask) -> Real:
    """Return the corners of the tetrahedron, from the centre of mass [m]; (n_corner, 3)."""
    ends = np.array(bound_place(machine, [number], machine.layout.centres[number]))[shown]
    relative = _list_simplex_corners(int(shown.sum()))
    corners = np.zeros((len(relative), 3))
    corners[:, shown] = ends.mean(axis=1) + relative * np.ptp(ends, axis=1) / 2
    return corners


def _list_simplex_corners(count: int) -> Real:
    """Return the corners of a simplex in units of half the edges of a box; (count + 1, count).

    It holds the middle half of each edge. More of them the body does not fill: half of its largest
    edge is the margin.

    Args:
        count: of axes.
    """
    if count < 2:
        return np.linspace(-1, 1, count + 1)[:, None][:, :count]
    if count == 2:
        return np.array([[0, 2], [-2, -1], [2, -1]]) * 3 / 4
    return np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 3 / 2


def _list_entries() -> list[tuple[int, int]]:
    """Return the rows and columns of the upper triangle of I."""
    return list(combinations_with_replacement(range(3), 2))


@dataclass(frozen=True, eq=False)
class _AddedMass:
    """Mass at the corners of a tetrahedron, and moments of inertia, that are added to a body.

    Parameters: w (one for each corner), upper triangle of I (6).

    Args:
        machine: machine with the body.
        number: number of the body.
        shown: components of p that some motion shows; (3,).
        corners: of the tetrahedron, from the centre of mass [m]; (n_corner, 3).
        sign: 1 for added mass, -1 for missing mass.
    """

    machine: Machine
    number: int
    shown: Mask
    corners: Real
    sign: float

    @property
    def _span(self) -> slice:
        return slice(6 * self.number, 6 * self.number + 6)

    @cached_property
    def unit(self) -> Real:
        """Unit of the spatial inertia: of the mass [kg], and about the radius of gyration."""
        inertia: Real = MASS_SHARE_UNIT * self.machine.body_mass[self._span, self._span]
        return np.array([inertia[0, 0], np.trace(inertia[3:, 3:])])

    @property
    def _prefix(self) -> str:
        kind = "added" if self.sign > 0 else "missing"
        return f"{self.machine.layout.bodies[self.number]}.{kind}"

    @cached_property
    def weights(self) -> tuple[str, ...]:
        """Names of the masses at the corners."""
        return tuple(f"{self._prefix}_mass_{k}" for k in range(1, len(self.corners) + 1))

    @cached_property
    def spread(self) -> tuple[str, ...]:
        """Names of the upper triangle of I."""
        return tuple(f"{self._prefix}_inertia_{'xyz'[i]}{'xyz'[j]}" for i, j in _list_entries())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return (*self.weights, *self.spread)

    @cached_property
    def core(self) -> Real:
        """Spatial inertia per unit of each parameter; (n_parameter, 6, 6)."""
        core = np.zeros((len(self.names), 6, 6))
        for k, corner in enumerate(self.corners):
            to_corner = self.sign * self.unit[0] * transport(corner)[:3]
            core[k, :3], core[k, 3:, :3] = to_corner, to_corner[:, 3:].T
        for k, (i, j) in enumerate(_list_entries(), len(self.corners)):
            core[k, 3 + i, 3 + j] = core[k, 3 + j, 3 + i] = self.unit[1]
        return core

    @property
    def part(self) -> AddedPart:
        """Part with the mass."""
        body, frame = self.machine.layout.bodies[self.number], np.eye(len(self.machine.body_mass))
        units = [f"{self.unit[0]:g} kg"] * len(self.weights)
        units += [f"{self.unit[1]:g} kg m2"] * len(self.spread)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, units, strict=True)
        )
        whole = np.zeros((len(self.core), 3, 6, 6))
        whole[:, 2] = self.core
        change = Change("body", frame[:, self._span], frame[:, self._span], whole)
        part = AddedPart.linear(f"body:{body}", parameters, (change,))
        return replace(part, weighs=partial(np.tensordot, b=self.core, axes=1))

    def find_bounds(self, most: float) -> dict[str, tuple[float, float]]:
        """Return the bounds of all parameters.

        Args:
            most: largest added mass, as a share of the drawn one.
        """
        diagonal = MASS_SHARE_UNIT * np.diag(self.machine.body_mass[self._span, self._span])[3:]
        least = most / (1 + most)  # the drawn mass is too large by as much as it may be too small
        total = most if self.sign > 0 else least
        ends = [(0.0, total / len(self.weights))] * len(self.weights)
        for i, j in _list_entries():
            lowest = least * diagonal[i] / self.unit[1] if i == j else most**2
            ends.append((-float(lowest), most**2))
        return {
            name: (low / MASS_SHARE_UNIT, high / MASS_SHARE_UNIT)
            for name, (low, high) in zip(self.names, ends, strict=True)
        }

    def read(self, fitted: Mapping[str, float]) -> dict[str, Real]:
        """Return the spatial inertia about the origin, which holds at every body."""
        to_centre = transport(self.machine.layout.centres[self.number])
        inertia = np.tensordot([fitted[name] for name in self.names], self.core, axes=1)
        return {"inertia": to_centre.T @ inertia @ to_centre}

    def start(self, values: Mapping[str, Real]) -> dict[str, float]:
        """Return start values from a spatial inertia about the origin."""
        to_origin = transport(-self.machine.layout.centres[self.number])
        inertia = to_origin.T @ values["inertia"] @ to_origin
        theta = np.linalg.lstsq(self.core.reshape(len(self.core), -1).T, inertia.ravel())[0]
        return dict(zip(self.names, theta.tolist(), strict=True))

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the mass [kg] and its position [m]."""
        weights = np.array([fitted[name] for name in self.weights])
        size = float(weights.sum())
        mass = self.sign * float(self.unit[0]) * size
        if not size:
            return {"mass": mass}
        place = (weights @ self.corners / size).tolist()
        return {"mass": mass, "position": state_shown(place, self.shown.tolist())}


EFFECT = Effect(
    propose,
    noun="mass beyond tolerance",
    means="{place} has mass beyond tolerance: a payload or part that the drawing lacks",
    confirm="weigh {place}, or add a known mass there and repeat",
)
