"""Arrows of normal equations against the same matrices written out."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tuning.misfit.normal_equations import ArrowMatrix, ArrowSolver


@dataclass(frozen=True, eq=False)
class Case:
    """An arrow and its twin, made of the same Jacobian."""

    arrow: ArrowMatrix
    dense: np.ndarray
    random: np.random.Generator

    @property
    def size(self):
        return len(self.dense)


def case(seed, *, block_sizes=(3, 1, 4), shared=5, rows=9):
    """Blocks of different sizes whose coordinates are dealt at random; J'J of full rank."""
    random = np.random.default_rng(seed)
    n = shared + sum(block_sizes)
    deal = random.permutation(n)
    shared_coordinates, rest = deal[:shared], deal[shared:]
    ends = np.cumsum([0, *block_sizes])
    at = np.full((len(block_sizes), max(block_sizes, default=0)), -1)
    whole = np.zeros((0, n))
    corner = np.zeros((shared, shared))
    blocks = np.zeros((len(block_sizes), at.shape[1], at.shape[1]))
    cross = np.zeros((len(block_sizes), at.shape[1], shared))
    for number, count in enumerate(block_sizes):
        places = rest[ends[number] : ends[number + 1]]
        at[number, :count] = places
        jacobian = np.zeros((rows, n))
        jacobian[:, places] = random.normal(size=(rows, count))
        jacobian[:, shared_coordinates] = random.normal(
            size=(rows, shared)
        ) * 10.0 ** random.uniform(-2, 2)
        blocks[number, :count, :count] = jacobian[:, places].T @ jacobian[:, places]
        cross[number, :count] = jacobian[:, places].T @ jacobian[:, shared_coordinates]
        corner += jacobian[:, shared_coordinates].T @ jacobian[:, shared_coordinates]
        whole = np.vstack([whole, jacobian])
    beside = np.zeros((shared, n))
    beside[:, shared_coordinates] = random.normal(size=(shared, shared))
    corner += beside[:, shared_coordinates].T @ beside[:, shared_coordinates]
    whole = np.vstack([whole, beside])
    return Case(ArrowMatrix(corner, cross, blocks, shared_coordinates, at), whole.T @ whole, random)


SEEDS = given(st.integers(0, 2**32 - 1))
FORMS = pytest.mark.parametrize(
    ("block_sizes", "shared"), [((3, 1, 4), 5), ((2,), 1), ((), 4), ((6, 6), 3), ((2, 3), 0)]
)


@FORMS
def test_the_matrix_written_out_is_that_of_its_jacobian(block_sizes, shared):
    system = case(1, block_sizes=block_sizes, shared=shared)
    assert system.arrow.size == shared + sum(block_sizes)
    np.testing.assert_allclose(system.arrow.dense(), system.dense, rtol=1e-12, atol=1e-12)


@FORMS
def test_the_diagonal_is_that_of_the_matrix(block_sizes, shared):
    system = case(2, block_sizes=block_sizes, shared=shared)
    np.testing.assert_allclose(system.arrow.diagonal(), np.diag(system.dense), rtol=1e-12)


@FORMS
def test_times_a_vector_is_that_of_the_matrix(block_sizes, shared):
    system = case(3, block_sizes=block_sizes, shared=shared)
    x = system.random.normal(size=system.size)
    expected = system.dense @ x
    np.testing.assert_allclose(
        system.arrow.multiply(x), expected, rtol=0, atol=1e-12 * np.abs(system.dense).max()
    )


def test_sums_and_differences_are_those_of_the_matrices():
    single = case(4)
    double = ArrowMatrix(
        1.5 * single.arrow.shared + np.eye(5),
        -0.5 * single.arrow.cross,
        2.5 * single.arrow.blocks,
        single.arrow.shared_coordinates,
        single.arrow.block_coordinates,
    )
    first, second = single.arrow.dense(), double.dense()
    np.testing.assert_allclose((single.arrow + double).dense(), first + second, rtol=1e-13)
    np.testing.assert_allclose((single.arrow - double).dense(), first - second, rtol=1e-13)


def solved(dense, right, added, free):
    """The rows and columns that are free, solved alone."""
    x = np.zeros(len(right))
    matrix = dense + np.diag(added)
    x[free] = np.linalg.solve(matrix[np.ix_(free, free)], right[free])
    return x


@FORMS
def test_all_rows_free_solve_the_whole_matrix(block_sizes, shared):
    system = case(5, block_sizes=block_sizes, shared=shared)
    right = system.random.normal(size=system.size)
    added = system.random.uniform(0.1, 3.0, system.size)
    expected = solved(system.dense, right, added, np.ones(system.size, bool))
    result = system.arrow.solve(right, added)
    np.testing.assert_allclose(result, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


@SEEDS
def test_rows_that_are_held_stay_zero_and_the_rest_is_solved_without_them(seed):
    system = case(seed)
    right = system.random.normal(size=system.size)
    added = system.random.uniform(0.1, 3.0, system.size)
    free = system.random.random(system.size) < system.random.uniform(0, 1)
    expected = solved(system.dense, right, added, free)
    result = system.arrow.solve(right, added, free)
    assert not result[~free].any()
    np.testing.assert_allclose(
        result, expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max(initial=0.0)
    )


@pytest.mark.parametrize("held", ["all", "shared", "own", "one block"])
def test_whole_groups_may_be_held(held):
    system = case(6)
    arrow, free = system.arrow, np.ones(system.size, bool)
    block_sizes = arrow.block_coordinates[arrow.block_coordinates >= 0]
    block = arrow.block_coordinates[2][arrow.block_coordinates[2] >= 0]
    free[
        {
            "all": slice(None),
            "shared": arrow.shared_coordinates,
            "own": block_sizes,
            "one block": block,
        }[held]
    ] = False
    right, added = system.random.normal(size=system.size), np.full(system.size, 0.5)
    expected = solved(system.dense, right, added, free)
    result = arrow.solve(right, added, free)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-12)


def test_coordinates_of_most_unlike_sizes_are_solved_as_well():
    # Stiffness in N/m beside rotations in rad: columns 1e9 apart, each solved to its own size.
    system = case(7)
    scale = 10.0 ** system.random.uniform(-4.5, 4.5, system.size)
    arrow, block_sizes = system.arrow, np.append(scale, 0.0)[system.arrow.block_coordinates]
    shared = scale[arrow.shared_coordinates]
    scaled = ArrowMatrix(
        arrow.shared * np.outer(shared, shared),
        arrow.cross * block_sizes[:, :, None] * shared,
        arrow.blocks * block_sizes[:, :, None] * block_sizes[:, None, :],
        arrow.shared_coordinates,
        arrow.block_coordinates,
    )
    right, added = system.random.normal(size=system.size), np.full(system.size, 0.3)
    expected = arrow.solve(right, added)
    result = scaled.solve(right * scale, added * scale**2)
    np.testing.assert_allclose(result * scale, expected, rtol=1e-8)


def test_a_matrix_that_is_not_positive_definite_is_an_error():
    arrow = case(8).arrow
    wrong = ArrowMatrix(
        arrow.shared,
        5 * arrow.cross,
        arrow.blocks,
        arrow.shared_coordinates,
        arrow.block_coordinates,
    )
    with pytest.raises(np.linalg.LinAlgError):
        wrong.solve(np.ones(arrow.size), np.full(arrow.size, 0.1))


def test_a_solver_of_several_sets_of_free_coordinates_equals_new_ones():
    system = case(5, block_sizes=(3, 2, 4, 1, 3, 3, 2, 3), shared=4)
    arrow, random = system.arrow, system.random
    added = random.uniform(0.1, 1.0, arrow.size)
    solver = ArrowSolver(arrow, added)
    free = np.ones(arrow.size, bool)
    for _ in range(12):
        right = random.standard_normal(arrow.size)
        whole = (system.dense + np.diag(added))[np.ix_(free, free)]
        expected = np.zeros(arrow.size)
        expected[free] = np.linalg.solve(whole, right[free])
        np.testing.assert_allclose(solver.solve(right, free), expected, rtol=1e-9, atol=1e-11)
        changed = random.integers(arrow.size, size=random.integers(1, 4))
        free[changed] = ~free[changed]
