"""Solution of the equation of motion at one theta for one request.

Factors of FRFs that depend on frequency: of the readings of a channel, and of all inputs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.words import Complex, Condition, Output, Real
from mbmodel.assembly import Assembly, frequency_dependent_core
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.solver import Solver, WoodburySolver
from mbmodel.model import Model
from mbmodel.parts import Change
from mbmodel.ports.ports import FurtherTerms, Ports, group_by_point
from mbmodel.ports.request import FrfRequest


@dataclass(frozen=True, eq=False)
class FrfSolution:
    """The equation of motion solved at theta for one request.

    Args:
        theta: parameters in SI; (n_parameter,).
        condition: of the test, or None.
        ports: L, P, U at theta.
        solver: of Z x = f.
        motion: x = s^q c Z^-1 F of the joint coordinates, with c the factor of the inputs, and
            the lag of each actuator with a state; (nv, n_in, n_freq).
    """

    model: Model
    theta: Real
    request: FrfRequest
    condition: Condition | None
    assembly: Assembly
    ports: Ports
    solver: Solver | WoodburySolver
    motion: Complex

    @cached_property
    def readout(self) -> Real:
        """G = L T + J; (n_out, nv)."""
        return self.ports.readout @ self.assembly.jacobian + self.ports.joint_readout

    @cached_property
    def values(self) -> Complex:
        """FRFs H, a view on memory that runs along frequency; (n_freq, n_out, n_in)."""
        factor = self.output_factor
        if factor is None and self.ports.further is None:
            return self.ideal_values
        values = self.ideal_values.transpose(1, 2, 0)
        if factor is not None:
            values = values * factor[:, None]
        if self.ports.further is not None:
            further = self._further_values(self.ports.further)
            channel = self._channel_factor
            values = values + (further if channel is None else further * channel[:, None])
        return values.transpose(2, 0, 1)

    @cached_property
    def output_factor(self) -> Complex | None:
        """Factor of each channel's readings, None if all are one; (n_out, n_freq).

        It is the product of the channel's factor and of s for each derivative that the output reads
        beyond those of the motion.
        """
        powers, channel = self.request.output_powers, self._channel_factor
        if powers is None or channel is None:
            return channel if powers is None else powers
        return powers * channel

    @cached_property
    def _channel_factor(self) -> Complex | None:
        """Gain and delay of each channel, None if all are one; (n_out, n_freq)."""
        request = self.request
        return output_factor(self.assembly.output_changes, request.outputs, request.laplace)

    def _further_values(self, further: FurtherTerms) -> Complex:
        """Return (C_0 + s C_1 + s^2 C_2) x s^-q + D c; (n_out, n_in, n_freq).

        The motion's order q is 0 here, since readings with further terms are of that order.
        """
        values: Complex = further.direct[:, :, None] * self.drive_factor
        for power in np.flatnonzero(further.motion.any(axis=(1, 2))):
            motion = self.motion * self.request.laplace**power
            values += real_times(further.motion[power], motion)
        return values

    @cached_property
    def ideal_values(self) -> Complex:
        """FRFs before the factors of the readings, laid out like ``values``."""
        values = real_times(self.readout, self.motion)
        if self.ports.has_floor:
            floor_motion = self.ports.readout @ self.ports.floor
            values += floor_motion[:, :, None] * self.floor_factor
        return values.transpose(2, 0, 1)

    @cached_property
    def factor(self) -> Complex:
        """Factor s^q c of the inputs; (n_freq,)."""
        return input_drive_factor(self.assembly, self.request)

    @cached_property
    def drive_factor(self) -> Complex:
        """Factor s^q c of the inputs with the lags of actuators; (n_freq,) or (n_in, n_freq)."""
        lags = self.ports.lags(self.request.laplace)
        return self.factor if lags is None else self.factor * lags

    @cached_property
    def floor_factor(self) -> Complex:
        """Factor s^(q - 2) c: motion of the floor per acceleration of it; (n_freq,)."""
        return self.request.laplace ** (self.request.order - 2) * _gain_factor(
            self.assembly, self.request
        )

    @cached_property
    def drive(self) -> Real:
        """F; (nv, n_in)."""
        return generalised_force(self.assembly, self.ports)


def generalised_force(assembly: Assembly, ports: Ports) -> Real:
    """Return F = T' (P - Mb U) + motors; (nv, n_in)."""
    force = ports.force
    if ports.has_floor:
        force = force - assembly.body[2] @ ports.floor
    return assembly.jacobian.T @ force + ports.motor


def floor_forces_of_loops(assembly: Assembly, ports: Ports, request: FrfRequest) -> Complex:
    """Return the forces of loops that read the floor's motion, -U F(s) V_b' U_floor s^(q - 2) c.

    Args:
        assembly: with the loops.
        ports: with the floor.
        request: lines and quantity.

    Returns:
        (nv, n_in, n_freq).
    """
    shape = len(assembly.matrices.mass), ports.floor.shape[1], len(request.laplace)
    total = np.zeros(shape, np.complex128)
    for term in assembly.frequency_dependent:
        moved = term.body_right.T @ ports.floor
        if term.is_loop and moved.any():
            forces = -term.at(request.laplace) @ moved  # (n_freq, r, n_in)
            total += real_times(term.left, forces.transpose(1, 2, 0))
    return total * request.laplace ** (request.order - 2) * _gain_factor(assembly, request)


def input_drive_factor(assembly: Assembly, request: FrfRequest) -> Complex:
    """Return s^q c, with c the product of the Parts' factors of the inputs; (n_freq,)."""
    if not assembly.input_changes:
        return request.factor
    return request.factor * _gain_factor(assembly, request)


def _gain_factor(assembly: Assembly, request: FrfRequest) -> Complex:
    """Return c; (n_freq,)."""
    factor: Complex = np.ones(len(request.laplace), np.complex128)
    for changes in assembly.input_changes.values():
        factor = factor * input_factor(changes, request.laplace)
    return factor


def output_factor(
    changes: Sequence[Change], outputs: Sequence[Output], laplace: Complex
) -> Complex | None:
    """Return the factor by which each channel's reading is multiplied, None without a change.

    Args:
        changes: changes of the slot output.
        outputs: labels of the channels.
        laplace: s [rad/s]; (n_freq,).

    Returns:
        (n_out, n_freq).
    """
    if not changes:
        return None
    channels = group_by_point(outputs)
    coefficients = np.zeros((len(outputs), 3))
    shaped: Complex = np.zeros((len(outputs), len(laplace)), np.complex128)
    for change in changes:
        if change.point not in channels:
            continue
        rows, axes = channels[change.point].rows, channels[change.point].axes
        if change.shape is None:
            coefficients[rows] += change.left[axes] @ (change.core @ change.right[0]).T
        else:
            core = frequency_dependent_core(change, laplace) @ change.right[0]
            shaped[rows] += change.left[axes] @ core.T
    for power in map(int, np.flatnonzero(coefficients.any(axis=0))):
        shaped += coefficients[:, power, None] * laplace**power
    return np.asarray(np.exp(shaped), np.complex128)


def output_selection(outputs: Sequence[Output], point: str) -> Real:
    """Return 1 where a channel reads a direction of a point, whatever its sign; (n_out, 6)."""
    matrix = np.zeros((len(outputs), 6))
    for row, dof in zip(matrix, outputs, strict=True):
        if dof.point == point:
            row[dof.axis] = 1.0
    return matrix


def input_factor(changes: Sequence[Change], laplace: Complex) -> Complex:
    """Return the factor 1 + sum of changes by which one Part multiplies all inputs; (n_freq,).

    Args:
        changes: the Part's changes of the inputs.
        laplace: s [rad/s]; (n_freq,).
    """
    factor: Complex = np.ones(len(laplace), np.complex128)
    for change in changes:
        core = change.left @ frequency_dependent_core(change, laplace) @ change.right.T
        factor = factor + core[:, 0, 0]
    return factor
