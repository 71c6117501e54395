"""Real modal coordinates of a stable system, one block of A for each mode."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.words import Integers, Real
from mbmodel import SystemMatrices

_MAX_CONDITION = 1e9  # of the modal matrix: beyond it modes nearly coincide


@dataclass(frozen=True, eq=False)
class ModalSystem:
    """A system whose A has a block for each mode.

    Args:
        system: in modal coordinates; each mode is driven as strongly as it is read.
        first: number of the first state of each mode; (n_mode,).
        size: 1 for a real pole, 2 for a pair; n states in one block without modal coordinates.
    """

    system: SystemMatrices
    first: Integers
    size: Integers

    def mode(self, number: int) -> SystemMatrices:
        """Return one mode as a system without feed-through."""
        return self.select([number])

    def select(self, numbers: list[int]) -> SystemMatrices:
        """Return the sum of some modes, without feed-through."""
        states = [
            self.first[number] + step for number in numbers for step in range(self.size[number])
        ]
        full = self.system
        return SystemMatrices(
            full.a[np.ix_(states, states)], full.b[states], full.c[:, states], 0 * full.d
        )


def find_modal_coordinates(system: SystemMatrices) -> ModalSystem:
    """Return the system in real modal coordinates.

    A pair of poles sigma +- i w has the block [[sigma, w], [-w, sigma]] on the real and imaginary
    part of its vector. Where poles nearly coincide, the whole system is one block.

    Args:
        system: stable.
    """
    system = system.balance_units()
    poles, vectors = np.linalg.eig(system.a)
    columns: list[Real] = []
    blocks: list[Real] = []
    for pole, vector in zip(poles, vectors.T, strict=True):
        if pole.imag > 0:
            columns += [vector.real, vector.imag]
            blocks.append(np.array([[pole.real, pole.imag], [-pole.imag, pole.real]]))
        elif pole.imag == 0:
            columns.append(vector.real)
            blocks.append(np.array([[pole.real]]))
    basis = np.array(columns).reshape(-1, system.order).T
    if not system.order or np.linalg.cond(basis) > _MAX_CONDITION:
        block = np.array([system.order], np.intp) if system.order else np.zeros(0, np.intp)
        return ModalSystem(system, np.zeros(len(block), np.intp), block)
    sizes = np.array([len(block) for block in blocks], np.intp)
    first = np.cumsum(sizes) - sizes
    drive = np.array(np.linalg.solve(basis, system.b), np.float64)
    reading = np.array(system.c @ basis, np.float64)
    for start, size in zip(first, sizes, strict=True):
        span = slice(start, start + size)
        strengths = np.linalg.norm(drive[span]), np.linalg.norm(reading[:, span])
        factor = np.sqrt(strengths[1] / strengths[0]) if min(strengths) > 0 else 1.0
        drive[span] *= factor
        reading[:, span] /= factor
    diagonal: Real = scipy.linalg.block_diag(*blocks)
    return ModalSystem(SystemMatrices(diagonal, drive, reading, system.d), first, sizes)
