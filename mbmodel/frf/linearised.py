"""Linear response of a model, with exact derivatives.

    H(s) = s^q [G Z(s)^-1 F + L U / s^2],   Z(s) = s^2 M + s C + K,   G = L T
    F = T' (P - Mb U) + motors

times a factor c(s) of the inputs, the gain and delay of the force channel, one of each output,
the delay of its channel, and one of each actuator with a state (``linearisation.motors``),

with s = i w, time convention exp(+i w t); q = 0, 1, 2 for receptance, mobility, accelerance; L the
rows of the outputs, P the forces of the inputs at the bodies, T the bodies' Jacobian. An
acceleration of the floor as input moves the bodies along by U / s^2. The joints, which move
relative to the floor, then feel the bodies' inertia. Data that still carry an exponential window
exp(-t / tau) are the transform at s = i w + 1 / tau, and so is their model.
"""

from dataclasses import replace

import numpy as np

from identification.words import Complex, Condition, Frf, Integers, Mask, Real, UsageError
from mbmodel.frf.adjoint import gradient
from mbmodel.frf.forward_sensitivities import ForwardSensitivities
from mbmodel.frf.modal_form import ModalForm, modal_form
from mbmodel.frf.solution import (
    FrfSolution,
    floor_forces_of_loops,
    generalised_force,
    input_drive_factor,
)
from mbmodel.frf.solver import Solver, WoodburySolver
from mbmodel.machine import Machine
from mbmodel.model import Model
from mbmodel.ports.ports import Ports, apply_point_changes, find_ports, with_orders
from mbmodel.ports.request import FrfRequest

# Difference of the modal form from elimination, relative to each coordinate's peak.
_MAX_MODAL_ERROR = 1e-10
_MAX_EIGENVALUE_CONDITION = 1e6  # beyond it poles nearly coincide, and the form loses digits


class Linearised(FrfSolution):
    """A model linearised at theta for one request; see ``FrfSolution`` for its fields."""

    def frf(self) -> Frf:
        """Return the FRFs H with their labels."""
        request = self.request
        return Frf(request.freq_hz, self.values, request.outputs, request.inputs, request.quantity)

    def gradient(self, cotangent: Complex, chosen: Mask | None = None) -> Real:
        """Return the derivative of a scalar cost by every parameter, by the adjoint method.

        Args:
            cotangent: W with dJ = Re sum conj(W) dH; (n_freq, n_out, n_in).
            chosen: parameters of interest; all if None; (n_parameter,).

        Returns:
            dJ / dtheta in SI, zero for Parts without a chosen parameter; (n_parameter,).
        """
        self._refuse_further_terms()
        slopes = self.model.slopes(self.theta, self.condition, chosen)
        return gradient(self, slopes, cotangent)

    def columns(self) -> Complex:
        """Return the derivative of every FRF by every parameter.

        Returns:
            (n_freq, n_out, n_in, n_parameter).
        """
        return self.sensitivities().columns()

    def sensitivities(
        self,
        chosen: Mask | None = None,
        rates: Real | None = None,
        places: Integers | None = None,
    ) -> ForwardSensitivities:
        """Return forward sensitivities by some parameters, for any run of lines.

        Args:
            chosen: parameters of interest; all if None; (n_parameter,).
            rates: factor of each derivative; one if None; (n_parameter,).
            places: number of each chosen parameter among the results, where those of parameters
                with one number add up; its own if None; (n_chosen,).
        """
        self._refuse_further_terms()
        chosen = np.ones(len(self.theta), bool) if chosen is None else chosen
        slopes = self.model.slopes(self.theta, self.condition, chosen)
        return ForwardSensitivities(self, slopes, chosen, rates, places)

    def _refuse_further_terms(self) -> None:
        """Raise UsageError for readings whose derivatives are not known.

        Raises:
            UsageError: an output reads forces, or the weight that a tilting accelerometer feels.
        """
        if self.ports.further is None:
            return
        motion, direct = self.ports.further.motion, self.ports.further.direct
        rows = np.flatnonzero(motion.any(axis=(0, 2)) | direct.any(axis=1)).tolist()
        names = ", ".join(repr(str(self.request.outputs[row])) for row in rows)
        raise UsageError(
            f"{names} reads forces or the weight in a tilting sensor, which only mbw predict "
            "handles: name the site or joint as the channel instead"
        )


class Evaluator:
    """Linearises a model at many theta for one request: labels and geometry are looked up once.

    Args:
        condition: of the test, whose variant of the machine is meant; or None.
        direct: always eliminate line by line instead of using the modal form.
        agreement: allowed error of the modal form, relative to each coordinate's peak.

    Raises:
        UsageError: a label that the machine does not have, a motion of the floor at 0 Hz.
    """

    def __init__(
        self,
        model: Model,
        request: FrfRequest,
        *,
        condition: Condition | None = None,
        direct: bool = False,
        agreement: float = _MAX_MODAL_ERROR,
    ) -> None:
        self.model, self.condition = model.for_test(condition), condition
        self.ports = find_ports(self.model.machine, request.outputs, request.inputs)
        self.request = request = with_orders(request, self.ports)
        self.is_direct, self._agreement = direct, agreement
        if self.ports.has_floor and request.order < 2 and not request.laplace.all():
            raise UsageError(
                "a position or velocity per acceleration of the floor has no value at 0 Hz: start "
                "the band above it, or request the accelerance"
            )

    def at(self, theta: Real) -> Linearised:
        """Linearise at theta.

        The modal form is checked against elimination at the line nearest to the least damped pole
        and at both ends of the band. Elimination is used if they differ in any coordinate, if an
        eigenvalue is ill-conditioned (poles that nearly coincide), or if there is no modal form.

        Args:
            theta: parameters in SI; (n_parameter,).

        Raises:
            UsageError: a line at which the machine has no finite response.
        """
        request = self.request
        assembly = self.model.assemble(theta, self.condition)
        ports = apply_point_changes(
            self._ports_at(assembly.machine),
            assembly.point_changes,
            request.outputs,
            request.inputs,
        )
        drive = generalised_force(assembly, ports)[:, :, None]
        factor = input_drive_factor(assembly, request)
        form = None if self.is_direct else modal_form(assembly.matrices)
        solver = Solver(assembly.matrices, request.laplace, form)
        motion = solver.solve(drive, factor=factor)
        if form is not None and not self._modal_form_agrees(solver, form, drive, motion, factor):
            solver = Solver(assembly.matrices, request.laplace, None)
            motion = solver.solve(drive, factor=factor)
        whole: Solver | WoodburySolver = solver
        if assembly.frequency_dependent:
            whole = WoodburySolver(solver, assembly.frequency_dependent)
            motion = whole.solve(drive, factor=factor)
            if ports.has_floor:
                forces = floor_forces_of_loops(assembly, ports, request)
                motion = motion + whole.solve(forces)
        if (lags := ports.lags(request.laplace)) is not None:
            motion = motion * lags
        return Linearised(
            self.model, theta, request, self.condition, assembly, ports, whole, motion
        )

    def _ports_at(self, machine: Machine) -> Ports:
        """Return the ports at a pose: of those fixed to bodies, only the floor's motion changes."""
        if machine.pose is None or not self.ports.has_floor:
            return self.ports
        floor = find_ports(machine, (), self.request.inputs).floor
        return replace(self.ports, floor=floor)

    def _modal_form_agrees(
        self, solver: Solver, form: ModalForm, drive: Real, motion: Complex, factor: Complex
    ) -> bool:
        """Return whether the modal form is well conditioned and agrees with elimination."""
        if form.condition > _MAX_EIGENVALUE_CONDITION:
            return False
        lines = self._critical_lines(form)
        direct = solver.solve_directly(drive, lines) * factor[lines]
        error = np.abs(motion[..., lines] - direct)
        parts = motion.view(np.float64).reshape(len(motion), -1)
        peak = np.maximum(parts.max(axis=1), -parts.min(axis=1))[:, None, None]
        return bool((error <= self._agreement * peak).all())

    def _critical_lines(self, form: ModalForm) -> np.ndarray:
        """Return the line nearest to the least damped pole, the first and the last."""
        omega = self.request.laplace.imag
        decay = np.where(form.poles.imag > 0, np.abs(form.poles.real), np.inf)
        sharpest = form.poles.imag[np.argmin(decay)]
        return np.unique([0, int(np.argmin(np.abs(omega - sharpest))), len(omega) - 1])


def linearise(model: Model, theta: Real, request: FrfRequest) -> Linearised:
    """Linearise a model at theta for one request; see ``Evaluator`` for many theta.

    Args:
        theta: parameters in SI; (n_parameter,).
    """
    return Evaluator(model, request).at(theta)
