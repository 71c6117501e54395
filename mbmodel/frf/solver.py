"""Solution of Z(s) x = f at many frequency lines, by the modal form if there is one."""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from identification.words import Complex, Integers, Real, UsageError
from mbmodel.assembly import Matrices
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
            force: (nv, m, 1) if constant over lines, or (nv, m, n_freq).
            lines: numbers of the lines; (n_lines,).
            transposed: solve with the transpose.

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
        total: Complex = s**2 * mass + s * damping + stiffness
        return total


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
