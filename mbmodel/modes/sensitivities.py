r"""Exact derivatives of poles and shapes, for any scalar cost of them, by the adjoint method.

A pole s and its shape phi solve Z(s) phi = 0, Z(s) = s^2 M + s C + K, time convention
exp(+i w t). With Z' = 2 s M + C and a row c that fixes the size of phi, c' phi = 1, a small change
dZ of the equation at fixed s gives (Nelson 1976, for the quadratic eigenproblem)

    [ Z   Z' phi ] [ dphi ]   [ -dZ phi ]
    [ c'    0    ] [  ds  ] = [    0    ]

so that ds = -psi' dZ phi / (psi' Z' phi) with the left vector psi. A cost with
dJ = Re sum (conj(h) ds + conj(W) dy), y = L T phi, needs the transposed equation once a mode,

    [ Z'      c ] [ a  ]   [ T' L' conj(W) ]
    [ (Z' phi)' 0 ] [ mu ] = [    conj(h)    ],      dJ = -Re sum a' dZ phi + the change of L T,

which is the derivative of an FRF whose lines are the poles and whose motion is phi: what
``derivatives`` sums over lines serves all Parts here too. No left vector is ever formed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, Dof, Integers, Mask, Motor, Real, UsageError
from mbmodel.frf.adjoint import gradient
from mbmodel.frf.ports import Places, changed, places
from mbmodel.frf.request import Question
from mbmodel.frf.solution import Solved
from mbmodel.frf.solver import Solver
from mbmodel.model import Assembly, Matrices, Model
from mbmodel.modes.model_modes import Modes, modes_of_matrices

_COINCIDE = 1e-7  # relative distance of two poles below which their shapes have no derivative
_CUT = 1e-5  # singular values of the bordered equation left out there


@dataclass(frozen=True, eq=False)
class LinearisedModes:
    """Modes of a model at theta, and their derivatives.

    Args:
        model: what was linearised.
        theta: where; (n_parameter,).
        outputs: where shapes are read; n_out.
        assembly: the equation at theta.
        places: L at theta.
        found: poles and shapes in joint coordinates.
    """

    model: Model
    theta: Real
    outputs: tuple[Dof, ...]
    assembly: Assembly
    places: Places
    found: Modes

    @cached_property
    def shapes(self) -> Complex:
        """Motion of the outputs in each mode, L T phi; (n_out, n_mode)."""
        shapes: Complex = self.places.readout @ self.assembly.jacobian @ self.found.shapes
        return shapes

    def gradient(self, chosen: Integers, by_poles: Complex, by_shapes: Complex) -> Real:
        """Derivative of a scalar cost of some modes by every parameter.

        The cost must not depend on the size and phase of the shapes: they are held by a
        normalisation of their own. Of poles that coincide, the part of a shape's derivative that
        turns it within their common space is left out: it does not exist.

        Args:
            chosen: numbers of the modes, none at rest; (n_chosen,).
            by_poles: h with dJ = Re sum conj(h) ds; (n_chosen,).
            by_shapes: W with dJ = Re sum conj(W) dy; (n_out, n_chosen).

        Returns:
            dJ / dtheta in SI; (n_parameter,).

        Raises:
            UsageError: a mode at rest, whose pole has no derivative.
        """
        poles = self.found.poles[chosen]
        if not poles.all():
            raise UsageError("a motion at rest has no pole to differentiate: leave it out")
        solver = _Bordered(self.assembly.matrices, self.found, chosen, by_poles.conj())
        count = len(self.outputs)
        lines = Solved(
            self.model,
            self.theta,
            _AtPoles(np.abs(poles), self.outputs, (Motor("mode"),), "receptance", laplace_at=poles),
            None,
            self.assembly,
            self.places,
            solver,
            np.ascontiguousarray(self.found.shapes[:, None, chosen]),
        )
        cotangent = by_shapes.T.reshape(len(chosen), count, 1)
        return gradient(lines, self.model.slopes(self.theta), cotangent)


class ModeEvaluator:
    """Linearises modes at many theta: labels are looked up once.

    Args:
        model: machine and Parts.
        outputs: where shapes are read.

    Raises:
        UsageError: a label that the machine does not have.
    """

    def __init__(self, model: Model, outputs: Sequence[Dof]) -> None:
        self.model, self.outputs = model, tuple(outputs)
        plain = places(model.machine, self.outputs, ())
        size, nv = len(model.machine.body_mass), len(model.machine.coordinates)
        nothing = np.zeros((size, 1))
        self._places = Places(plain.readout, nothing, np.zeros((nv, 1)), nothing)

    def at(self, theta: Real) -> LinearisedModes:
        """Modes at theta, with derivatives."""
        assembly = self.model.assemble(theta)
        sensors = [change for change in assembly.point_changes if change.slot == "sensor"]
        here = changed(self._places, sensors, self.outputs, ())
        return LinearisedModes(
            self.model, theta, self.outputs, assembly, here, modes_of_matrices(assembly.matrices)
        )


@dataclass(frozen=True, eq=False)
class _AtPoles(Question):
    """Lines that are poles instead of frequencies; nothing drives them."""

    laplace_at: Complex | None = None

    @cached_property
    def laplace(self) -> Complex:
        """The poles."""
        return np.asarray(self.laplace_at, np.complex128)


class _Bordered(Solver):
    """Answers with the adjoint vectors a of the bordered equation, one a mode."""

    def __init__(
        self, matrices: Matrices, found: Modes, chosen: Integers, right_of_poles: Complex
    ) -> None:
        super().__init__(matrices, found.poles[chosen], None)
        self._shapes, self._right = found.shapes[:, chosen], right_of_poles
        self._close = _coinciding(found.poles, chosen)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """The vectors a for T' L' conj(W) = ``through`` times ``force``; (nv, 1, n_chosen).

        Rows and columns are scaled by the masses and by s, so that metres stand beside radians.
        """
        if not transposed or factor is not None or through is None:
            raise UsageError("poles answer adjoint equations alone: ask an Evaluator for FRFs")
        size = 1.0 / np.sqrt(np.diag(self.matrices.mass))
        poles, count = np.abs(self.laplace), len(size)
        s = self.laplace[:, None, None]
        mass, damping = self.matrices.mass, self.matrices.damping
        dynamic = s**2 * mass + s * damping + self.matrices.stiffness
        border = np.einsum("kij,jk->ki", 2 * s * mass + damping, self._shapes) * size
        own = (self._shapes / size[:, None]).T
        matrix = np.zeros((len(poles), count + 1, count + 1), complex)
        scaled = dynamic.transpose(0, 2, 1) * np.outer(size, size)
        matrix[:, :count, :count] = scaled / poles[:, None, None] ** 2
        matrix[:, :count, count] = own.conj() / (np.abs(own) ** 2).sum(axis=1, keepdims=True)
        matrix[:, count, :count] = border / poles[:, None]
        right = np.empty((len(poles), count + 1), complex)
        right[:, :count] = (through @ force[:, 0]).T * size
        right[:, count] = self._right * poles
        solved = _solve(matrix, right, self._close)[:, :count] * size / poles[:, None] ** 2
        return np.ascontiguousarray(solved.T[:, None, :])


def _coinciding(poles: Complex, chosen: Integers) -> Mask:
    """Which of the chosen have another pole where they are; (n_chosen,)."""
    away = np.abs(poles[chosen, None] - poles)
    away[np.arange(len(chosen)), chosen] = np.inf
    close: Mask = away.min(axis=1, initial=np.inf) <= _COINCIDE * np.abs(poles[chosen])
    return close


def _solve(matrix: Complex, right: Complex, close: Mask) -> Complex:
    """One equation a mode; where poles coincide, without the direction that has no answer."""
    found = np.empty_like(right)
    apart = ~close
    found[apart] = np.linalg.solve(matrix[apart], right[apart, :, None])[..., 0]
    for k in np.flatnonzero(close):
        found[k] = np.linalg.lstsq(matrix[k], right[k], rcond=_CUT)[0]
    return found
