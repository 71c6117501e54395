"""Export of the linear model as a named state space of python-control."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identification.words import DERIVATIVE_ORDER, Integers, Real, UsageError
from mbmodel.assembly import Assembly, FrequencyDependentTerm
from mbmodel.export.branch_states import ApproximatedLaw, BranchStates, branch_states
from mbmodel.export.discrete import SystemMatrices
from mbmodel.export.positive_frequencies import keep_positive_frequencies
from mbmodel.model import Model
from mbmodel.ports.ports import Ports, apply_point_changes, find_ports
from mbmodel.ports.request import FrfRequest

if TYPE_CHECKING:
    import control


_MIN_FITTED_LINES = 8  # of a band in which laws are approximated
_COMPARED_LINES = 200  # on which the error of a constant loss is stated, about


@dataclass(frozen=True, eq=False)
class StateSpaceExport:
    """A state space with what it approximates.

    Args:
        system: named system of python-control.
        laws: laws that are no polynomials in s, with the errors of their approximations; empty if
            the state space is exact.
    """

    system: control.StateSpace
    laws: tuple[ApproximatedLaw, ...]


def state_space(model: Model, theta: Real, request: FrfRequest) -> control.StateSpace:
    """Return the state space with states, inputs and outputs by name; see ``export_state_space``.

    Args:
        theta: parameters in SI; (n_parameter,).
        request: outputs, inputs and quantity; its lines matter for laws that are approximated.
    """
    return export_state_space(model, theta, request).system


def export_state_space(model: Model, theta: Real, request: FrfRequest) -> StateSpaceExport:
    """Return the state space with states, inputs and outputs by name.

    x = [q; q'; xi], x' = [[0, 1, 0], [-M^-1 K, -M^-1 C, -M^-1 B], [xi']] x + [0; M^-1 F; ..] u, q
    the joint coordinates (relative to the floor), xi the states of laws that are no polynomials in
    s, such as delays (``branch_states``). Constant losses are in A: ``positive_frequencies``. The
    outputs are L (T q + z), L (T q' + z') or
    L (T q'' + U u), with z the motion of the bodies with the floor, z'' = U u. Accelerance has a
    direct feed-through; for the other quantities each direction of a moving floor adds two
    integrators.

    Args:
        theta: parameters in SI; (n_parameter,).
        request: outputs, inputs and quantity. Its lines above 0 Hz are the band in which laws are
            approximated; without such laws they do not matter.

    Returns:
        The system with the states ``<coordinate>`` and ``<coordinate>'``, those of laws, those of
        the floor, ``floor_tx`` and ``floor_tx'``, and the activations ``<actuator>_act``.

    Raises:
        UsageError: a Part changes gain or delay of channels; no band for laws.
    """
    # Imported here: with its matplotlib it would add 0.7 s to every start of the program.
    import control  # noqa: PLC0415

    assembly = model.assemble(theta)
    if assembly.input_changes or assembly.output_changes:
        raise UsageError(
            "the model holds gains or delays of channels, which are no part of the machine's state "
            "space: remove these Parts, or use FRFs"
        )
    if assembly.frequency_dependent and (request.freq_hz > 0).sum() < _MIN_FITTED_LINES:
        raise UsageError(
            f"losses and delays are approximated in a band: request {_MIN_FITTED_LINES} or more "
            "frequency lines above 0 Hz"
        )
    branches = branch_states(assembly.matrices, assembly.frequency_dependent, request.freq_hz)
    ports = find_ports(model.machine, request.outputs, request.inputs)
    refuse_floor_in_loops(assembly, ports)
    ports = apply_point_changes(ports, assembly.point_changes, request.outputs, request.inputs)
    drive = assembly.jacobian.T @ (ports.force - assembly.body[2] @ ports.floor) + ports.motor
    names = model.machine.coordinates
    form = first_order_form(branches, drive)
    readout = ports.readout @ assembly.jacobian + ports.joint_readout
    quantity = DERIVATIVE_ORDER[request.quantity]
    orders = np.array([quantity if order is None else order for order in ports.orders], int)
    states = [*names, *(f"{name}'" for name in names), *branches.names]
    moving = np.flatnonzero(ports.floor.any(axis=0) & bool((orders < 2).any()))
    states += [f"{request.inputs[k]}{rate}" for rate in ("", "'") for k in moving]
    dynamics, gain = _append_integrators(form.dynamics, form.gain, moving)
    reading, feedthrough = _readings(ports, readout, orders, dynamics, gain, moving)
    whole = SystemMatrices(dynamics, gain, reading, feedthrough).behind(ports.activations)
    lagged = zip(request.inputs, ports.activations, strict=True)
    states += [f"{port}.act" for port, activation in lagged if activation is not None]
    system = control.ss(
        whole.a,
        whole.b,
        whole.c,
        whole.d,
        states=_signal_names(states),
        inputs=_signal_names(map(str, request.inputs)),
        outputs=_signal_names(map(str, request.outputs)),
        name=_signal_names([model.machine.name])[0],
    )
    laws = tuple(
        _with_error_of_loss(law, term, branches, request.freq_hz)
        for law, term in zip(branches.laws, assembly.frequency_dependent, strict=True)
    )
    return StateSpaceExport(system, laws)


def refuse_floor_in_loops(assembly: Assembly, ports: Ports) -> None:
    """Refuse motions of the floor as inputs where a closed loop reads them.

    Raises:
        UsageError: such an input.
    """
    for term in assembly.frequency_dependent:
        if term.is_loop and (term.body_right.T @ ports.floor).any():
            raise UsageError(
                f"{term.owner} reads the motion of the floor, which its state space does not hold: "
                "open the loop for the state space, or request FRFs"
            )


@dataclass(frozen=True, eq=False)
class FirstOrderForm:
    """The equation of motion in first order, x = [q; q'; xi].

    Args:
        size: number of joint coordinates q.
        dynamics: A; (n, n).
        gain: B, per unit of each force; (n, n_force).
    """

    size: int
    dynamics: Real
    gain: Real

    def read(self, order: int, rows: Real) -> tuple[Real, Real]:
        """Return C and D of a reading of q, q' or q''; (n_out, n) and (n_out, n_force).

        Args:
            order: 0, 1 or 2.
            rows: reading per unit of each coordinate's derivative; (n_out, nv).
        """
        if order == 2:
            span = slice(self.size, 2 * self.size)
            return rows @ self.dynamics[span], rows @ self.gain[span]
        reading = np.zeros((len(rows), len(self.dynamics)))
        reading[:, order * self.size : (order + 1) * self.size] = rows
        return reading, np.zeros((len(rows), self.gain.shape[1]))


def first_order_form(branches: BranchStates, drive: Real) -> FirstOrderForm:
    """Return A and B of the equation of motion with the states of its laws.

    Args:
        branches: matrices, and states xi of laws.
        drive: generalised forces per unit of each input; (nv, n_force).
    """
    dynamics, gain = _extended_form(branches, drive)
    if branches.loss.any():
        dynamics, gain = keep_positive_frequencies(dynamics, gain)
    return FirstOrderForm(len(drive), dynamics, gain)


def _extended_form(branches: BranchStates, drive: Real) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B, complex with losses that are constant at positive frequencies."""
    matrices, size = branches.matrices, len(drive)
    stiffness = (
        matrices.stiffness + 1j * branches.loss if branches.loss.any() else matrices.stiffness
    )
    rows = [stiffness, matrices.damping, branches.force, -drive]
    accelerations = -np.linalg.solve(matrices.mass, np.hstack(rows))
    further = len(branches.dynamics)
    count = 2 * size + further
    kind = accelerations.dtype
    dynamics, gain = np.zeros((count, count), kind), np.zeros((count, drive.shape[1]), kind)
    dynamics[:size, size : 2 * size] = np.eye(size)
    dynamics[size : 2 * size] = accelerations[:, :count]
    gain[size : 2 * size] = accelerations[:, count:]
    if further:
        position, rate, acceleration = branches.gains
        dynamics[2 * size :] = np.hstack([position, rate, branches.dynamics])
        dynamics[2 * size :] += acceleration @ dynamics[size : 2 * size]
        gain[2 * size :] = acceleration @ gain[size : 2 * size]
    return dynamics, gain


def _with_error_of_loss(
    law: ApproximatedLaw, term: FrequencyDependentTerm, branches: BranchStates, freq_hz: Real
) -> ApproximatedLaw:
    """Return a law, one with a constant loss with the error of the accelerance along it."""
    fit, lines = law.approximation, freq_hz[freq_hz > 0]
    if not fit.loss:
        return law
    laplace = np.asarray(2j * np.pi * lines[:: max(1, len(lines) // _COMPARED_LINES)], complex)
    forms = (
        first_order_form(branches, term.left),
        FirstOrderForm(len(term.left), *_extended_form(branches, term.left)),
    )
    held, exact = (
        SystemMatrices(form.dynamics, form.gain, *form.read(2, term.right.T)).at(laplace)
        for form in forms
    )
    error = np.abs(held - exact) / np.abs(exact).max()
    rms = float(np.sqrt((error**2).mean()))
    return replace(law, approximation=replace(fit, max_error=float(error.max()), rms_error=rms))


def _readings(
    ports: Ports, readout: Real, orders: Integers, dynamics: Real, gain: Real, moving: Integers
) -> tuple[Real, Real]:
    """Return the readings per state, (n_out, n_state), and per input, (n_out, n_in).

    Args:
        ports: rows of the outputs.
        readout: L T + J; (n_out, nv).
        orders: derivative that each output reads; (n_out,).
        dynamics: A, with the states of the floor at the end; (n_state, n_state).
        gain: B; (n_state, n_in).
        moving: numbers of the inputs that move the floor and have states.
    """
    size, count = readout.shape[1], len(dynamics)
    derivatives = np.zeros((3, size, count))  # of the joint coordinates, per state
    derivatives[0, :, :size] = derivatives[1, :, size : 2 * size] = np.eye(size)
    derivatives[2] = dynamics[size : 2 * size]
    floor = ports.readout @ ports.floor
    floor_states = np.zeros((3, len(readout), count))
    first = count - 2 * len(moving)
    floor_states[0, :, first : first + len(moving)] = floor[:, moving]
    floor_states[1, :, first + len(moving) :] = floor[:, moving]
    reading = np.zeros((len(readout), count))
    feedthrough = np.zeros((len(readout), gain.shape[1]))
    for row, order in enumerate(orders):
        reading[row] = readout[row] @ derivatives[order] + floor_states[order, row]
        if order == 2:
            feedthrough[row] = readout[row] @ gain[size : 2 * size] + floor[row]
    if ports.further is not None:
        reading += np.einsum("kom,kms->os", ports.further.motion, derivatives)
        feedthrough += ports.further.direct + ports.further.motion[2] @ gain[size : 2 * size]
    return reading, feedthrough


def _append_integrators(dynamics: Real, gain: Real, moving: np.ndarray) -> tuple[Real, Real]:
    """Append states z and z' of the floor's directions, with z'' as their inputs."""
    size, count = len(dynamics), len(moving)
    extended = np.zeros((size + 2 * count, size + 2 * count))
    extended[:size, :size] = dynamics
    extended[size : size + count, size + count :] = np.eye(count)
    extended_gain = np.vstack([gain, np.zeros((2 * count, gain.shape[1]))])
    extended_gain[size + count + np.arange(count), moving] = 1.0
    return extended, extended_gain


def _signal_names(names: Iterable[str]) -> list[str]:
    """Return unique names without the full stop, which python-control reserves."""
    unique_names: list[str] = []
    for name in names:
        plain = name.replace(".", "_")
        unique, count = plain, 1
        while unique in unique_names:
            count += 1
            unique = f"{plain}_{count}"
        unique_names.append(unique)
    return unique_names
