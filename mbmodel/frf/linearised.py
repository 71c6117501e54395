r"""Linear response of a model, with exact derivatives.

    H(s) = s^q [G Z(s)^-1 F + L U / s^2],   Z(s) = s^2 M + s C + K,   G = L T
    F = T' (P - Mb U) + motors

with s = i w, time convention exp(+i w t); q = 0, 1, 2 for receptance, mobility, accelerance; L the
rows of the outputs, P the forces of the inputs at the bodies, T the bodies' Jacobian. An input
that is an acceleration of the floor carries the bodies along by U / s^2, and the joints, which
move relative to the floor, feel the bodies' inertia. Data that still carry an exponential window
exp(-t / tau) are the transform at s = i w + 1 / tau, and so is their model.
"""

import numpy as np

from identification.words import Complex, Condition, Frf, Mask, Real, UsageError
from mbmodel.frf.adjoint import gradient
from mbmodel.frf.forward_sensitivities import Forward
from mbmodel.frf.modal_form import ModalForm, modal_form
from mbmodel.frf.ports import Places, changed, places
from mbmodel.frf.request import Question
from mbmodel.frf.solution import Solved
from mbmodel.frf.solver import Solver
from mbmodel.frf.woodbury import ShapedSolver
from mbmodel.model import Assembly, Model

_AGREEMENT = 1e-10
_CONDITION = 1e6  # of an eigenvalue: beyond it poles all but coincide


class Linearised(Solved):
    """A model linearised at theta, answering one question; see ``Solved`` for its fields."""

    def frf(self) -> Frf:
        """H with its labels."""
        asked = self.question
        return Frf(asked.freq_hz, self.values, asked.outputs, asked.inputs, asked.quantity)

    def gradient(self, cotangent: Complex, chosen: Mask | None = None) -> Real:
        """Derivative of a scalar cost by every parameter, by the adjoint method.

        Args:
            cotangent: W with dJ = Re sum conj(W) dH; (n_freq, n_out, n_in).
            chosen: parameters asked for; all if None; (n_parameter,).

        Returns:
            dJ / dtheta in SI, zero for Parts without a chosen parameter; (n_parameter,).
        """
        slopes = self.model.slopes(self.theta, self.condition, chosen)
        return gradient(self, slopes, cotangent)

    def columns(self) -> Complex:
        """Derivative of every FRF by every parameter; (n_freq, n_out, n_in, n_parameter)."""
        return self.forward().columns()

    def forward(self, chosen: Mask | None = None, rates: Real | None = None) -> Forward:
        """Derivatives by some parameters, for any run of lines.

        Args:
            chosen: which; all if None; (n_parameter,).
            rates: by which each derivative is multiplied; one if None; (n_parameter,).
        """
        chosen = np.ones(len(self.theta), bool) if chosen is None else chosen
        slopes = self.model.slopes(self.theta, self.condition, chosen)
        return Forward(self, slopes, chosen, rates)


class Evaluator:
    """Answers one question for many theta: labels and geometry are looked up once.

    Args:
        model: machine and Parts.
        question: lines, outputs, inputs, quantity.
        condition: of the test meant, if any.
        direct: always solve line by line instead of by the modal form.
        agreement: of the modal form with the direct solve, relative to each coordinate's peak.

    Raises:
        UsageError: a label that the machine does not have, a motion of the floor at 0 Hz.
    """

    def __init__(
        self,
        model: Model,
        question: Question,
        *,
        condition: Condition | None = None,
        direct: bool = False,
        agreement: float = _AGREEMENT,
    ) -> None:
        self.model, self.question, self.condition = model, question, condition
        self.places = places(model.machine, question.outputs, question.inputs)
        self.is_direct, self._agreement = direct, agreement
        if self.places.has_floor and question.order < 2 and not question.laplace.all():
            raise UsageError(
                f"{question.quantity} per acceleration of the floor has no value at 0 Hz: start "
                "the band above it, or ask for the accelerance"
            )

    def at(self, theta: Real) -> Linearised:
        """Linearise at theta.

        The modal form is checked against the direct solve where the poles come nearest to a line
        and at both ends; if they differ in any coordinate, if an eigenvalue is ill-conditioned
        (poles that all but coincide), or if there is no modal form, the direct solve answers.

        Raises:
            UsageError: a line at which the machine has no finite response.
        """
        question = self.question
        assembly = self.model.assemble(theta, self.condition)
        here = changed(self.places, assembly.point_changes, question.outputs, question.inputs)
        drive = self._drive(assembly, here)
        form = None if self.is_direct else modal_form(assembly.matrices)
        solver = Solver(assembly.matrices, question.laplace, form)
        motion = solver.solve(drive, factor=question.factor)
        if form is not None and not self._agrees(solver, form, drive, motion):
            solver = Solver(assembly.matrices, question.laplace, None)
            motion = solver.solve(drive, factor=question.factor)
        if assembly.shaped:
            shaped = ShapedSolver(solver, assembly.shaped)
            motion = shaped.solve(drive, factor=question.factor)
            return Linearised(
                self.model, theta, question, self.condition, assembly, here, shaped, motion
            )
        return Linearised(
            self.model, theta, question, self.condition, assembly, here, solver, motion
        )

    @staticmethod
    def _drive(assembly: Assembly, here: Places) -> Real:
        """F; (nv, n_in, 1)."""
        force = here.force
        if here.has_floor:
            force = force - assembly.body[2] @ here.floor
        drive: Real = assembly.jacobian.T @ force + here.motor
        return drive[:, :, None]

    def _agrees(self, solver: Solver, form: ModalForm, drive: Real, motion: Complex) -> bool:
        if form.condition > _CONDITION:
            return False
        lines = self._critical_lines(form)
        factor = self.question.factor[lines]
        error = np.abs(motion[..., lines] - solver.direct(drive, lines) * factor)
        peak = np.abs(motion.view(np.float64)).max(axis=(1, 2), keepdims=True)
        return bool((error <= self._agreement * peak).all())

    def _critical_lines(self, form: ModalForm) -> np.ndarray:
        omega = self.question.laplace.imag
        decay = np.where(form.poles.imag > 0, np.abs(form.poles.real), np.inf)
        sharpest = form.poles.imag[np.argmin(decay)]
        return np.unique([0, int(np.argmin(np.abs(omega - sharpest))), len(omega) - 1])


def linearise(model: Model, theta: Real, question: Question) -> Linearised:
    """Linearise a model at theta for one question; see ``Evaluator`` for many theta."""
    return Evaluator(model, question).at(theta)
