"""Motions and forces that slopes act on: the sources v of pseudo-forces, motions and readings."""

from functools import cached_property

import numpy as np

from identification.words import Complex
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.slope_matrix import SlopeMatrix
from mbmodel.frf.slope_terms import INERTIA_POWER, SlopeSource, SourceName
from mbmodel.frf.solution import FrfSolution


class MotionSources:
    """Sources of one linearised model, on any run of lines."""

    def __init__(self, solution: FrfSolution) -> None:
        self.solution = solution

    def prepare(self) -> None:
        """Compute what all lines share."""
        _ = self.absolute, self.body_loads

    @cached_property
    def relative(self) -> Complex:
        """Motion b = T x relative to the floor, which springs feel; (6 n_body, n_in, n_freq)."""
        return real_times(self.solution.assembly.jacobian, self.solution.motion)

    @cached_property
    def absolute(self) -> Complex:
        """Motion a = T x + U s^(q - 2), which masses and sensors feel; (6 n_body, n_in, n_freq)."""
        solution = self.solution
        if not solution.ports.has_floor:
            return self.relative
        return self.relative + solution.ports.floor[:, :, None] * solution.floor_factor

    @cached_property
    def body_loads(self) -> Complex:
        """Forces P s^q - Zb (...) of each body on its joint; (6 n_body, n_in, n_freq)."""
        solution = self.solution
        total: Complex = solution.ports.force[:, :, None] * solution.drive_factor
        for power in np.flatnonzero(solution.assembly.body.any(axis=(1, 2))):
            motion = self.absolute if power == INERTIA_POWER else self.relative
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

    def _values(self, name: SourceName, span: slice) -> Complex:
        """Return the source v; (m, n_in, n_line)."""
        if name == "joints":
            return self.solution.motion[..., span]
        if name in ("inputs", "floor"):
            n_in, solution = self.solution.values.shape[2], self.solution
            factor = solution.drive_factor if name == "inputs" else solution.floor_factor
            return np.eye(n_in)[:, :, None] * factor[..., span]
        motions = {
            "relative": self.relative,
            "absolute": self.absolute,
            "body_loads": self.body_loads,
        }
        return motions[name][..., span]

    def _scale(self, source: SlopeSource, span: slice) -> Complex:
        """Return the source times s^power and a shape f(s); (m, n_in, n_line)."""
        values, laplace = (
            self._values(source.name, span),
            self.solution.request.laplace[span],
        )
        if source.power or source.shape is not None:
            factor = laplace**source.power
            values = values * (factor if source.shape is None else factor * source.shape(laplace))
        return values

    def stack(self, slopes: SlopeMatrix, span: slice) -> Complex:
        """Return the sources of a matrix, one below the other; (m, n_in, n_line).

        Args:
            slopes: matrix with its sources.
            span: lines.
        """
        shape = (
            slopes.width,
            self.solution.values.shape[2],
            len(self.solution.request.laplace[span]),
        )
        values = np.empty(shape, complex)
        for source, rows in slopes.sources:
            values[rows] = self._scale(source, span)
        return values
