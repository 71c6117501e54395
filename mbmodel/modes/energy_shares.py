r"""Where a mode stores and loses its energy: which spring to touch, which damper works.

For a shape phi, with M-norm 1, the strain of spring i is k_i |g_i phi|^2 / 2 of the sum
phi^H K phi / 2, the kinetic energy of direction j of a body Re(conj(b_j) (Mb b)_j) with b = T phi,
and damper i loses c_i |g_i phi|^2 of phi^H C phi a cycle (Ewins 2000, ch. 2). Of lightly damped
modes the strain share is the sensitivity of the frequency, d ln f = share / 2 d ln k, and the
dissipation share the damper's part of the damping ratio.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import DIRECTIONS, Complex, Real
from mbmodel.linearisation.gravity import gravity_stiffness
from mbmodel.model import Assembly, Model
from mbmodel.modes.model_modes import Modes
from mbmodel.parts import SpringPart

_ROUNDING = 1e-9  # of forces that no spring accounts for


@dataclass(frozen=True, eq=False)
class Energy:
    """Shares of each mode; of strain and dissipation the sizes in every column add up to 1.

    What drives a motion on, as gravity an inverted pendulum, has a negative share; where there is
    nothing to share the column is 0. Kinetic energy adds up to 1, though a direction of a body
    with products of inertia may hold a little less than none.

    Args:
        springs: names of joint coordinates, tendons, and what else is stiff or damps.
        stages: where each spring belongs, ``joint:<stage>`` or ``tendon:<name>``.
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
        """Strain or dissipation summed over the springs of each stage; (n_mode,) each."""
        return _summed(self.stages, table)

    def by_body(self) -> dict[str, Real]:
        """Kinetic energy of each body; (n_mode,) each."""
        return _summed(self.bodies, self.kinetic)


def _summed(owners: tuple[str, ...], table: Real) -> dict[str, Real]:
    total: dict[str, Real] = {}
    for owner, row in zip(owners, table, strict=True):
        total[owner] = total.get(owner, np.zeros(len(row))) + row
    return total


def energy(model: Model, theta: Real, found: Modes) -> Energy:
    """Shares of strain and kinetic energy and of dissipation in every mode."""
    assembly = model.assemble(theta)
    shapes = found.shapes
    rows = _springs(model, theta, assembly, shapes)
    whole = (assembly.matrices.stiffness, assembly.matrices.damping)
    if assembly.has_weight:
        machine = model.machine
        weight = gravity_stiffness(
            machine.gravity, machine.order, assembly.jacobian, assembly.heavy
        )
        pull = _quadratic(weight, shapes)
        rows.append(("gravity", "gravity", pull, np.zeros_like(pull)))
    known = ([strain for *_, strain, _ in rows], [loss for *_, loss in rows])
    left = [
        _quadratic(matrix, shapes) - np.sum([np.zeros(shapes.shape[1]), *listed], axis=0)
        for matrix, listed in zip(whole, known, strict=True)
    ]
    size = [_quadratic(np.abs(matrix), np.abs(shapes).astype(complex)) for matrix in whole]
    if any((np.abs(a) > _ROUNDING * b).any() for a, b in zip(left, size, strict=True)):
        rows.append(("other", "other", left[0], left[1]))
    motions, bodies, kinetic = _kinetic(assembly, shapes)
    count = len(found.poles)
    rests = np.array([bool(name) for name in found.names], bool)
    return Energy(
        tuple(name for name, *_ in rows),
        tuple(stage for _, stage, *_ in rows),
        _shares([strain for *_, strain, _ in rows], count, rests),
        _shares([loss for *_, loss in rows], count, rests),
        motions,
        bodies,
        np.array(kinetic) / np.sum(kinetic, axis=0),
    )


def _shares(rows: list[Real], count: int, absent: np.ndarray) -> Real:
    """Columns over the sums of their sizes; zero where there is nothing to share."""
    table = np.array(rows).reshape(-1, count)
    size: Real = np.abs(table).sum(axis=0)
    empty = absent | (size == 0)
    shares: Real = np.where(empty, 0.0, table / np.where(empty, 1.0, size))
    return shares


def _quadratic(matrix: Real, shapes: Complex) -> Real:
    """Re phi^H A phi of every shape; (n_mode,)."""
    result: Real = (shapes.conj() * (matrix @ shapes)).sum(axis=0).real
    return result


def _springs(
    model: Model, theta: Real, assembly: Assembly, shapes: Complex
) -> list[tuple[str, str, Real, Real]]:
    """Name, stage, strain and loss of every spring."""
    rows = []
    for part, piece in zip(model.parts, model.pieces(theta), strict=True):
        if isinstance(part, SpringPart):
            for spring, row, stiffness, damping in part.rows(piece, assembly.jacobian):
                stretch: Real = np.abs(row @ shapes) ** 2
                tense = np.zeros(shapes.shape[1])
                if spring.geometric is not None:
                    tense = _quadratic(spring.geometric, shapes)
                strain = stiffness * (stretch + tense)
                rows.append((spring.name, part.location, strain, damping * stretch))
    return rows


def _kinetic(
    assembly: Assembly, shapes: Complex
) -> tuple[tuple[str, ...], tuple[str, ...], list[Real]]:
    machine = assembly.machine
    motion = assembly.jacobian @ shapes
    momentum = assembly.body[2] @ motion
    rows = list((motion.conj() * momentum).real)
    names = [f"{body}:{way}" for body in machine.layout.bodies for way in DIRECTIONS]
    bodies = [body for body in machine.layout.bodies for _ in DIRECTIONS]
    armature = (shapes.conj() * (machine.armature @ shapes)).real
    for name, row in zip(machine.coordinates, armature, strict=True):
        if row.any():
            names.append(f"{name}:armature")
            bodies.append("joint")
            rows.append(row)
    return tuple(names), tuple(bodies), rows
