"""Dynamic stiffness of a small mass on a spring, and how it is written into an MJCF.

A mass m on a spring of natural frequency w0 and damping ratio zeta moves along one axis of a body.
It adds to the body's dynamic stiffness along that axis

    m R(s),   R = s^2 S / (s^2 + S),   S = 2 zeta w0 s + w0^2.

Far below w0 this is the inertia of a mass, far above w0 it vanishes. The three world axes have a
mass each, m_a, so that the appendage may move along one axis or along all. With M the largest of
these, a rigid part adds along each axis

    r_a s^2,   r_a = across (M - m_a) - counted M.

``across`` is 0 if the appendage is felt along its axes alone, such as a hanging cable, and 1 if it
is rigid across them, such as a box on flexures. ``counted`` is 1 if the nominal body's mass holds
the appendage already. ``resonator.py`` has R.
"""

from dataclasses import dataclass

import numpy as np

from diagnosis.effects.appendage_masses import (
    find_rigid_masses,
    find_rigid_slopes,
    find_single_axis,
)
from diagnosis.effects.resonator import build_resonator, build_resonator_slope
from diagnosis.effects.scales import (
    ARM_UNIT_M,
    LOG_FREQUENCY_UNIT,
    LOG_UNIT,
    MASS_SHARE_UNIT,
)
from diagnosis.effects.spring_laws import Shape
from diagnosis.scene_points import name_vector
from identification.words import Real
from mbmodel import (
    AddedPart,
    Addition,
    Change,
    Machine,
    Parameter,
    directed_mass_elements,
    suspended_mass_elements,
    transport,
)

SCAN_DAMPING_RATIO = 0.03  # of scanned appendages, and where their damping starts


@dataclass(frozen=True, eq=False)
class AppendagePart:
    """Masses along three axes at one point, on springs of one frequency and damping.

    With G = [1, -[p]x] the motion of the point p per motion of the body, it adds
    G' diag(m) G R(s) + G' diag(r) G s^2. Parameters: m (3), frequency, damping, p (3), across and
    counted.

    Args:
        machine: machine that carries it.
        number: number of the body.
        name: prefix of its parameters.
        frequency: natural frequency of the scan [Hz].
        frame: coordinates of the body among those of all bodies; (6 n_body, 6).
        is_box: whether it starts as rigid across its axes. Score tests start all parameters at
            zero, so that its parameter is then 1 - ``across``.
    """

    machine: Machine
    number: int
    name: str
    frequency: float
    frame: Real
    is_box: bool = False

    @property
    def mass_names(self) -> tuple[str, ...]:
        """Names of the masses along the world axes."""
        return name_vector(f"{self.name}.mass_")

    @property
    def place_names(self) -> tuple[str, ...]:
        """Names of the components of the place, from the centre of mass."""
        return name_vector(f"{self.name}.position_")

    @property
    def rigid_names(self) -> tuple[str, str]:
        """Names of the shares of the rigid part."""
        return f"{self.name}.{'slack' if self.is_box else 'across'}", f"{self.name}.counted"

    @property
    def resonance_names(self) -> tuple[str, str]:
        """Names of frequency and damping."""
        return f"{self.name}.frequency", f"{self.name}.damping"

    @property
    def inertia(self) -> Real:
        """Spatial inertia of the body; (6, 6)."""
        span = slice(6 * self.number, 6 * self.number + 6)
        return self.machine.body_mass[span, span]

    @property
    def mass_unit(self) -> float:
        """Unit of the masses [kg]."""
        return MASS_SHARE_UNIT * float(self.inertia[0, 0])

    def build(self) -> AddedPart:
        """Return the Part."""
        units = [f"{self.mass_unit:g} kg"] * 3
        units += [f"{LOG_FREQUENCY_UNIT:.0%}", f"{LOG_UNIT:.0%}"] + [f"{ARM_UNIT_M:g} m"] * 3
        units += ["1"] * 2
        names = (*self.mass_names, *self.resonance_names, *self.place_names, *self.rigid_names)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(names, units, strict=True)
        )
        location = f"body:{self.machine.layout.bodies[self.number]}"
        return AddedPart(
            location,
            parameters,
            self.compute_change,
            self.compute_slopes,
            written=self.write,
            weighs=self.weigh,
            leave_out=self.leave_out_small_masses,
        )

    def find_resonance(self, theta: Real) -> tuple[float, float]:
        """Return the natural frequency [rad/s] and the damping ratio."""
        omega = 2 * np.pi * self.frequency * float(np.exp(LOG_FREQUENCY_UNIT * theta[3]))
        return omega, SCAN_DAMPING_RATIO * float(np.exp(LOG_UNIT * theta[4]))

    def _build_change(self, core: Real, shape: Shape | None) -> Change:
        """Return the change by a core at s^0 with a shape, or at s^2 without one.

        Under gravity, f(s) = 1 keeps a mass along single axes from bearing weight.
        """
        whole = np.zeros((*core.shape[:-2], 3, 6, 6))
        whole[..., 2 if shape is None else 0, :, :] = core
        if shape is None and self.machine.gravity.any():
            shape = np.ones_like
        return Change("body", self.frame, self.frame, whole, shape=shape)

    def _move(self, theta: Real) -> Real:
        """Return G, the motion of the appendage's place per motion of the body; (3, 6)."""
        return transport(ARM_UNIT_M * theta[5:8])[:3]

    def _sum_inertia(self, theta: Real, masses: Real) -> Real:
        """Return G' diag(masses) G; (6, 6)."""
        moved = self._move(theta)
        return self.mass_unit * moved.T @ (masses[:, None] * moved)

    def find_across(self, value: float) -> float:
        """Return how rigid it is across its axes, from 0 to 1, from its parameter."""
        return 1.0 - value if self.is_box else value

    def _resolve(self, theta: Real) -> Real:
        """Return the parameters with ``across`` at its place; (n_parameter,)."""
        resolved = theta.copy()
        resolved[8] = self.find_across(float(theta[8]))
        return resolved

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change by all three masses on their springs, and by their rigid part."""
        theta = self._resolve(theta)
        sprung = self._sum_inertia(theta, theta[:3])
        rigid = self._sum_inertia(theta, find_rigid_masses(theta))
        resonator = build_resonator(*self.find_resonance(theta))
        return self._build_change(sprung, resonator), self._build_change(rigid, None)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by masses and place, of the rigid part, by frequency and damping."""
        theta = self._resolve(theta)
        omega, zeta = self.find_resonance(theta)
        sprung = self._find_slopes(theta, theta[:3], np.eye(3, len(theta)))
        slopes = find_rigid_slopes(theta)
        slopes[:, 8] *= -1.0 if self.is_box else 1.0
        rigid = self._find_slopes(theta, find_rigid_masses(theta), slopes)
        changes = [
            self._build_change(sprung, build_resonator(omega, zeta)),
            self._build_change(rigid, None),
        ]
        if theta[:3].any():
            rates = np.array([[2 * zeta * omega, 2 * omega**2], [2 * zeta * omega, 0.0]])
            rates *= [[LOG_FREQUENCY_UNIT], [LOG_UNIT]]
            for place, (linear, constant) in enumerate(rates.tolist(), start=3):
                sensitivity = np.zeros((len(theta), 6, 6))
                sensitivity[place] = self._sum_inertia(theta, theta[:3])
                shape = build_resonator_slope(omega, zeta, (linear, constant))
                changes.append(self._build_change(sensitivity, shape))
        return tuple(changes)

    def _find_slopes(self, theta: Real, masses: Real, slopes: Real) -> Real:
        """Return the slopes of G' diag(masses) G; (n_parameter, 6, 6).

        Args:
            theta: parameters; (n_parameter,).
            masses: masses along the axes; (3,).
            slopes: their slopes; (3, n_parameter).
        """
        moved = self._move(theta)
        core: Real = np.einsum("ai,ap,aj->pij", moved, slopes, moved)
        momentum = masses[:, None] * moved
        for k, direction in enumerate(np.eye(3)):
            turned = transport(ARM_UNIT_M * direction)[:3] - np.eye(3, 6)
            core[5 + k] += turned.T @ momentum + momentum.T @ turned
        return self.mass_unit * core

    def leave_out_small_masses(self, theta: Real) -> Real:
        """Return the parameters without masses that no verdict states, a unit of the largest."""
        small = theta[:3] <= MASS_SHARE_UNIT * theta[:3].max()
        return np.where(np.append(small, np.zeros(len(theta) - 3, bool)), 0.0, theta)

    def weigh(self, theta: Real) -> Real:
        """Return the spatial inertia that the nominal body counts already, negative; (6, 6)."""
        return -self._sum_inertia(theta, np.full(3, theta[9] * theta[:3].max()))

    def write(self, theta: Real) -> tuple[Addition, ...]:
        """Return masses on springs, which slide along an axis, and masses that act along one.

        The body feels each of them along its axis alone. Along a single axis any place is alike, so
        the nearest one is written; an appendage that is rigid across it has but one place.
        """
        theta = self._resolve(theta)
        omega, zeta = self.find_resonance(theta)
        sprung, place = self.mass_unit * theta[:3], ARM_UNIT_M * theta[5:8]
        rigid = self.mass_unit * theta[8] * (theta[:3].max() - theta[:3])
        layout = self.machine.layout
        body, centre = layout.bodies[self.number], layout.centres[self.number]
        single = np.zeros(3, bool) if theta[8] else find_single_axis(sprung)
        additions: list[Addition] = []
        for axis, direction in enumerate(np.eye(3)):
            name = f"{body}.appendage_{'xyz'[axis]}"
            nearest = np.where(single, 0.0, place) if single[axis] else place
            along = centre + nearest, direction
            if sprung[axis] > 0:
                sizes = sprung[axis] * np.array([1.0, omega**2, 2 * zeta * omega])
                additions += suspended_mass_elements(name, self.machine, body, along, sizes)
            if rigid[axis] > 0:
                additions += directed_mass_elements(
                    f"{name}_rigid", self.machine, body, along, float(rigid[axis])
                )
        return tuple(additions)
