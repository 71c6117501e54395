r"""A mode of a body on which no sensor stands, as motors and encoders feel it.

Let u = T q be the motion of all bodies by the joint coordinates q, Z the dynamic stiffness along q,
M the mass of the bodies, and b the coordinate of a mode of one body with all joints held, of modal
mass 1. Per unit of b the body moves by six numbers that nobody knows, and all that stands on each
joint above by six: by F x. With the momentum p = M F x of the bodies per rate of b,

    [ Z(s)        s^2 T' p ] [ q ]   [ f ]
    [ s^2 p' T    s^2 + S  ] [ b ] = [ 0 ],     S = 2 zeta w s + w^2,

and without b (a mode with fixed interface: Craig and Bampton 1968, AIAA J. 6, 1313-1319) the bodies
have the further dynamic stiffness

    -p p' s^4 / (s^2 + S) = p p' (R(s) - s^2),     R of ``resonator.py``.

Of the modal mass 1, p' M^-1 p = size < 1 is that of the motion F x, the rest that of the bending,
so that the free body has w / sqrt(1 - size) and zeta / sqrt(1 - size). With M = L L' and an
orthonormal U of the span of L' F that the joints show, p = sqrt(size) L U v, |v| = 1.

The stiffness is linear in the entries of size v v', a matrix of rank one. A score test has those of
a family of modes of one frequency free; a mode begins at the eigenvector of the largest eigenvalue.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from diagnosis.effects.appendage_part import SCAN_DAMPING_RATIO
from diagnosis.effects.resonator import build_resonator, build_resonator_slope
from diagnosis.effects.scales import LOG_FREQUENCY_UNIT, LOG_UNIT, MASS_SHARE_UNIT
from diagnosis.effects.spring_laws import Shape
from diagnosis.settings import HALF_PRECISION, NEGLIGIBLE_SHARE
from identification.words import Integers, Real
from mbmodel import AddedPart, Change, Machine, Parameter, parent_bodies


def find_momenta(machine: Machine, body: str, jacobian: Real) -> Real:
    """Return L U, the momenta of all bodies that a mode of a body may have; (6 n_body, n_span).

    Args:
        machine: without a coordinate for the mode.
        body: name of the body.
        jacobian: T, of the coordinates that give way; (6 n_body, nv).
    """
    number, parents = machine.layout.bodies.index(body), parent_bodies(machine)
    first = {axle.stage: axle for axle in reversed(machine.axles) if axle.chain_row is None}
    above = (
        machine.motion_per_twist(axle, axle.anchor)
        for stage, axle in first.items()
        if parents[stage] == body
    )
    frame = np.eye(len(machine.body_mass))[:, 6 * number : 6 * number + 6]
    values, vectors = np.linalg.eigh(machine.body_mass)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    span: Real = root @ _find_basis(root.T @ np.hstack([frame, *above]))
    return np.asarray(span @ _find_basis(span.T @ jacobian))


def _find_basis(columns: Real) -> Real:
    """Return an orthonormal basis of the span of columns, each of which counts alike."""
    length = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    return np.asarray(scipy.linalg.orth(columns / length, HALF_PRECISION))


@dataclass(frozen=True, eq=False)
class ModeFamily:
    """All modes of a body that have one frequency.

    Args:
        name: prefix of the parameters: the body and the number of the frequency.
        location: place in the verdict.
        frequency: with all joints held [Hz].
        span: L U; (6 n_body, n_span).
    """

    name: str
    location: str
    frequency: float
    span: Real

    @property
    def _entries(self) -> tuple[Integers, Integers]:
        return np.triu_indices(self.span.shape[1])

    @property
    def names(self) -> list[str]:
        """Names of the entries of size v v' from the diagonal on; n_span (n_span + 1) / 2."""
        pairs = zip(*(numbers.tolist() for numbers in self._entries), strict=True)
        return [f"{self.name}.product_{i}_{j}" for i, j in pairs]

    def build(self) -> AddedPart:
        """Return the Part, linear in the entries."""
        count, (rows, columns) = self.span.shape[1], self._entries
        numbers = np.arange(len(rows))
        core = np.zeros((len(rows), count, count))
        core[numbers, rows, columns] = core[numbers, columns, rows] = MASS_SHARE_UNIT
        parameters = tuple(
            Parameter(name, 0.0, f"{MASS_SHARE_UNIT:.0%}", positive=False) for name in self.names
        )
        resonator = build_resonator(2 * np.pi * self.frequency, SCAN_DAMPING_RATIO)
        changes = tuple(_add_inertia(self.span, core, resonator))
        return AddedPart.linear(self.location, parameters, changes)

    def find_leading(self, products: Real) -> tuple[float, Real]:
        """Return size [units] and v of the mode that is nearest to some entries."""
        count = self.span.shape[1]
        matrix = np.zeros((count, count))
        matrix[self._entries] = products
        values, vectors = np.linalg.eigh(matrix, UPLO="U")
        return float(values[-1]), vectors[:, -1]

    def find_products(self, momentum: Real) -> dict[str, float]:
        """Return the entries for the momenta of all bodies, as far as these modes have them.

        Args:
            momentum: p; (6 n_body,).
        """
        v = np.linalg.lstsq(self.span, momentum, rcond=None)[0]
        products = np.outer(v, v)[self._entries] / MASS_SHARE_UNIT
        return dict(zip(self.names, products.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class HeldMode:
    """Mode of a body: size, frequency and damping with all joints held, direction of its momenta.

    Args:
        family: its span, and the frequency where its parameter is zero.
        start: unit vector v where the parameters of the direction are zero; (n_span,).
    """

    family: ModeFamily
    start: Real

    @property
    def names(self) -> tuple[str, ...]:
        """Names of size, frequency and damping, then of the direction."""
        across = (f"direction_{k}" for k in range(1, len(self.start)))
        return tuple(
            f"{self.family.name}.{what}" for what in ("size", "frequency", "damping", *across)
        )

    def build(self) -> AddedPart:
        """Return the Part."""
        units = [f"{MASS_SHARE_UNIT:.0%}", f"{LOG_FREQUENCY_UNIT:.0%}", f"{LOG_UNIT:.0%}"]
        units += ["1"] * (len(self.start) - 1)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(self.names, units, strict=True)
        )
        location = self.family.location
        return AddedPart(location, parameters, self.compute_change, self.compute_slopes)

    def find_resonance(self, theta: Real) -> tuple[float, float]:
        """Return the natural frequency [rad/s] and the damping ratio, all joints held."""
        omega = 2 * np.pi * self.family.frequency * float(np.exp(LOG_FREQUENCY_UNIT * theta[1]))
        return omega, SCAN_DAMPING_RATIO * float(np.exp(LOG_UNIT * theta[2]))

    def find_free_resonance(self, theta: Real) -> tuple[float, float]:
        """Return the natural frequency [Hz] and the damping ratio of the free body.

        Momenta that no joint shows are zero. With them the body would have higher ones.
        """
        omega, zeta = self.find_resonance(theta)
        bending = max(1 - MASS_SHARE_UNIT * float(theta[0]), NEGLIGIBLE_SHARE)
        return omega / (2 * np.pi * bending**0.5), zeta / bending**0.5

    def find_momentum(self, theta: Real) -> Real:
        """Return p of the mode; (6 n_body,)."""
        size = MASS_SHARE_UNIT * float(theta[0])
        return np.asarray(np.sqrt(size) * self.family.span @ self._find_direction(theta)[0])

    @cached_property
    def _across(self) -> Real:
        """Changes of v at its start per unit of each parameter; (n_span, n_span - 1)."""
        return np.asarray(scipy.linalg.null_space(self.start[None]))

    def _find_direction(self, theta: Real) -> tuple[Real, Real]:
        """Return v and its slopes by the parameters of the direction; (n_span,), (n, n_span)."""
        turned = self.start + self._across @ theta[3:]
        length = float(np.linalg.norm(turned))
        v = turned / length
        return v, (self._across.T - np.outer(self._across.T @ v, v)) / length

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the dynamic stiffness of the mode."""
        v, _ = self._find_direction(theta)
        core = MASS_SHARE_UNIT * theta[0] * np.outer(v, v)
        return tuple(
            _add_inertia(self.family.span, core, build_resonator(*self.find_resonance(theta)))
        )

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by size and direction, then by frequency and by damping."""
        (v, turns), (omega, zeta) = self._find_direction(theta), self.find_resonance(theta)
        unit = MASS_SHARE_UNIT * np.outer(v, v)
        core = np.zeros((len(theta), *unit.shape))
        half = MASS_SHARE_UNIT * theta[0] * turns[:, :, None] * v
        core[0], core[3:] = unit, half + half.swapaxes(1, 2)
        changes = [*_add_inertia(self.family.span, core, build_resonator(omega, zeta))]
        if theta[0]:
            rates = np.array([[2 * zeta * omega, 2 * omega**2], [2 * zeta * omega, 0.0]])
            rates *= [[LOG_FREQUENCY_UNIT], [LOG_UNIT]]
            for place, (linear, constant) in enumerate(rates.tolist(), start=1):
                slope = np.zeros_like(core)
                slope[place] = theta[0] * unit
                shape = build_resonator_slope(omega, zeta, (linear, constant))
                changes.append(_build_change(self.family.span, slope, shape))
        return tuple(changes)


def _add_inertia(span: Real, core: Real, resonator: Shape) -> Iterator[Change]:
    """Yield the terms of span core span' (R(s) - s^2)."""
    yield _build_change(span, core, resonator)
    yield _build_change(span, -core, None)


def _build_change(span: Real, core: Real, shape: Shape | None) -> Change:
    """Return a core with a shape, or at s^2 without one: f(s) = 1 keeps it from bearing weight."""
    whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
    whole[..., 2 if shape is None else 0, :, :] = core
    return Change("body", span, span, whole, shape=shape or np.ones_like)
