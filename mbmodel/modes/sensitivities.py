"""Exact derivatives of poles and shapes, for any scalar cost of them, by the adjoint method.

A pole s and its shape phi solve Z(s) phi = 0, Z(s) = s^2 M + s C + K + L(s), L the control loops
that are closed, time convention exp(+i w t). With Z' = 2 s M + C + L' and a row c that fixes the
size of phi, c' phi = 1, a small change dZ of the equation at fixed s gives (Nelson 1976, for the
quadratic eigenproblem)

    [ Z   Z' phi ] [ dphi ]   [ -dZ phi ]
    [ c'    0    ] [  ds  ] = [    0    ]

so that ds = -psi' dZ phi / (psi' Z' phi) with the left vector psi. A cost with
dJ = Re sum (conj(h) ds + conj(W) dy), y = L T phi, needs the transposed equation once per mode,

    [ Z'      c ] [ a  ]   [ T' L' conj(W) ]
    [ (Z' phi)' 0 ] [ mu ] = [    conj(h)    ],      dJ = -Re sum a' dZ phi + the change of L T,

which is the derivative of an FRF whose lines are the poles and whose motion is phi. So the sums of
``mbmodel.frf.adjoint`` serve all Parts here too, and no left vector is formed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.words import Complex, Integers, Mask, Output, Real, Signal, UsageError
from mbmodel.assembly import Assembly
from mbmodel.frf.adjoint import gradient
from mbmodel.frf.solution import FrfSolution
from mbmodel.frf.solver import Solver
from mbmodel.model import Model
from mbmodel.modes.closed_loop_modes import LawProblem, modes_of_assembly
from mbmodel.modes.matrix_modes import Modes
from mbmodel.parts import Change
from mbmodel.ports.ports import Ports, apply_point_changes, find_ports
from mbmodel.ports.request import FrfRequest

_MIN_POLE_DISTANCE = 1e-7  # relative: closer poles coincide, and their shapes have no derivative
_ASYMMETRY = 1e-9  # of the largest entry: what rounding leaves of symmetric matrices
_SINGULAR_VALUE_CUT = 1e-5  # relative: smaller singular values of their equation are left out


@dataclass(frozen=True, eq=False)
class LinearisedModes:
    """Modes of a model at theta, and their derivatives.

    Args:
        theta: parameters in SI; (n_parameter,).
        outputs: labels where shapes are read; n_out.
        ports: L at theta.
        modes: poles and shapes in joint coordinates.
    """

    model: Model
    theta: Real
    outputs: tuple[Output, ...]
    assembly: Assembly
    ports: Ports
    modes: Modes

    @cached_property
    def shapes(self) -> Complex:
        """Motion of the outputs in each mode, L T phi; (n_out, n_mode)."""
        return (
            self.ports.readout @ self.assembly.jacobian + self.ports.joint_readout
        ) @ self.modes.shapes

    def gradient(self, chosen: Integers, by_poles: Complex, by_shapes: Complex) -> Real:
        """Return the derivative of a scalar cost of some modes by every parameter.

        The cost must not depend on the size and phase of the shapes, which a normalisation fixes.
        For poles that coincide, the part of a shape's derivative that turns it within their common
        space does not exist and is left out.

        Args:
            chosen: numbers of the modes, none at rest; (n_chosen,).
            by_poles: h with dJ = Re sum conj(h) ds; (n_chosen,).
            by_shapes: W with dJ = Re sum conj(W) dy; (n_out, n_chosen).

        Returns:
            dJ / dtheta in SI; (n_parameter,).

        Raises:
            UsageError: a mode at rest, whose pole has no derivative.
        """
        poles = self.modes.poles[chosen]
        if not poles.all():
            raise UsageError("a motion at rest has no pole to differentiate: leave this mode out")
        solver = _BorderedSolver(self.assembly, self.modes, chosen, by_poles.conj())
        count = len(self.outputs)
        solution = FrfSolution(
            self.model,
            self.theta,
            _RequestAtPoles(
                np.abs(poles), self.outputs, (Signal("mode"),), "receptance", laplace_at=poles
            ),
            None,
            self.assembly,
            self.ports,
            solver,
            np.ascontiguousarray(self.modes.shapes[:, None, chosen]),
        )
        cotangent = by_shapes.T.reshape(len(chosen), count, 1)
        return gradient(solution, self._slopes, cotangent)

    def pole_slopes(self, chosen: Integers) -> Complex:
        """Return the derivatives of poles by every parameter; (n_parameter, n_chosen).

        With symmetric M, C and K, left and right eigenvectors are one, and

            ds / dp = -phi' (dZ/dp)(s) phi / (phi' Z'(s) phi)

        (Fox and Kapoor 1968, for the quadratic eigenvalue problem), without a solution of an
        equation. Otherwise, and where joints move, each pole is differentiated by ``gradient``.

        Args:
            chosen: numbers of the modes, none at rest; (n_chosen,).
        """
        matrices, laws = self.assembly.matrices, self.assembly.frequency_dependent
        stacked = np.array([matrices.mass, matrices.damping, matrices.stiffness])
        skew = np.abs(stacked - stacked.swapaxes(1, 2)).max(axis=(1, 2))
        is_symmetric = (skew <= _ASYMMETRY * np.abs(stacked).max(axis=(1, 2))).all()
        moves_joints = any(c.slot == "path" for changes in self._slopes for c in changes)
        if laws or moves_joints or not is_symmetric:
            return np.stack([self._pole_slope(number) for number in chosen.tolist()], axis=1)
        poles, shapes = self.modes.poles[chosen], self.modes.shapes[:, chosen]
        at_bodies = self.assembly.jacobian @ shapes
        powers = poles ** np.arange(3)[:, None]
        slope = 2 * poles * (matrices.mass @ shapes) + matrices.damping @ shapes
        below = np.einsum("im,im->m", shapes, slope)
        rows = []
        for part, changes in zip(self.model.parts, self._slopes, strict=True):
            total = np.zeros((len(part.parameters), len(chosen)), complex)
            for change in changes:
                if change.slot not in ("joint", "body"):
                    continue
                motion = shapes if change.slot == "joint" else at_bodies
                left, right = change.left.T @ motion, change.right.T @ motion
                total += np.einsum(
                    "rm,pkrt,tm,km->pm", left, change.core, right, powers, optimize=True
                )
            rows.append(-total / below)
        return np.concatenate([*rows, np.zeros((0, len(chosen)), complex)])

    def _pole_slope(self, number: int) -> Complex:
        """Return the derivative of one pole by every parameter; (n_parameter,)."""
        no_shapes = np.zeros((len(self.outputs), 1), complex)
        real, imaginary = (
            self.gradient(np.array([number]), np.array([unit]), no_shapes) for unit in (1.0, 1j)
        )
        return np.asarray(real + 1j * imaginary, np.complex128)

    @cached_property
    def _slopes(self) -> list[tuple[Change, ...]]:
        """Derivatives of every Part's change.

        Poles have no readings that a factor scales, and do not follow the laws of Parts.
        """
        return [
            tuple(change for change in changes if change.slot != "output" and change.shape is None)
            for changes in self.model.slopes(self.theta)
        ]


class ModeEvaluator:
    """Linearises modes at many theta: labels are looked up once.

    Args:
        outputs: labels where shapes are read.

    Raises:
        UsageError: a label that the machine does not have.
    """

    def __init__(self, model: Model, outputs: Sequence[Output]) -> None:
        self.model, self.outputs = model, tuple(outputs)
        ports = find_ports(model.machine, self.outputs, ())
        size, nv = len(model.machine.body_mass), len(model.machine.coordinates)
        no_input = np.zeros((size, 1))
        self._ports = replace(ports, force=no_input, motor=np.zeros((nv, 1)), floor=no_input)

    def at(self, theta: Real) -> LinearisedModes:
        """Return modes at theta, with derivatives."""
        # Poles have no readings: the factors of the readings belong to FRFs. Of laws that are no
        # polynomials in s, modes follow control loops alone.
        whole = self.model.assemble(theta)
        loops = tuple(term for term in whole.frequency_dependent if term.is_loop)
        assembly = replace(whole, output_changes=(), frequency_dependent=loops)
        sensors = [change for change in assembly.point_changes if change.slot == "sensor"]
        ports = apply_point_changes(self._ports, sensors, self.outputs, ())
        return LinearisedModes(
            self.model, theta, self.outputs, assembly, ports, modes_of_assembly(assembly)
        )


@dataclass(frozen=True, eq=False)
class _RequestAtPoles(FrfRequest):
    """A request whose lines are poles instead of frequencies; nothing drives them."""

    laplace_at: Complex | None = None

    @cached_property
    def laplace(self) -> Complex:
        """The poles [rad/s]; (n_chosen,)."""
        return np.asarray(self.laplace_at, np.complex128)


class _BorderedSolver(Solver):
    """A solver that returns the adjoint vectors a of the bordered equation, one per mode."""

    def __init__(
        self, assembly: Assembly, modes: Modes, chosen: Integers, right_of_poles: Complex
    ) -> None:
        super().__init__(assembly.matrices, modes.poles[chosen], None)
        self._problem = LawProblem(assembly.matrices, (), assembly.frequency_dependent)
        self._shapes, self._right = modes.shapes[:, chosen], right_of_poles
        self._close = _has_coinciding_pole(modes.poles, chosen)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """Return the vectors a for T' L' conj(W) = ``through`` times ``force``; (nv, 1, n_chosen).

        Rows and columns are scaled by the masses and by s, so that metres and radians compare.

        Raises:
            UsageError: an equation that is not an adjoint one.
        """
        if not transposed or factor is not None or through is None:
            raise UsageError(
                "the solver at poles solves adjoint equations only: use an Evaluator for FRFs"
            )
        size = 1.0 / np.sqrt(np.diag(self.matrices.mass))
        poles, count = np.abs(self.laplace), len(size)
        dynamic, slope = self._problem.stiffness_and_slope(self.laplace)
        border = np.einsum("kij,jk->ki", slope, self._shapes) * size
        scaled_shapes = (self._shapes / size[:, None]).T
        matrix = np.zeros((len(poles), count + 1, count + 1), complex)
        scaled = dynamic.transpose(0, 2, 1) * np.outer(size, size)
        matrix[:, :count, :count] = scaled / poles[:, None, None] ** 2
        matrix[:, :count, count] = scaled_shapes.conj() / (np.abs(scaled_shapes) ** 2).sum(
            axis=1, keepdims=True
        )
        matrix[:, count, :count] = border / poles[:, None]
        right = np.empty((len(poles), count + 1), complex)
        right[:, :count] = (through @ force[:, 0]).T * size
        right[:, count] = self._right * poles
        solutions = (
            _solve_bordered(matrix, right, self._close)[:, :count] * size / poles[:, None] ** 2
        )
        return np.ascontiguousarray(solutions.T[:, None, :])


def _has_coinciding_pole(poles: Complex, chosen: Integers) -> Mask:
    """Return which of the chosen poles coincide with another; (n_chosen,)."""
    away = np.abs(poles[chosen, None] - poles)
    away[np.arange(len(chosen)), chosen] = np.inf
    return away.min(axis=1, initial=np.inf) <= _MIN_POLE_DISTANCE * np.abs(poles[chosen])


def _solve_bordered(matrix: Complex, right: Complex, close: Mask) -> Complex:
    """Solve one bordered equation per mode.

    Where poles coincide, the least-squares solution leaves out the direction without an answer.

    Args:
        matrix: (n_chosen, nv + 1, nv + 1).
        right: (n_chosen, nv + 1).
        close: modes whose poles coincide with another; (n_chosen,).
    """
    solutions = np.empty_like(right)
    apart = ~close
    solutions[apart] = np.linalg.solve(matrix[apart], right[apart, :, None])[..., 0]
    for k in np.flatnonzero(close):
        solutions[k] = np.linalg.lstsq(matrix[k], right[k], rcond=_SINGULAR_VALUE_CUT)[0]
    return solutions
