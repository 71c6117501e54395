"""Derivatives of the equation of motion and of the readout by each parameter, as real matrices.

    M q'' + C q' + K q = F u,    y = G q^(order)

A parameter changes them by delta A, to first order (exactly for stiffness, damping and mass),

    A = [[dK, dC, dM, -dF], [dG in the block of the order, 0]]    on (q, q', q'', u).

For a spring A is g g' in the block of K, of rank one. For a mass it is T' dMb T in the block of M,
of rank three, with T' dMb U in dF where the floor moves, and with the stiffness of its weight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from mbmodel import Change, Linearised
from mbmodel.linearisation.gravity import gravity_slope

_INERTIA_POWER_OF_S = 2


@dataclass(frozen=True, eq=False)
class MatrixSlope:
    """Derivative of the equation and of the readout by one parameter.

    Args:
        polynomial: dK, dC, dM; (3, nv, nv).
        drive: dF; (nv, n_in).
        readout: dG; (n_out, nv).
    """

    polynomial: Real
    drive: Real
    readout: Real

    def stack(self, orders: Sequence[int]) -> Real:
        """Return A; (nv + n_out, 3 nv + n_in).

        Args:
            orders: derivative that each output reads; n_out.
        """
        size, count = len(self.drive), self.drive.shape[1]
        forces = np.hstack([*self.polynomial, -self.drive])
        readings = np.zeros((len(self.readout), 3 * size + count))
        for reading, order, row in zip(readings, orders, self.readout, strict=True):
            reading[order * size : (order + 1) * size] = row
        return np.vstack([forces, readings])


def part_slopes(lines: Linearised, changes: tuple[Change, ...]) -> list[MatrixSlope]:
    """Return the derivatives by the parameters of one Part; n_parameter.

    Args:
        lines: the model at the point of linearisation.
        changes: slopes of the Part, in the slots joint, body and path, without f(s).
    """
    count = len(changes[0].core) if changes else 0
    size, n_in = lines.drive.shape
    slopes = [
        MatrixSlope(
            np.zeros((3, size, size)), np.zeros((size, n_in)), np.zeros(lines.readout.shape)
        )
        for _ in range(count)
    ]
    for change in changes:
        for slope, core in zip(slopes, change.core, strict=True):
            if change.slot == "joint":
                slope.polynomial[:] += change.left @ core @ change.right.T
            elif change.slot == "body":
                _add_body_slope(lines, slope, change.left @ core @ change.right.T)
            else:
                _add_path_slope(lines, slope, change.left @ core[0] @ change.right.T)
    return slopes


def _add_body_slope(lines: Linearised, slope: MatrixSlope, body: Real) -> None:
    """Add the change of Zb, body (3, 6 n_body, 6 n_body)."""
    assembly, machine = lines.assembly, lines.assembly.machine
    jacobian = assembly.jacobian
    slope.polynomial[:] += jacobian.T @ body @ jacobian
    slope.drive[:] -= jacobian.T @ body[_INERTIA_POWER_OF_S] @ lines.ports.floor
    if assembly.has_weight and body[_INERTIA_POWER_OF_S].any():
        slope.polynomial[0] += gravity_slope(
            machine.weight,
            jacobian,
            assembly.weight_bearing_mass,
            inertia_change=machine.weight_fraction[:, None] * body[_INERTIA_POWER_OF_S],
        )


def _add_path_slope(lines: Linearised, slope: MatrixSlope, path: Real) -> None:
    """Add the change of T, path (6 n_body, nv)."""
    assembly, machine, ports = lines.assembly, lines.assembly.machine, lines.ports
    jacobian, body = assembly.jacobian, assembly.body
    slope.polynomial[:] += path.T @ body @ jacobian + jacobian.T @ body @ path
    slope.drive[:] += path.T @ (ports.force - body[_INERTIA_POWER_OF_S] @ ports.floor)
    slope.readout[:] += ports.readout @ path
    if assembly.has_weight:
        slope.polynomial[0] += gravity_slope(
            machine.weight,
            jacobian,
            assembly.weight_bearing_mass,
            jacobian_change=path,
        )
