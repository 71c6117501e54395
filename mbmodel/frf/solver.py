"""Solution of Z(s) x = f at many frequency lines, by the modal form if there is one.

Solution with terms that are no polynomials in s, such as appendages and hysteretic springs.

Z(s) = Z0(s) + U F(s) V', with Z0 a polynomial that has a modal form, and F(s) = f(s) (core_0 + s
core_1 + ...) of low rank. By the Woodbury identity (Golub and Van Loan 2013, ch. 2.1), in a form
without the inverse of F (which may be zero),

    Z^-1 b = y - Y (1 + F V' Y)^-1 F V' y,    y = Z0^-1 b,    Y = Z0^-1 U.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from identification.words import Complex, Integers, Real, UsageError
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.frf.modal_form import ModalForm, real_times

_MAX_CHUNK_BYTES = 64 * 2**20  # of dynamic stiffness that is solved at once: bounds the memory


class Solver:
    """A solver of Z(s) x = f at given lines, by the modal form if there is one.

    Args:
        matrices: M, C, K.
        laplace: s of every line [rad/s]; (n_freq,).
        form: their modal form; None to eliminate line by line.

    Raises:
        UsageError: on solving, if a line has no finite motion.
    """

    def __init__(self, matrices: Matrices, laplace: Complex, form: ModalForm | None) -> None:
        self.matrices, self.laplace, self.form = matrices, laplace, form
        self._zero_lines = np.flatnonzero(laplace == 0)

    def on_lines(self, span: slice) -> "Solver":
        """Return the solver of a run of lines."""
        return Solver(self.matrices, self.laplace[span], self.form)

    @cached_property
    def _kernels(self) -> Complex | None:
        """P and then N of the modal form at every line; (2 h, n_freq)."""
        return None if self.form is None else self.form.kernels(self.laplace)

    @cached_property
    def _blocks(self) -> tuple[Integers, ...]:
        """Coordinates of each part of the machine that no entry of M, C, K couples to another."""
        matrices = self.matrices
        coupled = (matrices.mass != 0) | (matrices.damping != 0) | (matrices.stiffness != 0)
        count, block_of = connected_components(csr_array(coupled), directed=False)
        return tuple(np.flatnonzero(block_of == block) for block in range(count))

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """Return Z^-1 f, or Z^-T f, times a factor of each line.

        Args:
            force: (nv, m, 1) if constant over lines, or (nv, m, n_freq).
            transposed: solve with the transpose.
            factor: such as s^q; (n_freq,).
            through: if given, f is this matrix times ``force``; (nv, n).

        Returns:
            x; (nv, m, n_freq).
        """
        scale = np.ones(1) if factor is None else factor
        is_narrow = through is not None and through.shape[1] < through.shape[0]
        if through is not None and not (is_narrow and self.form is not None):
            force, through = real_times(through, force), None
        if self.form is None or self._kernels is None:
            lines = np.arange(len(self.laplace))
            return self.solve_directly(force, lines, transposed=transposed) * scale
        form = self.form.transposed if transposed else self.form
        kernels = self._kernels if factor is None else self._kernels * factor
        motion = form.receptance(force, kernels, through)
        if form.in_velocity and self._zero_lines.size:
            force = force if through is None else real_times(through, force)
            static = self.solve_directly(force, self._zero_lines, transposed=transposed)
            motion[..., self._zero_lines] = (
                static * np.broadcast_to(scale, self.laplace.shape)[self._zero_lines]
            )
        return motion

    def solve_directly(
        self, force: Real | Complex, lines: np.ndarray, *, transposed: bool = False
    ) -> Complex:
        """Return Z^-1 f, or Z^-T f, at some lines by Gaussian elimination at each line.

        Coordinates that nothing couples to a force stand still, and are left out.

        Args:
            force (nv, m, 1), transposed: as for ``solve``.
            lines: numbers of the lines; (n_lines,).

        Returns:
            x; (nv, m, n_lines).

        Raises:
            UsageError: Z(s) is singular at a line.
        """
        size, m = force.shape[:2]
        forces = np.broadcast_to(force, (size, m, len(self.laplace)))
        motion = np.zeros((size, m, len(lines)), complex)
        for block in self._blocks:
            if not force[block].any():
                continue
            step = max(1, _MAX_CHUNK_BYTES // (16 * len(block) ** 2))
            for start in range(0, len(lines), step):
                chosen = lines[start : start + step]
                stiffness = self._find_dynamic_stiffness(block, chosen, transposed)
                forced = np.asarray(forces[block][..., chosen].transpose(2, 0, 1), complex)
                motion[block, :, start : start + step] = _eliminate(stiffness, forced)
        return motion

    def _find_dynamic_stiffness(
        self, block: Integers, lines: Integers, transposed: bool
    ) -> Complex:
        """Return Z(s), or its transpose, of some coordinates; (n_lines, n, n)."""
        mass, damping, stiffness = (
            (matrix.T if transposed else matrix)[np.ix_(block, block)]
            for matrix in (self.matrices.mass, self.matrices.damping, self.matrices.stiffness)
        )
        s = self.laplace[lines][:, None, None]
        return s**2 * mass + s * damping + stiffness


def _eliminate(stiffness: Complex, forces: Complex) -> Complex:
    """Return x of Z x = f at every line; (n, m, n_lines).

    Args:
        stiffness: Z; (n_lines, n, n).
        forces: f; (n_lines, n, m).
    """
    try:
        return np.asarray(np.linalg.solve(stiffness, forces), complex).transpose(1, 2, 0)
    except np.linalg.LinAlgError as error:
        raise UsageError(
            "the machine has no finite response at a frequency line, such as a free machine at "
            "0 Hz: start the band above it"
        ) from error


_SINGULAR_SHIFT = 1e-13  # of the largest entry: what a singular matrix gets on its diagonal


@dataclass(frozen=True, eq=False)
class WoodburySolver:
    """A solver of Z(s) x = f with low-rank terms of any dependence on frequency.

    Args:
        polynomial_solver: of Z0.
        terms: what is added to Z0.
    """

    polynomial_solver: Solver
    terms: tuple[FrequencyDependentTerm, ...]

    def on_lines(self, span: slice) -> "WoodburySolver":
        """Return the solver of a run of lines."""
        return WoodburySolver(self.polynomial_solver.on_lines(span), self.terms)

    @cached_property
    def _sides(self) -> tuple[Real, Real]:
        """U and V of all terms side by side; (nv, r) and (nv, t)."""
        left = np.hstack([term.left for term in self.terms])
        return left, np.hstack([term.right for term in self.terms])

    @cached_property
    def _cores(self) -> Complex:
        """F at every line; (n_freq, r, t)."""
        left, right = self._sides
        laplace = self.polynomial_solver.laplace
        total = np.zeros((len(laplace), left.shape[1], right.shape[1]), complex)
        row = column = 0
        for term in self.terms:
            r, t = term.left.shape[1], term.right.shape[1]
            total[:, row : row + r, column : column + t] = term.at(laplace)
            row, column = row + r, column + t
        return total

    @cached_property
    def _forward(self) -> Complex:
        """Z0^-1 U; (nv, r, n_freq)."""
        return self.polynomial_solver.solve(self._sides[0][:, :, None])

    @cached_property
    def _backward(self) -> Complex:
        """Z0^-T V; (nv, t, n_freq)."""
        return self.polynomial_solver.solve(self._sides[1][:, :, None], transposed=True)

    def solve(
        self,
        force: Real | Complex,
        *,
        transposed: bool = False,
        factor: Complex | None = None,
        through: Real | None = None,
    ) -> Complex:
        """Return Z^-1 f, or Z^-T f, times a factor of each line.

        Arguments and result are those of ``Solver.solve``.
        """
        y = self.polynomial_solver.solve(
            force, transposed=transposed, factor=factor, through=through
        )
        left, right = self._sides
        core, compliance, readout = self._cores, self._forward, right
        if transposed:
            core, compliance, readout = core.swapaxes(1, 2), self._backward, left
        coupling = real_times(readout.T, compliance).transpose(2, 0, 1)
        forces = core @ real_times(readout.T, y).transpose(2, 0, 1)
        corrections = _solve_lines(np.eye(core.shape[1]) + core @ coupling, forces)
        return y - (compliance.transpose(2, 0, 1) @ corrections).transpose(1, 2, 0)


def _solve_lines(matrix: Complex, right: Complex) -> Complex:
    """Solve at every line, with a small shift if the matrix of some line is singular.

    A line exactly at an undamped resonance then gets a very large response instead of an error.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right), complex)
    except np.linalg.LinAlgError:
        size = 1 + np.abs(matrix).max(axis=(1, 2), keepdims=True)
        shifted = matrix + _SINGULAR_SHIFT * size * np.eye(matrix.shape[1])
        return np.asarray(np.linalg.solve(shifted, right), complex)
