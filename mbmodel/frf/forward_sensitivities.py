"""Forward sensitivities: derivatives of every FRF by every parameter, on any run of lines.

    dH_p = y' g_p + L d_p + c_p

with the pseudo-forces g, the motions d of bodies and the changes c of readings of ``slope_terms``,
and y the adjoint solutions of the outputs. The matrices of all parameters with one target are one
sparse matrix, so that one product gives all their g. All of it is about H before the factors of the
readings; ``columns`` multiplies by these at the end.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.motion_sources import MotionSources
from mbmodel.frf.slope_matrix import (
    SlopeMatrix,
    TermsByTarget,
    as_slice,
    collect_terms,
    move_loads_to_joints,
    stack_terms,
)
from mbmodel.frf.slope_terms import Target
from mbmodel.frf.solution import FrfSolution
from mbmodel.frf.solver import Solver, WoodburySolver
from mbmodel.parts import Change
from mbmodel.ports.ports import NO_CHANNELS, PointChannels, group_by_point

Slopes = Sequence[tuple[Change, ...]]

_MAX_ADJOINT_BYTES = 128 * 2**20  # of adjoint solutions that are kept for all lines
FORCE_TARGETS: tuple[Literal["force"], Literal["load"]] = ("force", "load")


@dataclass(frozen=True, eq=False)
class ForceEntries:
    """Entries of pseudo-forces or loads that are not zero, real and imaginary parts apart.

    Args:
        target: ``force`` on the joints' coordinates, or ``load`` on the bodies.
        coordinates: coordinate of each entry, in rising order; (n_entry,).
        parameters: number of its parameter among the chosen; (n_entry,).
        values: (n_entry, n_line, n_in, 2).
    """

    target: Literal["force", "load"]
    coordinates: Integers
    parameters: Integers
    values: Real


@dataclass(frozen=True, eq=False)
class SensitivityTerm:
    """A term in the derivatives of some parameters, real and imaginary parts one after the other.

    Args:
        indices: numbers of the parameters among the chosen.
        values: (n_line, n_in, 2, n, n_parameter of the term).
    """

    indices: Integers | slice
    values: Real


class ForwardSensitivities:
    """Derivatives of the FRFs of one linearised model.

    Args:
        slopes: of every Part that has parameters among the chosen.
        chosen: parameters of interest; (n_parameter,).
        rates: factor of each derivative; one if None; (n_parameter,).
        places: number of each chosen parameter among the results, where those of parameters with
            one number add up; its own if None; (n_chosen,).
    """

    def __init__(
        self,
        solution: FrfSolution,
        slopes: Slopes,
        chosen: Mask,
        rates: Real | None = None,
        places: Integers | None = None,
    ) -> None:
        self.solution = solution
        self._places = np.arange(int(chosen.sum())) if places is None else places
        self.count = int(self._places.max(initial=-1)) + 1
        self._chosen = solution.model.split_parameters(chosen)
        self._rates = np.ones(len(self._places)) if rates is None else rates[chosen]
        self._slopes = slopes
        self._sources = MotionSources(solution)

    @property
    def has_readout_terms(self) -> bool:
        """Whether some parameter changes the readout of outputs, and not only the motion."""
        return "readout" in self._slope_matrices

    def prepare(self) -> None:
        """Compute what all lines share, so that threads can request runs of lines."""
        _ = self._kept_adjoints, self._slope_matrices
        self._sources.prepare()

    def output_adjoints(self, span: slice) -> Real:
        """Return real and imaginary parts of y'; (n_line, n_out, 2, nv)."""
        adjoints = self._adjoints(span)
        parts = np.empty((adjoints.shape[2], adjoints.shape[1], 2, adjoints.shape[0]))
        parts[:, :, 0] = adjoints.real.transpose(2, 1, 0)
        parts[:, :, 1] = adjoints.imag.transpose(2, 1, 0)
        return parts

    def pseudo_forces(self, span: slice) -> Real:
        """Return the pseudo-forces g of all chosen parameters; (n_line, n_in, 2, nv, n_chosen)."""
        term = self._sensitivities("force", span)
        if term is not None:
            return term.values
        n_line, n_in = len(self.solution.request.laplace[span]), self.solution.values.shape[2]
        return np.zeros((n_line, n_in, 2, len(self.solution.motion), self.count))

    def force_entries(self, span: slice) -> Iterator[ForceEntries]:
        """Yield the entries of the pseudo-forces, then of the loads on bodies; g is their sum."""
        for target in FORCE_TARGETS:
            slopes = self._force_matrices.get(target)
            if slopes is None:
                continue
            sources = np.ascontiguousarray(self._sources.stack(slopes, span).transpose(0, 2, 1))
            values = slopes.multiply_entries(sources.reshape(len(sources), -1).view(float))
            coordinates, parameters = slopes.entries
            yield ForceEntries(
                target, coordinates, parameters, values.reshape(-1, *sources.shape[1:], 2)
            )

    @property
    def is_force_alone(self) -> Mask:
        """Whether each chosen parameter acts by forces alone; (n_chosen,)."""
        acts_otherwise = np.zeros(self.count, bool)
        for target, terms in self._terms.items():
            for indices, term in terms if target not in FORCE_TARGETS else ():
                acts_otherwise[indices[term.core.any(axis=(1, 2))]] = True
        return ~acts_otherwise

    def kinematic_terms(self, span: slice) -> Iterator[SensitivityTerm]:
        """Yield d of the parameters that move joints, n = 6 n_body; terms add up."""
        term = self._sensitivities("motion", span)
        if term is not None:
            yield term

    def readout_terms(self, span: slice) -> Iterator[SensitivityTerm]:
        """Yield c of the parameters of sensors, n = n_out; terms add up."""
        term = self._sensitivities("readout", span)
        if term is not None:
            yield term

    def columns(self, span: slice = slice(None)) -> Complex:
        """Return derivatives by the chosen parameters; (n_line, n_out, n_in, n_chosen)."""
        forces = self.pseudo_forces(span)
        complex_forces = forces[:, :, 0] + 1j * forces[:, :, 1]
        adjoints = self.output_adjoints(span)
        total = (adjoints[:, :, 0] + 1j * adjoints[:, :, 1])[:, None] @ complex_forces
        for term in self.kinematic_terms(span):
            motion = self.solution.ports.readout @ term.values
            total[..., term.indices] += motion[:, :, 0] + 1j * motion[:, :, 1]
        for term in self.readout_terms(span):
            total[..., term.indices] += term.values[:, :, 0] + 1j * term.values[:, :, 1]
        columns = np.asarray(total.swapaxes(1, 2), complex)
        factor = self.solution.output_factor
        if factor is not None:
            columns = columns * factor.T[span, :, None, None]
        return columns

    def vector_jacobian_product(self, weights: Complex, adjoint: Complex) -> Real:
        """Return Re sum W H' over lines and inputs without forming any column.

        Parameters with one source and one target take one matrix product together.

        Args:
            weights: W, conjugate, times the factors of the readings; (n_out, n_in, n_freq).
            adjoint: a = Z^-T G' W; (nv, n_in, n_freq).

        Returns:
            (n_chosen,).
        """
        targets: dict[Target, Complex] = {"force": adjoint, "readout": weights}
        if "motion" in self._slope_matrices:
            targets["motion"] = real_times(self.solution.ports.readout.T, weights)
        total = np.zeros(self.count)
        for target, slopes in self._slope_matrices.items():
            flat = _flatten(targets[target].conj())
            sources = _flatten(self._sources.stack(slopes, slice(None)))
            total[slopes.indices] += slopes.contract(flat @ sources.T)
        return total

    def sensor_rows(self, part: int) -> tuple[Integers, Complex]:
        """Return the outputs that a sensor's Part changes, and the derivatives of these alone.

        The derivatives are those before the factors of the readings.

        Args:
            part: number of the Part.

        Returns:
            Numbers of the outputs (n_row,), and (n_freq, n_row, n_in, n_parameter of the Part).
        """
        changes, mask = self._slopes[part], self._chosen[part]
        ideal, request = self.solution.ideal_values, self.solution.request
        channels = self._channels.get(changes[0].point, NO_CHANNELS)
        outputs = channels.rows
        shape = (len(ideal), ideal.shape[2], len(outputs), int(mask.sum()))
        derivatives = np.zeros(shape, complex)  # (n_freq, n_in, n_row, n_parameter)
        for change in changes:
            core = change.core[mask]
            active = as_slice(np.flatnonzero(core.any(axis=(1, 2, 3))))
            if change.slot == "output":
                factors = channels.selection @ change.left @ core[active] @ change.right[0]
                relative = np.einsum(
                    "fk,pkr->frp", request.laplace[:, None] ** np.arange(3), factors
                )
                readings = ideal[:, outputs].swapaxes(1, 2)
                derivatives[..., active] += readings[..., None] * relative[:, None]
                continue
            left = channels.directions @ change.left @ core[active, 0]
            body_rows = np.flatnonzero(change.right.any(axis=1))
            motion = real_times(change.right[body_rows].T, self._sources.absolute[body_rows])
            products = motion.transpose(2, 1, 0) @ left.transpose(2, 1, 0).reshape(
                left.shape[2], -1
            )
            derivatives[..., active] += products.reshape(*shape[:3], len(left))
        return outputs, derivatives.swapaxes(1, 2)

    @cached_property
    def _channels(self) -> dict[str, PointChannels]:
        """Outputs at each point."""
        return group_by_point(self.solution.request.outputs)

    def _adjoints(self, span: slice) -> Complex:
        """Return adjoint solutions y of every output; (nv, n_out, n_line)."""
        if self._kept_adjoints is not None:
            return self._kept_adjoints[..., span]
        return self._solve_adjoints(self.solution.solver.on_lines(span))

    @cached_property
    def _kept_adjoints(self) -> Complex | None:
        """Adjoint solutions at all lines; None if they are too large to be kept."""
        solution = self.solution
        size = solution.readout.size * len(solution.request.laplace) * np.dtype(complex).itemsize
        return self._solve_adjoints(solution.solver) if size <= _MAX_ADJOINT_BYTES else None

    def _solve_adjoints(self, solver: Solver | WoodburySolver) -> Complex:
        """Return adjoint solutions at the lines of a solver; (nv, n_out, n_line)."""
        return solver.solve(self.solution.readout.T[:, :, None], transposed=True)

    def _sensitivities(self, target: Target, span: slice) -> SensitivityTerm | None:
        """Return the term of one target for all its parameters; None if it has none."""
        slopes = self._slope_matrices.get(target)
        if slopes is None:
            return None
        sources = np.ascontiguousarray(self._sources.stack(slopes, span).transpose(0, 2, 1))
        values = slopes.multiply(sources.reshape(len(sources), -1).view(float))
        n_line, n_in = sources.shape[1:]
        return SensitivityTerm(slopes.indices, values.reshape(n_line, n_in, 2, -1, slopes.count))

    @cached_property
    def _slope_matrices(self) -> dict[Target, SlopeMatrix]:
        """Matrices of all parameters by target; for pseudo-forces of every chosen parameter."""
        terms = move_loads_to_joints(self._terms, self.solution.assembly.jacobian.T)
        return stack_terms(self.solution, terms, self.count)

    @cached_property
    def _force_matrices(self) -> dict[Target, SlopeMatrix]:
        """Matrices of the pseudo-forces of all parameters, and of their loads on bodies."""
        forces: TermsByTarget = {target: self._terms[target] for target in FORCE_TARGETS}
        return stack_terms(self.solution, forces, self.count)

    @cached_property
    def _terms(self) -> TermsByTarget:
        terms = collect_terms(self.solution, self._slopes, self._chosen, self._rates)
        return {
            target: [(self._places[numbers], term) for numbers, term in of_target]
            for target, of_target in terms.items()
        }


def _flatten(values: Complex) -> Real:
    """Return (m, n_in, n_freq) complex numbers as real numbers in m rows."""
    return np.ascontiguousarray(values).reshape(len(values), -1).view(float)
