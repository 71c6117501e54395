"""Forward sensitivities: derivatives of every FRF by every parameter, on any run of lines.

A change of the equation acts as a pseudo-force on the joints, as a motion of the bodies, or on the
readout (direct differentiation):

    dH_p = y' g_p + L d_p + c_p,    y = Z^-T T' L' the adjoint solutions of the outputs.

Each term is a sum of s^k f(s) K_p v, with a real matrix K_p of the slope left core_pk right' and a
source v. With x the motion of the joints, b = T x that of the bodies relative to the floor,
a = b + U s^(q-2) their absolute motion, e the inputs' unit forces s^q:

    joint    g = -left core right' x
    body     g = -T' left core right' b,  of a for masses
    path     d = left core right' x,      g = -T' Zb d + right core' left' (P s^q - Zb b or Mb a)
    hammer   g = T' right core' left' (directions of the inputs) e
    input    g = core / c_p F e,          c = core / c_p L U s^(q-2) for floor motion
    sensor   c = (directions of the outputs) left core right' a
    output   c = (directions of the outputs) left core right' L a

All of it is about H before the factors of the readings; ``columns`` multiplies by these at the end.

The matrices of all parameters with one k, f and v stand side by side, so that one real product
gives all their g. Gravity's stiffness adds -dK x to g where bodies or joints change.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel.frf.channel_factors import input_factor, output_selection
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.parameter_groups import ParameterGroup, stack_parameters
from mbmodel.frf.ports import direction_selection
from mbmodel.frf.solution import FrfSolution
from mbmodel.linearisation.gravity import gravity_slope
from mbmodel.parts import Change

Slopes = Sequence[tuple[Change, ...]]
_Target = Literal["force", "motion", "readout"]
_Source = Literal["joints", "relative", "absolute", "body_loads", "inputs", "floor"]
_Shape = Callable[[Complex], Complex] | None
_Key = tuple[_Target, _Source, int, _Shape]  # the integer is the power of s

_INERTIA_POWER = 2  # of s in the inertia forces: masses feel absolute motion, springs relative


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
        solution: the model linearised at theta.
        slopes: of every Part that has parameters among the chosen.
        chosen: parameters of interest; (n_parameter,).
        rates: factor of each derivative; one if None; (n_parameter,).
    """

    def __init__(
        self, solution: FrfSolution, slopes: Slopes, chosen: Mask, rates: Real | None = None
    ) -> None:
        self.solution = solution
        self.count = int(chosen.sum())
        self._chosen = solution.model.split_parameters(chosen)
        self._rates = np.ones(self.count) if rates is None else rates[chosen]
        self._slopes = slopes

    @property
    def has_readout_terms(self) -> bool:
        """Whether some parameter changes the readout of outputs, and not only the motion."""
        return any(target == "readout" for target, *_ in self._groups)

    def prepare(self) -> None:
        """Compute what all lines share, so that threads can request runs of lines."""
        _ = self._output_adjoints, self._absolute, self._body_loads, self._groups

    def output_adjoints(self, span: slice) -> Real:
        """Return real and imaginary parts of y'; (n_line, n_out, 2, nv)."""
        adjoints = self._output_adjoints[..., span]
        parts = np.empty((adjoints.shape[2], adjoints.shape[1], 2, adjoints.shape[0]))
        parts[:, :, 0] = adjoints.real.transpose(2, 1, 0)
        parts[:, :, 1] = adjoints.imag.transpose(2, 1, 0)
        return parts

    def pseudo_forces(self, span: slice) -> Real:
        """Return the pseudo-forces g of all chosen parameters; (n_line, n_in, 2, nv, n_chosen)."""
        n_in = self.solution.values.shape[2]
        n_line = len(self.solution.request.laplace[span])
        total = np.zeros((n_line, n_in, 2, len(self.solution.motion), self.count))
        for term in self._sensitivity_terms("force", span):
            total[..., term.indices] += term.values
        return total

    def kinematic_terms(self, span: slice) -> Iterator[SensitivityTerm]:
        """Yield d of the parameters that move joints, n = 6 n_body; terms add up."""
        return self._sensitivity_terms("motion", span)

    def readout_terms(self, span: slice) -> Iterator[SensitivityTerm]:
        """Yield c of the parameters of sensors, n = n_out; terms add up."""
        return self._sensitivity_terms("readout", span)

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
        targets = {"force": adjoint, "readout": weights}
        if any(target == "motion" for target, *_ in self._groups):
            targets["motion"] = real_times(self.solution.ports.readout.T, weights)
        flat = {target: _flatten(values.conj()) for target, values in targets.items()}
        total = np.zeros(self.count)
        for (target, source, power, shape), group in self._groups.items():
            values_of_source = self._scaled_source(source, power, shape, slice(None))
            product = _flatten(values_of_source) @ flat[target].T
            total[group.indices] += product.ravel() @ group.matrix.reshape(-1, group.count)
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
        selected = output_selection(request.outputs, changes[0].point)
        outputs = np.flatnonzero(selected.any(axis=1))
        shape = (len(ideal), len(outputs), ideal.shape[2], int(mask.sum()))
        derivatives = np.zeros(shape, complex)
        for change in changes:
            core = change.core[mask]
            active = np.flatnonzero(core.any(axis=(1, 2, 3)))
            if change.slot == "output":
                factors = selected[outputs] @ change.left @ core[active] @ change.right[0]
                relative = np.einsum(
                    "fk,pkr->frp", request.laplace[:, None] ** np.arange(3), factors
                )
                derivatives[..., active] += ideal[:, outputs, :, None] * relative[:, :, None]
                continue
            directions = direction_selection(request.outputs, change.point)[outputs]
            left = directions @ change.left @ core[active, 0]
            body_rows = np.flatnonzero(change.right.any(axis=1))
            motion = real_times(change.right[body_rows].T, self._absolute[body_rows])
            derivatives[..., active] += np.einsum("prt,tif->frip", left, motion, optimize=True)
        return outputs, derivatives

    @cached_property
    def _output_adjoints(self) -> Complex:
        """Adjoint solutions y of every output; (nv, n_out, n_freq)."""
        return self.solution.solver.solve(self.solution.readout.T[:, :, None], transposed=True)

    @cached_property
    def _relative(self) -> Complex:
        """Motion b = T x relative to the floor, which springs feel; (6 n_body, n_in, n_freq)."""
        return real_times(self.solution.assembly.jacobian, self.solution.motion)

    @cached_property
    def _absolute(self) -> Complex:
        """Motion a = T x + U s^(q - 2), which masses and sensors feel; (6 n_body, n_in, n_freq)."""
        solution = self.solution
        if not solution.ports.has_floor:
            return self._relative
        return self._relative + solution.ports.floor[:, :, None] * solution.floor_factor

    @cached_property
    def _body_loads(self) -> Complex:
        """Forces P s^q - Zb (...) of each body on its joint; (6 n_body, n_in, n_freq)."""
        solution = self.solution
        total: Complex = solution.ports.force[:, :, None] * solution.factor
        for power in np.flatnonzero(solution.assembly.body.any(axis=(1, 2))):
            motion = self._absolute if power == _INERTIA_POWER else self._relative
            total -= (
                real_times(solution.assembly.body[power], motion) * solution.request.laplace**power
            )
        for term in self.solution.assembly.frequency_dependent:
            if not term.body_left.any():
                continue
            elongation = real_times(term.right.T, solution.motion)
            if term.is_loop and solution.ports.has_floor:
                moved = term.body_right.T @ solution.ports.floor
                elongation = elongation + moved[:, :, None] * solution.floor_factor
            forces = term.at(solution.request.laplace) @ elongation.transpose(2, 0, 1)
            total -= real_times(term.body_left, forces.transpose(1, 2, 0))
        return total

    def _source_values(self, source: _Source, span: slice) -> Complex:
        """Return the source v; (m, n_in, n_line)."""
        if source == "joints":
            return self.solution.motion[..., span]
        if source in ("inputs", "floor"):
            n_in, solution = self.solution.values.shape[2], self.solution
            factor = solution.factor if source == "inputs" else solution.floor_factor
            return np.eye(n_in)[:, :, None] * factor[span]
        motions = {
            "relative": self._relative,
            "absolute": self._absolute,
            "body_loads": self._body_loads,
        }
        return motions[source][..., span]

    def _scaled_source(self, source: _Source, power: int, shape: _Shape, span: slice) -> Complex:
        """Return the source times s^power and a shape f(s); (m, n_in, n_line)."""
        values, laplace = self._source_values(source, span), self.solution.request.laplace[span]
        if power or shape is not None:
            factor = laplace**power
            values = values * (factor if shape is None else factor * shape(laplace))
        return values

    def _sensitivity_terms(self, target: _Target, span: slice) -> Iterator[SensitivityTerm]:
        """Yield the terms of one target, one product for all parameters of a group."""
        for (group_target, source, power, shape), group in self._groups.items():
            if group_target != target:
                continue
            source_values = self._scaled_source(source, power, shape, span)
            m, n_in, n_line = source_values.shape
            flat = np.empty((n_line, n_in, 2, m))
            flat[:, :, 0] = source_values.real.transpose(2, 1, 0)
            flat[:, :, 1] = source_values.imag.transpose(2, 1, 0)
            values = flat.reshape(-1, m) @ group.matrix
            yield SensitivityTerm(group.indices, values.reshape(n_line, n_in, 2, -1, group.count))

    @cached_property
    def _groups(self) -> dict[_Key, ParameterGroup]:
        """Parameters grouped by target, source, power of s and shape."""
        terms: dict[_Key, list[tuple[Integers, Real]]] = {}
        start = 0
        for number, (mask, changes) in enumerate(zip(self._chosen, self._slopes, strict=True)):
            indices = np.arange(start, start + int(mask.sum()))
            start += len(indices)
            for change in changes if len(indices) else ():
                core = change.core[mask] * self._rates[indices][:, None, None, None]
                for key, matrices in self._term_matrices(number, change, core):
                    active = matrices.any(axis=(1, 2))
                    if active.any():
                        terms.setdefault(key, []).append((indices[active], matrices[active]))
        return {key: stack_parameters(of_key) for key, of_key in terms.items()}

    def _term_matrices(
        self, number: int, change: Change, core: Real
    ) -> Iterator[tuple[_Key, Real]]:
        """Yield the matrices K of one slope with their keys; (n_parameter, n, m).

        Args:
            number: number of the Part.
            change: slope of the Part.
            core: its core for the chosen parameters; (n_parameter, 3, r, t).
        """
        solution, shape = self.solution, change.shape
        if change.slot == "input":
            yield from self._input_terms(number, change, core)
            return
        left, right, to_joints = change.left, change.right.T, solution.assembly.jacobian.T
        for power in map(int, np.flatnonzero(core.any(axis=(0, 2, 3)))):
            slope, slope_transposed = core[:, power], core[:, power].swapaxes(1, 2)
            if change.slot == "joint":
                yield ("force", "joints", power, shape), -left @ slope @ right
            elif change.slot == "body":
                source: _Source = "absolute" if power == _INERTIA_POWER else "relative"
                yield ("force", source, power, shape), (-to_joints @ left) @ slope @ right
            elif change.slot == "path":
                motion = left @ slope @ right
                yield ("motion", "joints", power, shape), motion
                yield from self._inertia_terms(motion, power, shape)
                yield (
                    ("force", "body_loads", power, shape),
                    change.right @ slope_transposed @ left.T,
                )
            elif change.slot == "output":
                selected = output_selection(solution.request.outputs, change.point) @ change.left
                relative = (selected @ slope @ right)[:, :, 0]
                ports = solution.ports
                scale = relative[:, :, None]
                yield ("readout", "absolute", power, shape), scale * ports.readout
                yield ("readout", "joints", power, shape), scale * ports.joint_readout
            elif change.slot == "hammer":
                directions = direction_selection(solution.request.inputs, change.point) @ left
                force = (to_joints @ change.right) @ slope_transposed @ directions.T
                yield ("force", "inputs", power, shape), force
            else:
                readout = direction_selection(solution.request.outputs, change.point) @ left
                yield ("readout", "absolute", power, shape), readout @ slope @ right
        if change.slot in ("body", "path"):
            yield from self._gravity_terms(change, core)

    def _input_terms(self, number: int, change: Change, core: Real) -> Iterator[tuple[_Key, Real]]:
        """Yield the terms of a factor c_p of the inputs: dH = H dc_p / c_p."""
        solution = self.solution
        changes = solution.assembly.input_changes.get(number, ())

        def relative(laplace: Complex) -> Complex:
            """Return f(s) / c_p(s)."""
            numerator = 1.0 if change.shape is None else change.shape(laplace)
            return np.asarray(numerator / input_factor(changes, laplace), np.complex128)

        floor_motion = solution.ports.readout @ solution.ports.floor
        for power in map(int, np.flatnonzero(core.any(axis=(0, 2, 3)))):
            scalars = change.left @ core[:, power] @ change.right.T
            yield ("force", "inputs", power, relative), scalars * solution.drive
            if solution.ports.has_floor:
                yield ("readout", "floor", power, relative), scalars * floor_motion
                yield from self._floor_terms_of_loops(scalars, power, relative)

    def _floor_terms_of_loops(
        self, scalars: Real, power: int, shape: Callable[[Complex], Complex]
    ) -> Iterator[tuple[_Key, Real]]:
        """Yield the forces of loops that read the floor's motion, for a factor of the inputs."""
        solution = self.solution
        for term in solution.assembly.frequency_dependent:
            if not term.is_loop:
                continue
            moved = term.body_right.T @ solution.ports.floor
            product = _shape_product(shape, term.change.shape)
            for order in map(int, np.flatnonzero(term.change.core.any(axis=(1, 2)))):
                force = -term.left @ term.change.core[order] @ moved
                yield ("force", "floor", power + order, product), scalars * force

    def _inertia_terms(
        self, motion: Real, power: int, shape: _Shape
    ) -> Iterator[tuple[_Key, Real]]:
        """Yield the pseudo-forces -T' Zb d of joints that move.

        Args:
            motion: d; (n_parameter, 6 n_body, nv).
            power: of s, of the motion.
            shape: f(s) of the motion.
        """
        assembly = self.solution.assembly
        to_joints = assembly.jacobian.T
        for inertia_power in map(int, np.flatnonzero(assembly.body.any(axis=(1, 2)))):
            load = to_joints @ assembly.body[inertia_power]
            yield ("force", "joints", power + inertia_power, shape), -load @ motion
        for term in assembly.frequency_dependent:
            if not term.body_right.any():
                continue
            core, product = term.change.core, _shape_product(shape, term.change.shape)
            for inertia_power in map(int, np.flatnonzero(core.any(axis=(1, 2)))):
                load = term.left @ core[inertia_power] @ term.body_right.T
                yield ("force", "joints", power + inertia_power, product), -load @ motion

    def _gravity_terms(self, change: Change, core: Real) -> Iterator[tuple[_Key, Real]]:
        """Yield the pseudo-forces -dK x of gravity."""
        assembly = self.solution.assembly
        machine = assembly.machine
        power = _INERTIA_POWER if change.slot == "body" else 0
        if not assembly.has_weight or not core[:, power].any():
            return
        slopes = np.zeros((len(core), *assembly.matrices.mass.shape))
        for slope, core_slope in zip(slopes, core[:, power], strict=True):
            body_slope = change.left @ core_slope @ change.right.T
            varied = {"jacobian_change": body_slope}
            if change.slot == "body":
                varied = {"inertia_change": machine.weight_fraction[:, None] * body_slope}
            slope[:] = gravity_slope(
                machine.body_gravity,
                machine.precedence,
                assembly.jacobian,
                assembly.weight_bearing_mass,
                **varied,
            )
        yield ("force", "joints", 0, change.shape), -slopes


def _flatten(values: Complex) -> Real:
    """Return (m, n_in, n_freq) complex numbers as real numbers in m rows."""
    return np.ascontiguousarray(values).reshape(len(values), -1).view(float)


def _shape_product(first: _Shape, second: _Shape) -> _Shape:
    """Return the product of two shapes, each of which may be None."""
    if first is None or second is None:
        return second if first is None else first
    return lambda laplace: first(laplace) * second(laplace)
