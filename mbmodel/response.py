r"""Linear response of a model, with exact derivatives.

    H(s) = s^q G Z(s)^-1 F,   Z(s) = s^2 M + s C + K,   G = L T,  F = T' P

with s = i w, time convention exp(+i w t); q = 0, 1, 2 for receptance, mobility, accelerance; L the
rows of the outputs, P the columns of the inputs, T the bodies' Jacobian. Data that still carry an
exponential window exp(-t / tau) are the transform at s = i w + 1 / tau, and so is their model.

A parameter changes H by dH = -s^q (G Z^-1) dZ (Z^-1 F). A scalar cost with cotangent W,
dJ = Re sum conj(W) dH, therefore needs one more solve, y = Z^-T G' conj(W), whatever the
number of parameters: dJ = -Re sum y' dZ x with x = s^q Z^-1 F (the adjoint method).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import ORDER, Complex, Condition, Dof, Frf, Quantity, Real, UsageError
from mbmodel.modal import ModalForm, modal_form, real_times
from mbmodel.model import Matrices, Model

_AGREEMENT = 1e-10  # modal form against direct solve, relative to each coordinate's peak
_CONDITION = 1e6  # of an eigenvalue: beyond it poles all but coincide
_CHUNK = 64 * 2**20  # bytes of dynamic stiffness that are solved at once


@dataclass(frozen=True, eq=False)
class Question:
    """Which FRFs are asked of a model.

    Args:
        freq_hz: [Hz]; (n_freq,).
        outputs, inputs: labels.
        quantity: receptance, mobility or accelerance.
        window_tau: time constant of the exponential window in the data [s]; 0 for none.
    """

    freq_hz: Real
    outputs: tuple[Dof, ...]
    inputs: tuple[Dof, ...]
    quantity: Quantity = "accelerance"
    window_tau: float = 0.0

    @cached_property
    def laplace(self) -> Complex:
        """The s = i w + 1 / tau of every line; (n_freq,)."""
        decay = 1.0 / self.window_tau if self.window_tau else 0.0
        return np.asarray(decay + 2j * np.pi * np.asarray(self.freq_hz), np.complex128)

    @cached_property
    def factor(self) -> Complex:
        """The s^q of every line; (n_freq,)."""
        factor: Complex = self.laplace ** ORDER[self.quantity]
        return factor


@dataclass(frozen=True, eq=False)
class Linearised:
    """A model linearised at theta, answering one question.

    Args:
        model: what was linearised.
        theta: where; (n_parameter,).
        question: lines, outputs, inputs.
        condition: of the test meant, or None.
        readout: G, output per joint coordinate; (n_out, nv).
        solver: of Z x = f.
        motion: x = s^q Z^-1 F; (nv, n_in, n_freq).
    """

    model: Model
    theta: Real
    question: Question
    condition: Condition | None
    readout: Real
    solver: "Solver"
    motion: Complex

    @cached_property
    def values(self) -> Complex:
        """H; (n_freq, n_out, n_in), a view on memory that runs along frequency."""
        return real_times(self.readout, self.motion).transpose(2, 0, 1)

    def frf(self) -> Frf:
        """H with its labels."""
        asked = self.question
        return Frf(asked.freq_hz, self.values, asked.outputs, asked.inputs, asked.quantity)

    def gradient(self, cotangent: Complex) -> Real:
        """Derivative of a scalar cost by every parameter, by the adjoint method.

        Args:
            cotangent: W with dJ = Re sum conj(W) dH; (n_freq, n_out, n_in).

        Returns:
            dJ / dtheta in SI; (n_parameter,).
        """
        force = real_times(self.readout.T, cotangent.conj().transpose(1, 2, 0))
        adjoint = self.solver.solve(force, transposed=True)
        size = len(adjoint)
        motion, adjoint = self.motion.reshape(size, -1), adjoint.reshape(size, -1).conj()
        slopes = self.model.slopes(self.theta, self.condition)
        highest = max((_highest_power(slope.core) for part in slopes for slope in part), default=0)
        laplace = np.tile(self.question.laplace, motion.shape[1] // len(self.question.laplace))
        sums = np.zeros((3, size, size))
        for power in range(highest + 1):
            sums[power] = _real_inner(adjoint, motion)
            motion = motion * laplace if power < highest else motion
        gradient = [np.zeros(len(part.parameters)) for part in self.model.parts]
        for total, part_slopes in zip(gradient, slopes, strict=True):
            for slope in part_slopes:
                left, right = self.model.frames(slope)
                projected = (left.T @ sums @ right).ravel()
                core = slope.core.reshape(len(total), projected.size)
                np.subtract(total, core @ projected, out=total)
        return np.concatenate(gradient)

    def columns(self) -> Complex:
        """Derivative of every FRF by every parameter; (n_freq, n_out, n_in, n_parameter)."""
        readers = self.solver.solve(self.readout.T[:, :, None], transposed=True)
        total = np.zeros((len(self.theta), *self.values.shape), complex)
        start = 0
        for slopes, part in zip(
            self.model.slopes(self.theta, self.condition), self.model.parts, strict=True
        ):
            for slope in slopes:
                left, right = self.model.frames(slope)
                read, felt = real_times(left.T, readers), real_times(right.T, self.motion)
                for p, power, i, j in np.argwhere(slope.core):
                    scale = -slope.core[p, power, i, j] * self.question.laplace**power
                    scaled = read[i] * scale
                    total[start + p] += np.einsum("of,mf->fom", scaled, felt[j])
            start += len(part.parameters)
        return np.moveaxis(total, 0, -1)


def _highest_power(core: Real) -> int:
    powers = np.flatnonzero(core.any(axis=(0, 2, 3)))
    return int(powers[-1]) if powers.size else 0


def _real_inner(left: Complex, right: Complex) -> Real:
    """Re sum_k conj(left_ik) right_jk as one real product; (i, j)."""
    product: Real = left.view(np.float64) @ right.view(np.float64).T
    return product


class Solver:
    """Solves Z(s) x = f at given lines, by the modal form if there is one.

    Args:
        matrices: M, C, K.
        laplace: s of every line; (n_freq,).
        form: their modal form; None for the direct solve.

    Raises:
        UsageError: on solving, where a line has no finite motion.
    """

    def __init__(self, matrices: Matrices, laplace: Complex, form: ModalForm | None) -> None:
        self.matrices, self.laplace, self.form = matrices, laplace, form
        self._resting = np.flatnonzero(laplace == 0)

    @cached_property
    def _kernels(self) -> tuple[Complex, Complex] | None:
        return None if self.form is None else self.form.kernels(self.laplace)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
    ) -> Complex:
        """Z^-1 f, or Z^-T f, times a factor of each line.

        Args:
            force: (nv, m, 1) the same at all lines, or (nv, m, n_freq).
            transposed: solve with the transpose.
            factor: such as s^q; (n_freq,).

        Returns:
            x; (nv, m, n_freq).
        """
        scale = np.ones(1) if factor is None else factor
        if self.form is None or self._kernels is None:
            lines = np.arange(len(self.laplace))
            return self.direct(force, lines, transposed=transposed) * scale
        form = self.form.transposed if transposed else self.form
        even, odd = self._kernels
        motion = form.receptance(force, (even * scale, odd * scale))
        if form.in_velocity and self._resting.size:
            resting = self.direct(force, self._resting, transposed=transposed)
            motion[..., self._resting] = (
                resting * np.broadcast_to(scale, self.laplace.shape)[self._resting]
            )
        return motion

    def direct(
        self, force: Real | Complex, lines: np.ndarray, *, transposed: bool = False
    ) -> Complex:
        """The same for some lines by Gaussian elimination, line by line; (nv, m, n_lines)."""
        matrices = self.matrices
        mass, damping, stiffness = (
            matrix.T if transposed else matrix
            for matrix in (matrices.mass, matrices.damping, matrices.stiffness)
        )
        size, m = force.shape[:2]
        forces = np.broadcast_to(force, (size, m, len(self.laplace)))
        motion = np.empty((size, m, len(lines)), complex)
        step = max(1, _CHUNK // (16 * size * size))
        for start in range(0, len(lines), step):
            chosen = lines[start : start + step]
            s = self.laplace[chosen][:, None, None]
            try:
                solved = np.linalg.solve(
                    s**2 * mass + s * damping + stiffness, forces[..., chosen].transpose(2, 0, 1)
                )
            except np.linalg.LinAlgError as error:
                raise UsageError(
                    "the machine has no finite response at some line, as a free machine at 0 Hz: "
                    "start the band above it"
                ) from error
            motion[..., start : start + step] = solved.transpose(1, 2, 0)
        return motion


class Evaluator:
    """Answers one question for many theta: labels and geometry are looked up once.

    Args:
        model: machine and Parts.
        question: lines, outputs, inputs, quantity.
        condition: of the test meant, if any.
        direct: always solve line by line instead of by the modal form.

    Raises:
        UsageError: a label that the machine does not have.
    """

    def __init__(
        self,
        model: Model,
        question: Question,
        *,
        condition: Condition | None = None,
        direct: bool = False,
    ) -> None:
        layout, jacobian = model.machine.layout, model.machine.jacobian
        self.model, self.question, self.condition = model, question, condition
        self.readout = layout.rows(question.outputs) @ jacobian
        self.drive = (layout.rows(question.inputs) @ jacobian).T[:, :, None]
        self.is_direct = direct

    def at(self, theta: Real) -> Linearised:
        """Linearise at theta.

        The modal form is checked against the direct solve where the poles come nearest to a line
        and at both ends; if they differ in any coordinate, if an eigenvalue is ill-conditioned
        (poles that all but coincide), or if there is no modal form, the direct solve answers.

        Raises:
            UsageError: a line at which the machine has no finite response.
        """
        matrices = self.model.matrices(theta, self.condition)
        laplace = self.question.laplace
        form = None if self.is_direct else modal_form(matrices)
        solver = Solver(matrices, laplace, form)
        factor = self.question.factor
        motion = solver.solve(self.drive, factor=factor)
        if form is not None:
            lines = self._critical_lines(form)
            error = np.abs(motion[..., lines] - solver.direct(self.drive, lines) * factor[lines])
            peak = np.abs(motion.view(np.float64)).max(axis=(1, 2), keepdims=True)
            if form.condition > _CONDITION or not (error <= _AGREEMENT * peak).all():
                solver = Solver(matrices, laplace, None)
                motion = solver.solve(self.drive, factor=factor)
        return Linearised(
            self.model, theta, self.question, self.condition, self.readout, solver, motion
        )

    def _critical_lines(self, form: ModalForm) -> np.ndarray:
        omega = self.question.laplace.imag
        decay = np.where(form.poles.imag > 0, np.abs(form.poles.real), np.inf)
        sharpest = form.poles.imag[np.argmin(decay)]
        return np.unique([0, int(np.argmin(np.abs(omega - sharpest))), len(omega) - 1])


def linearise(model: Model, theta: Real, question: Question) -> Linearised:
    """Linearise a model at theta for one question; see ``Evaluator`` for many theta."""
    return Evaluator(model, question).at(theta)
