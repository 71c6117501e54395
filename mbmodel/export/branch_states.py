"""States of laws that are no polynomials in s: rational branches beside M, C and K."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.export.approximations import Approximation, approximate


@dataclass(frozen=True, eq=False)
class ApproximatedLaw:
    """A law of a Part, and what stands for it in the state space.

    Args:
        owner: parameter of the Part that states its size, such as ``tilt_tx.loss_factor``.
        states: number of states that it adds.
        approximation: rational function with its errors.
    """

    owner: str
    states: int
    approximation: Approximation


@dataclass(frozen=True, eq=False)
class BranchStates:
    """Equation of motion with further states xi.

        M v' + C v + (K + i H) q + force xi = f
        xi' = dynamics xi + gain_0 q + gain_1 v + gain_2 v'

    Args:
        matrices: M, C, K with the polynomial parts of the rational functions.
        loss: H of losses that are constant at all positive frequencies; (nv, nv).
        dynamics: (n_branch, n_branch).
        gains: of q, v and v'; (3, n_branch, nv).
        force: (nv, n_branch).
        laws: what was approximated.
    """

    matrices: Matrices
    loss: Real
    dynamics: Real
    gains: Real
    force: Real
    laws: tuple[ApproximatedLaw, ...]

    @property
    def names(self) -> list[str]:
        """Name of each state."""
        return [f"{law.owner}.{k}" for law in self.laws for k in range(law.states)]


def branch_states(
    matrices: Matrices, terms: Sequence[FrequencyDependentTerm], freq_hz: Real
) -> BranchStates:
    """Return the states of terms f(s) left (core_0 + s core_1 + s^2 core_2) right'.

    With f(s) ~ constant + slope s + c (s - A)^-1 b, constant and slope go into K, C and M, and each
    row of the core drives a copy of the states (A, b, c). A constant loss goes into H.

    Args:
        matrices: M, C, K without the terms.
        terms: laws of Parts.
        freq_hz: lines at which the laws are approximated [Hz]; (n_freq,).
    """
    size, lines = len(matrices.mass), freq_hz[freq_hz > 0]
    total = np.stack([matrices.stiffness, matrices.damping, matrices.mass])
    loss, blocks = np.zeros((size, size)), list[Real]()
    gains, forces, laws = [np.zeros((3, 0, size))], [np.zeros((size, 0))], []
    for term in terms:
        shape, core = term.change.shape, term.change.core
        if shape is None:
            raise ValueError("a term without f(s) belongs to the matrices")
        products = term.left @ core @ term.right.T
        result = approximate(shape, lines, has_slope=not core[2].any(), has_loss=not core[1:].any())
        function, loss = result.function, loss + result.loss * products[0]
        total += function.constant * products
        total[1:] += function.slope * products[:2]
        dynamics, drive, reading = function.states()
        rows = _used_rows(core)
        inputs = (core @ term.right.T)[:, rows]
        blocks += [dynamics] * len(rows)
        gains.append(np.einsum("pri,s->prsi", inputs, drive).reshape(3, -1, size))
        forces.append(np.einsum("ir,s->irs", term.left[:, rows], reading).reshape(size, -1))
        laws.append(ApproximatedLaw(term.owner, len(rows) * function.order, result))
    stiffness, damping, mass = total
    return BranchStates(
        Matrices(mass, damping, stiffness),
        loss,
        _block_diagonal(blocks),
        np.concatenate(gains, axis=1),
        np.concatenate(forces, axis=1),
        tuple(laws),
    )


def _used_rows(core: Real) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the rows of the core that are not zero in every power; (n_row,)."""
    return np.flatnonzero(core.any(axis=(0, 2)))


def _block_diagonal(blocks: Sequence[Real]) -> Real:
    """Return a matrix with the blocks on its diagonal."""
    size = sum(map(len, blocks))
    matrix, place = np.zeros((size, size)), 0
    for block in blocks:
        end = place + len(block)
        matrix[place:end, place:end] = block
        place = end
    return matrix
