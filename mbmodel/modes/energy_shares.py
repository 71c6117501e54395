"""Energy shares of a mode: which springs store its energy, which dampers dissipate it.

For a shape phi with M-norm 1, the strain energy of spring i is k_i |g_i phi|^2 / 2 of the sum
phi^H K phi / 2. The kinetic energy of direction j of a body is Re(conj(b_j) (Mb b)_j) with
b = T phi, and damper i dissipates c_i |g_i phi|^2 of phi^H C phi per cycle (Ewins 2000, ch. 2). For
lightly damped modes the strain share is the sensitivity of the frequency,
d ln f = share / 2 d ln k, and the dissipation share is the damper's part of the damping ratio.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import DIRECTIONS, Complex, Real
from mbmodel.assembly import Assembly
from mbmodel.linearisation.gravity import gravity_stiffness
from mbmodel.model import Model
from mbmodel.modes.matrix_modes import Modes
from mbmodel.parts import SpringPart

# Of the sum of absolute energies: a smaller remainder that no spring explains is rounding.
_MAX_UNATTRIBUTED_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class EnergyShares:
    """Shares of each mode; the absolute values of strain and of dissipation add up to 1 per mode.

    Negative shares drive the motion, as gravity does for an inverted pendulum. A column is 0 if
    there is nothing to share. Kinetic shares add up to 1, but a direction of a body with products
    of inertia may have a slightly negative one.

    Args:
        springs: names of joint coordinates, tendons, and other sources of stiffness or damping.
        stages: place of each spring, ``joint:<stage>`` or ``tendon:<name>``.
        strain: (n_spring, n_mode).
        dissipation: (n_spring, n_mode).
        motions: ``<body>:<direction>``, and armatures by coordinate.
        bodies: body of each motion; ``joint`` for armatures.
        kinetic: (n_motion, n_mode).
    """

    springs: tuple[str, ...]
    stages: tuple[str, ...]
    strain: Real
    dissipation: Real
    motions: tuple[str, ...]
    bodies: tuple[str, ...]
    kinetic: Real

    def by_stage(self, table: Real) -> dict[str, Real]:
        """Return strain or dissipation summed over the springs of each stage; (n_mode,) each.

        Args:
            table: ``strain`` or ``dissipation``; (n_spring, n_mode).
        """
        return _sum_by_owner(self.stages, table)

    def by_body(self) -> dict[str, Real]:
        """Return the kinetic energy of each body; (n_mode,) each."""
        return _sum_by_owner(self.bodies, self.kinetic)


def _sum_by_owner(owners: tuple[str, ...], table: Real) -> dict[str, Real]:
    """Return the sum of the rows of each owner."""
    total: dict[str, Real] = {}
    for owner, row in zip(owners, table, strict=True):
        total[owner] = total.get(owner, np.zeros(len(row))) + row
    return total


def energy_shares(model: Model, theta: Real, modes: Modes) -> EnergyShares:
    """Return the shares of strain energy, kinetic energy and dissipation in every mode.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    model = model.at_rest(theta)
    assembly = model.assemble(theta)
    shapes = modes.shapes
    rows = _spring_rows(model, theta, assembly, shapes)
    totals = (assembly.matrices.stiffness, assembly.matrices.damping)
    if assembly.has_weight:
        machine = assembly.machine
        weight = gravity_stiffness(
            machine.weight,
            assembly.jacobian,
            assembly.weight_bearing_mass,
        )
        strain_of_gravity = _quadratic(weight, shapes)
        rows.append(("gravity", "gravity", strain_of_gravity, np.zeros_like(strain_of_gravity)))
    attributed = ([strain for *_, strain, _ in rows], [loss for *_, loss in rows])
    remainder = [
        _quadratic(matrix, shapes) - np.sum([np.zeros(shapes.shape[1]), *listed], axis=0)
        for matrix, listed in zip(totals, attributed, strict=True)
    ]
    scales = [_quadratic(np.abs(matrix), np.abs(shapes).astype(complex)) for matrix in totals]
    if any(
        (np.abs(a) > _MAX_UNATTRIBUTED_SHARE * b).any()
        for a, b in zip(remainder, scales, strict=True)
    ):
        rows.append(("other", "other", remainder[0], remainder[1]))
    motions, bodies, kinetic = _kinetic_rows(assembly, shapes)
    count = len(modes.poles)
    at_rest = np.array([bool(name) for name in modes.names], bool)
    return EnergyShares(
        tuple(name for name, *_ in rows),
        tuple(stage for _, stage, *_ in rows),
        _shares([strain for *_, strain, _ in rows], count, at_rest),
        _shares([loss for *_, loss in rows], count, at_rest),
        motions,
        bodies,
        np.array(kinetic) / np.sum(kinetic, axis=0),
    )


def _shares(rows: list[Real], count: int, absent: np.ndarray) -> Real:
    """Return columns divided by the sums of their absolute values.

    Args:
        rows: (n_mode,) each.
        count: number of modes.
        absent: modes whose column is zero; (n_mode,).
    """
    table = np.array(rows).reshape(-1, count)
    size: Real = np.abs(table).sum(axis=0)
    empty = absent | (size == 0)
    return np.where(empty, 0.0, table / np.where(empty, 1.0, size))


def _quadratic(matrix: Real, shapes: Complex) -> Real:
    """Return Re phi^H A phi of every shape; (n_mode,)."""
    return (shapes.conj() * (matrix @ shapes)).sum(axis=0).real


def _spring_rows(
    model: Model, theta: Real, assembly: Assembly, shapes: Complex
) -> list[tuple[str, str, Real, Real]]:
    """Return name, stage, strain and loss of every spring."""
    rows = []
    for part, values in zip(model.parts, model.split_parameters(theta), strict=True):
        if isinstance(part, SpringPart):
            for spring, row, stiffness, damping in part.rows(values, assembly.jacobian):
                stretch: Real = np.abs(row @ shapes) ** 2
                geometric = np.zeros(shapes.shape[1])
                if spring.geometric is not None:
                    geometric = _quadratic(spring.geometric, shapes)
                strain = stiffness * (stretch + geometric)
                rows.append((spring.name, part.location, strain, damping * stretch))
    return rows


def _kinetic_rows(
    assembly: Assembly, shapes: Complex
) -> tuple[tuple[str, ...], tuple[str, ...], list[Real]]:
    """Return names of motions, their bodies, and the kinetic energy of each."""
    machine = assembly.machine
    motion = assembly.jacobian @ shapes
    momentum = assembly.body[2] @ motion
    rows = list((motion.conj() * momentum).real)
    names = [f"{body}:{direction}" for body in machine.layout.bodies for direction in DIRECTIONS]
    bodies = [body for body in machine.layout.bodies for _ in DIRECTIONS]
    armature = (shapes.conj() * (machine.armature @ shapes)).real
    for name, row in zip(machine.coordinates, armature, strict=True):
        if row.any():
            names.append(f"{name}:armature")
            bodies.append("joint")
            rows.append(row)
    return tuple(names), tuple(bodies), rows
