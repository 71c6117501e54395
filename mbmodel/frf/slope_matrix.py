"""The matrices K of all parameters with one target as one sparse matrix.

A slope of a spring has a single entry, and that of a mass acts on the joints below its body alone.
Dense matrices of n coordinates and p parameters would hold n^2 p numbers, 55 GB for 200 bodies.

Terms in the slopes of all chosen parameters, stacked into one sparse matrix for each target.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from identification.words import Integers, Mask, Real
from mbmodel.frf.slope_terms import SlopeSource, SlopeTerm, Target, act_on_joints, slope_terms
from mbmodel.frf.solution import FrfSolution
from mbmodel.parts import Change


@dataclass(frozen=True, eq=False)
class SlopeMatrix:
    """Matrices K of several parameters, with their sources one below the other.

    Args:
        sources: each v with its rows among all sources; n_source.
        indices: numbers of the parameters among the chosen.
        count: number of parameters.
        matrix: K; (n count, m), with the rows of coordinate i together.
    """

    sources: tuple[tuple[SlopeSource, slice], ...]
    indices: Integers | slice
    count: int
    matrix: scipy.sparse.csr_array

    @property
    def width(self) -> int:
        """Number of rows of all sources."""
        return int(self.matrix.shape[1])

    def multiply(self, values: Real) -> Real:
        """Return K v of every parameter.

        Args:
            values: sources; (m, n_column).

        Returns:
            (n_column, n, n_parameter).
        """
        product = np.zeros((values.shape[1], self.matrix.shape[0]))
        product[:, self._filled_rows] = self.multiply_entries(values).T
        return product.reshape(len(product), -1, self.count)

    @property
    def entries(self) -> tuple[Integers, Integers]:
        """Coordinate and parameter of each entry of K v that is not zero, by coordinate."""
        return self._filled_rows // self.count, self._filled_rows % self.count

    def multiply_entries(self, values: Real) -> Real:
        """Return the entries of K v that are not zero; (n_entry, n_column).

        Args:
            values: sources; (m, n_column).
        """
        return self._filled @ values

    @cached_property
    def _filled_rows(self) -> Integers:
        """Rows of the matrix that are not zero."""
        return np.flatnonzero(np.diff(self.matrix.indptr))

    @cached_property
    def _filled(self) -> scipy.sparse.csr_array:
        """The matrix in these rows."""
        return self.matrix[self._filled_rows]

    def contract(self, cotangent: Real) -> Real:
        """Return sum_ij K_ij C_ij of every parameter.

        Args:
            cotangent: C; (n, m).

        Returns:
            (n_parameter,).
        """
        rows = np.repeat(np.arange(self.matrix.shape[0]), np.diff(self.matrix.indptr))
        products = self.matrix.data * cotangent[rows // self.count, self.matrix.indices]
        return np.bincount(rows % self.count, products, self.count).astype(np.float64)


def stack_slopes(
    terms: Sequence[tuple[Integers, SlopeTerm]],
    sizes: tuple[int, dict[str, int]],
    count: int | None,
) -> SlopeMatrix:
    """Return the matrices of several Parts as one; entries of one place add up.

    Args:
        terms: numbers of the parameters among the chosen, and their matrices.
        sizes: n of the target, and m of each source.
        count: number of chosen parameters, if the result has all of them; None for those that
            have an entry.
    """
    n_target, widths = sizes
    places: dict[SlopeSource, slice] = {}
    start = 0
    for _, term in terms:
        if term.source not in places:
            places[term.source] = slice(start, start + widths[term.source.name])
            start += widths[term.source.name]
    entries = [_entries(numbers, term, places[term.source].start) for numbers, term in terms]
    coordinates, parameters, columns, values = (
        np.concatenate([entry[k] for entry in entries]) if entries else np.zeros(0, kind)
        for k, kind in enumerate((np.intp, np.intp, np.intp, np.float64))
    )
    if count is None:
        indices, parameters = np.unique(parameters, return_inverse=True)
    else:
        indices = np.arange(count)
    rows = coordinates * len(indices) + parameters
    matrix = scipy.sparse.coo_array(
        (values, (rows, columns)), shape=(n_target * len(indices), start)
    ).tocsr()
    return SlopeMatrix(tuple(places.items()), as_slice(indices), len(indices), matrix)


def _entries(
    numbers: Integers, term: SlopeTerm, first_column: int
) -> tuple[Integers, Integers, Integers, Real]:
    """Return coordinates, parameters, columns and values of the entries that are not zero."""
    block = term.core
    rows, columns = np.arange(block.shape[1]), np.arange(block.shape[2])
    if term.left is not None:
        rows = np.flatnonzero(term.left.any(axis=1))
        block = term.left[rows] @ block
    if term.right is not None:
        columns = np.flatnonzero(term.right.any(axis=0))
        block = block @ term.right[:, columns]
    of_parameter, row, column = np.nonzero(block)
    values = block[of_parameter, row, column]
    return rows[row], numbers[of_parameter], first_column + columns[column], values


def as_slice(indices: Integers) -> Integers | slice:
    """Return evenly spaced indices as a slice, which is quicker to add to."""
    steps = np.unique(np.diff(indices))
    if len(steps) > 1 or (len(steps) and steps[0] < 1) or not len(indices):
        return indices
    step = int(steps[0]) if len(steps) else 1
    return slice(int(indices[0]), int(indices[-1]) + 1, step)


TermsByTarget = Mapping[Target, Sequence[tuple[Integers, SlopeTerm]]]


def collect_terms(
    solution: FrfSolution, slopes: Sequence[tuple[Change, ...]], chosen: Sequence[Mask], rates: Real
) -> TermsByTarget:
    """Return the terms of all parameters by target, each with the numbers of its parameters.

    Args:
        slopes: slopes of each Part.
        chosen: whether each parameter of a Part is chosen.
        rates: factor of each chosen parameter.
    """
    terms: dict[Target, list[tuple[Integers, SlopeTerm]]] = {"force": [], "load": []}
    start = 0
    for number, (mask, changes) in enumerate(zip(chosen, slopes, strict=True)):
        first, start = start, start + int(np.count_nonzero(mask))
        if not changes or first == start:
            continue
        indices = np.arange(first, start)
        for change in changes:
            core = change.core[mask] * rates[indices][:, None, None, None]
            for term in slope_terms(solution, number, change, core):
                terms.setdefault(term.target, []).append((indices, term))
    return terms


def move_loads_to_joints(terms: TermsByTarget, to_joints: Real) -> TermsByTarget:
    """Return terms whose loads on bodies are pseudo-forces on the joints.

    Args:
        terms: terms by target.
        to_joints: T'; (nv, 6 n_body).
    """
    loads = [(indices, act_on_joints(term, to_joints)) for indices, term in terms["load"]]
    return {**terms, "force": [*terms["force"], *loads], "load": []}


def stack_terms(
    solution: FrfSolution, terms: TermsByTarget, count: int
) -> dict[Target, SlopeMatrix]:
    """Return the matrix of each target that has entries.

    Args:
        terms: terms by target.
        count: number of chosen parameters: forces and loads have all of them.
    """
    n_joint, n_in = len(solution.motion), solution.values.shape[2]
    n_out, n_body = solution.ports.readout.shape
    targets: dict[Target, int] = {"force": n_joint, "motion": n_body, "readout": n_out}
    targets["load"] = n_body
    widths = {"joints": n_joint, "inputs": n_in, "floor": n_in}
    widths |= dict.fromkeys(("relative", "absolute", "body_loads"), n_body)
    matrices = {
        target: stack_slopes(
            of_target, (targets[target], widths), count if target in ("force", "load") else None
        )
        for target, of_target in terms.items()
    }
    return {target: slopes for target, slopes in matrices.items() if slopes.matrix.nnz}
