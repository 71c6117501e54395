"""The equation of motion of a machine with its Parts, assembled at one theta."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from identification.words import Complex, Real
from mbmodel.linearisation.gravity import gravity_slope, gravity_stiffness
from mbmodel.machine import Machine
from mbmodel.parts import Change


@dataclass(frozen=True, eq=False)
class Matrices:
    """The equation of motion M q'' + C q' + K q = T' P f, in joint coordinates.

    Args:
        mass: M [kg, kg m^2]; (nv, nv).
        damping: C [N s/m, N m s/rad]; (nv, nv).
        stiffness: K [N/m, N m/rad]; (nv, nv).
    """

    mass: Real
    damping: Real
    stiffness: Real

    def dynamic_stiffness(self, laplace: complex) -> np.ndarray[tuple[int, int], np.dtype]:
        """Return Z(s) = s^2 M + s C + K at one complex s [rad/s]; (nv, nv)."""
        return laplace**2 * self.mass + laplace * self.damping + self.stiffness


@dataclass(frozen=True, eq=False)
class FrequencyDependentTerm:
    """A term of Z(s) that is no polynomial in s: ``f(s) left (core_0 + s core_1 + ...) right'``.

    Args:
        left: (nv, r).
        right: (nv, t).
        change: the change at bodies or joints that it comes from.
        body_left: its rows at the bodies; zero for a change at joints alone; (6 n_body, r).
        body_right: its columns there; (6 n_body, t).
        owner: first parameter of its Part, or the Part's location without any.
    """

    left: Real
    right: Real
    change: Change
    body_left: Real
    body_right: Real
    owner: str = ""

    @property
    def is_loop(self) -> bool:
        """Whether it is a control loop, which reads the motion of the bodies with the floor."""
        return self.change.slot == "bodies_and_joints"

    def at(self, laplace: Complex) -> Complex:
        """Return the core times f(s) at each s; (n_freq, r, t)."""
        return frequency_dependent_core(self.change, laplace)


def frequency_dependent_core(change: Change, laplace: Complex) -> Complex:
    """Return F(s) = f(s) (core_0 + s core_1 + s^2 core_2); (n_freq, r, t).

    Args:
        change: with its core (3, r, t), and f(s) if it has one.
        laplace: s [rad/s]; (n_freq,).
    """
    powers = laplace[:, None] ** np.arange(3)
    core: Complex = np.einsum("fk,krt->frt", powers, change.core)
    if change.shape is None:
        return core
    factor = change.shape(laplace)
    return core * (factor[:, None, None] if factor.ndim == 1 else factor)


@dataclass(frozen=True, eq=False)
class Assembly:
    """All factors of the equation of motion at one theta.

    Args:
        machine: the machine.
        jacobian: T; (6 n_body, nv).
        matrices: M, C, K in joint coordinates.
        body_changes: what Parts add to Zb.
        point_changes: what Parts add at sensors and hammer.
        frequency_dependent: what Parts add to Zb and Zj that is no polynomial in s.
        input_changes: what each Part changes in the factor of the inputs, by the Part's number.
        output_changes: what Parts add to the logarithm of the readings' factors.
    """

    machine: Machine
    jacobian: Real
    matrices: Matrices
    body_changes: tuple[Change, ...]
    point_changes: tuple[Change, ...]
    frequency_dependent: tuple[FrequencyDependentTerm, ...] = ()
    input_changes: Mapping[int, tuple[Change, ...]] = field(default_factory=dict)
    output_changes: tuple[Change, ...] = ()

    @cached_property
    def body(self) -> Real:
        """Zb: coefficients of s^0, s^1, s^2; (3, 6 n_body, 6 n_body)."""
        size = len(self.machine.body_mass)
        total = np.zeros((3, size, size))
        total[2] = self.machine.body_mass
        for change in self.body_changes:
            total += change.left @ change.core @ change.right.T
        return total

    @property
    def weight_bearing_mass(self) -> Real:
        """Mb, its rows times each body's weight fraction; (6 n_body, 6 n_body)."""
        return self.machine.weight_fraction[:, None] * self.body[2]

    @property
    def has_weight(self) -> bool:
        """Whether gravity is on."""
        return bool(self.machine.gravity.any())


def frequency_dependent_term(change: Change, jacobian: Real) -> FrequencyDependentTerm:
    """Return a change of joints, of bodies, or of both, in joint coordinates."""
    size, left, right = len(jacobian), change.left, change.right
    if change.slot == "joint":
        no_left, no_right = np.zeros((size, left.shape[1])), np.zeros((size, right.shape[1]))
        return FrequencyDependentTerm(left, right, change, no_left, no_right)
    if change.slot == "body":
        return FrequencyDependentTerm(jacobian.T @ left, jacobian.T @ right, change, left, right)
    if change.slot != "bodies_and_joints":
        raise ValueError(
            f"a change in slot {change.slot} has a shape f(s): use the slots joint or body"
        )
    return FrequencyDependentTerm(
        jacobian.T @ left[:size] + left[size:],
        jacobian.T @ right[:size] + right[size:],
        change,
        left[:size],
        right[:size],
    )


def add_product(total: Real, left: Real, core: Real, right: Real) -> None:
    """Add left core right' to the coefficients of s^0, s^1, s^2, in place.

    Most Parts touch a few coordinates only, so that only those rows and columns are computed.

    Args:
        total: coefficients; (3, n, n).
        left: (n, r).
        core: (3, r, t).
        right: (n, t).
    """
    rows = np.flatnonzero(left.any(axis=1))
    columns = rows if left is right else np.flatnonzero(right.any(axis=1))
    for power in np.flatnonzero(core.any(axis=(1, 2))).tolist():
        added = left[rows] @ core[power] @ right[columns].T
        total[power, rows[:, None], columns] += added


def _at_joints(jacobian: Real, frame: Real) -> Real:
    """Return T' F of a frame that few rows of bodies have; (nv, r)."""
    rows = np.flatnonzero(frame.any(axis=1))
    return np.asarray(jacobian[rows].T @ frame[rows])


def nominal_coefficients(machine: Machine, jacobian: Real) -> Real:
    """Return the coefficients of bodies, gravity and what no Part changes.

    Args:
        machine: at its static equilibrium.
        jacobian: T; (6 n_body, nv).

    Returns:
        Coefficients of s^0, s^1, s^2; (3, nv, nv).
    """
    total = np.stack([machine.remaining_stiffness, machine.remaining_damping, machine.armature])
    total[2] += jacobian.T @ machine.body_mass @ jacobian
    if machine.gravity.any():
        weight_bearing_mass = machine.weight_fraction[:, None] * machine.body_mass
        total[0] += gravity_stiffness(machine.weight, jacobian, weight_bearing_mass)
    return total


def kinematics_and_coefficients(
    machine: Machine,
    as_drawn: Callable[[], Real],
    path: Sequence[Change],
    body: Sequence[Change],
) -> tuple[Real, Real]:
    """Return T, and the coefficients of bodies and gravity, with the changes of Parts.

    Args:
        machine: at its static equilibrium.
        as_drawn: returns the coefficients without any Part; (3, nv, nv).
        path: changes of T.
        body: changes of Zb.
    """
    jacobian = machine.jacobian
    if not path:
        total = as_drawn().copy()
    else:
        jacobian = jacobian + sum(c.left @ c.core[0] @ c.right.T for c in path)
        total = nominal_coefficients(machine, jacobian)
    for change in body:
        left = _at_joints(jacobian, change.left)
        right = left if change.right is change.left else _at_joints(jacobian, change.right)
        add_product(total, left, change.core, right)
        if machine.gravity.any() and change.core[2].any():
            added = change.left @ change.core[2] @ change.right.T
            total[0] += gravity_slope(
                machine.weight,
                jacobian,
                machine.body_mass,
                inertia_change=machine.weight_fraction[:, None] * added,
            )
    return jacobian, total
