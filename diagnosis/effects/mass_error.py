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
the tetrahedron is then a triangle, a line or the centre of mass.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from diagnosis.effects.body_box import (
    bound_place,
    find_jacobian,
    hold_at_zero,
    list_unfelt,
    select_names,
    state_shown,
)
from diagnosis.effects.scales import MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from diagnosis.movable import Movable
from diagnosis.settings import DiagnosisSettings
from identification.words import Mask, Real
from mbmodel import AddedPart, Change, Machine, Parameter, transport

_LEAST = 0.1  # units of mass: less has no place
# Corners about a square or cube of edge 1, which the body fills at most: half of the edge of a box
# is its margin. By the number of components of the place that show.
_SIMPLEX_CORNERS = (
    np.zeros((1, 0)),
    np.array([[-1.0], [1.0]]),
    np.array([[0.0, 1.5], [-1.5, -0.75], [1.5, -0.75]]),
    1.5 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
)


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield added and missing mass for each body with mass and moment of inertia."""
    machine, jacobian = scene.model.machine, find_jacobian(scene)
    for number, body in enumerate(machine.layout.bodies):
        inertia = machine.body_mass[6 * number : 6 * number + 6, 6 * number : 6 * number + 6]
        if not (inertia[0, 0] > 0 and np.trace(inertia[3:, 3:]) > 0):
            continue  # a point, or the coordinate of a body's mode: it has no radius of gyration
        for sign in (1.0, -1.0):
            added = _AddedMass(machine, jacobian, number, sign)
            spread = [name for name in added.spread if name not in added.unfelt]
            yield Hypothesis(
                "mass_error",
                f"body:{body}",
                parts=(added.part,),
                bounds=added.find_bounds(scene.settings),
                believed=dict.fromkeys(spread, 1 / MASS_SHARE_UNIT),
                movable=Movable((body,), added.read, added.start),
                state=added.state,
            )


@dataclass(frozen=True, eq=False)
class _AddedMass:
    """Mass at the corners of a tetrahedron, and moments of inertia, that are added to a body.

    Parameters: w (one for each corner), upper triangle of I (6).

    Args:
        machine: machine with the body.
        jacobian: motion of the bodies per coordinate that gives way; (6 n_body, nv).
        number: number of the body.
        sign: 1 for added mass, -1 for missing mass.
    """

    machine: Machine
    jacobian: Real
    number: int
    sign: float

    @property
    def _span(self) -> slice:
        return slice(6 * self.number, 6 * self.number + 6)

    @cached_property
    def inertia(self) -> Real:
        """Spatial inertia of the body as drawn; (6, 6)."""
        inertia: Real = self.machine.body_mass[self._span, self._span]
        return inertia

    @cached_property
    def unit(self) -> float:
        """Unit of the mass [kg]."""
        return MASS_SHARE_UNIT * float(self.inertia[0, 0])

    @cached_property
    def gyration(self) -> float:
        """Radius of gyration of the body [m]."""
        return float(np.sqrt(np.trace(self.inertia[3:, 3:]) / self.inertia[0, 0]))

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
        axes = [f"{'xyz'[i]}{'xyz'[j]}" for i, j in zip(*np.triu_indices(3), strict=True)]
        return tuple(f"{self._prefix}_inertia_{entry}" for entry in axes)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return (*self.weights, *self.spread)

    @cached_property
    def _by_number(self) -> Real:
        """Spatial inertia per unit of m, of m p and of I; (10, 6, 6)."""
        core = np.zeros((10, 6, 6))
        core[0, :3, :3] = self.unit * np.eye(3)
        for k, direction in enumerate(np.eye(3)):
            turned = self.unit * np.cross(np.eye(3), direction)  # [direction]x
            core[1 + k, :3, 3:], core[1 + k, 3:, :3] = -turned, turned
        for k, (i, j) in enumerate(zip(*np.triu_indices(3), strict=True)):
            core[4 + k, 3 + i, 3 + j] = core[4 + k, 3 + j, 3 + i] = self.unit * self.gyration**2
        return core

    @cached_property
    def _frame(self) -> Real:
        frame: Real = np.eye(len(self.machine.body_mass))[:, self._span]
        return frame

    def _build_change(self, core: Real) -> Change:
        whole = np.zeros((*core.shape[:-2], 3, 6, 6))
        whole[..., 2, :, :] = core
        return Change("body", self._frame, self._frame, whole)

    @cached_property
    def _felt(self) -> Mask:
        """Which of m, m p and I some motion shows; (10,)."""
        parameters = tuple(Parameter(str(k), 0.0, "1", positive=False) for k in range(10))
        part = AddedPart.linear("", parameters, (self._build_change(self._by_number),))
        unfelt = list_unfelt(self.jacobian, part, np.zeros(10))
        return np.array([parameter.name not in unfelt for parameter in parameters])

    @property
    def unfelt(self) -> tuple[str, ...]:
        """Names of the entries of I that no motion shows."""
        return select_names(self.spread, ~self._felt[4:])

    @cached_property
    def corners(self) -> Real:
        """Corners of the tetrahedron, from the centre of mass [m]; (n_corner, 3)."""
        shown = self._felt[1:4]
        centre = self.machine.layout.centres[self.number]
        ends = np.array(bound_place(self.machine, [self.number], centre))[shown]
        relative = _SIMPLEX_CORNERS[int(shown.sum())]
        corners = np.zeros((len(relative), 3))
        corners[:, shown] = ends.mean(axis=1) + relative * np.ptp(ends, axis=1) / 2
        return corners

    @cached_property
    def core(self) -> Real:
        """Spatial inertia per unit of each parameter; (n_parameter, 6, 6)."""
        numbers = np.hstack([np.ones((len(self.corners), 1)), self.corners])
        at_corners = self.sign * np.tensordot(numbers, self._by_number[:4], axes=1)
        return np.concatenate([at_corners, self._by_number[4:]])

    @property
    def part(self) -> AddedPart:
        """Part with the mass."""
        body = self.machine.layout.bodies[self.number]
        units = [f"{self.unit:g} kg"] * len(self.weights)
        units += [f"{self.unit * self.gyration**2:g} kg m2"] * len(self.spread)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, units, strict=True)
        )
        part = AddedPart.linear(f"body:{body}", parameters, (self._build_change(self.core),))
        return replace(part, weighs=partial(np.tensordot, b=self.core, axes=1))

    def find_bounds(self, settings: DiagnosisSettings) -> dict[str, tuple[float, float]]:
        """Return the bounds of all parameters."""
        relative = np.diag(self.inertia[3:, 3:]) / (self.inertia[0, 0] * self.gyration**2)
        most = settings.max_added_mass_share
        least = most / (1 + most)  # the drawn mass is too large by as much as it may be too small
        total = most if self.sign > 0 else least
        ends = [(0.0, total / len(self.weights))] * len(self.weights)
        for i, j in zip(*np.triu_indices(3), strict=True):
            ends.append((-least * float(relative[i]) if i == j else -(most**2), most**2))
        bounds = {
            name: (low / MASS_SHARE_UNIT, high / MASS_SHARE_UNIT)
            for name, (low, high) in zip(self.names, ends, strict=True)
        }
        return bounds | hold_at_zero(self.unfelt)

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
        if abs(size) < _LEAST:
            return {"mass": self.sign * self.unit * size}
        place = state_shown((weights @ self.corners / size).tolist(), self._felt[1:4].tolist())
        return {"mass": self.sign * self.unit * size, "position": place}


EFFECT = Effect(
    propose,
    noun="mass beyond tolerance",
    means="{place} has mass beyond tolerance: a payload or part that the drawing lacks",
    confirm="weigh {place}, or add a known mass there and repeat",
)
