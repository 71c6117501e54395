"""Arrows of normal equations against the same matrices written out."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tuning.misfit.normal_equations import Arrow


@dataclass(frozen=True, eq=False)
class Case:
    """An arrow and its twin, made of the same Jacobian."""

    arrow: Arrow
    dense: np.ndarray
    random: np.random.Generator

    @property
    def size(self):
        return len(self.dense)


def case(seed, *, own=(3, 1, 4), shared=5, rows=9):
    """Blocks of different sizes whose coordinates are dealt at random; J'J of full rank."""
    random = np.random.default_rng(seed)
    n = shared + sum(own)
    deal = random.permutation(n)
    shared_at, rest = deal[:shared], deal[shared:]
    ends = np.cumsum([0, *own])
    at = np.full((len(own), max(own, default=0)), -1)
    whole = np.zeros((0, n))
    corner = np.zeros((shared, shared))
    blocks = np.zeros((len(own), at.shape[1], at.shape[1]))
    cross = np.zeros((len(own), at.shape[1], shared))
    for number, count in enumerate(own):
        places = rest[ends[number] : ends[number + 1]]
        at[number, :count] = places
        jacobian = np.zeros((rows, n))
        jacobian[:, places] = random.normal(size=(rows, count))
        jacobian[:, shared_at] = random.normal(size=(rows, shared)) * 10.0 ** random.uniform(-2, 2)
        blocks[number, :count, :count] = jacobian[:, places].T @ jacobian[:, places]
        cross[number, :count] = jacobian[:, places].T @ jacobian[:, shared_at]
        corner += jacobian[:, shared_at].T @ jacobian[:, shared_at]
        whole = np.vstack([whole, jacobian])
    beside = np.zeros((shared, n))
    beside[:, shared_at] = random.normal(size=(shared, shared))
    corner += beside[:, shared_at].T @ beside[:, shared_at]
    whole = np.vstack([whole, beside])
    return Case(Arrow(corner, cross, blocks, shared_at, at), whole.T @ whole, random)


SEEDS = given(st.integers(0, 2**32 - 1))
FORMS = pytest.mark.parametrize(
    ("own", "shared"), [((3, 1, 4), 5), ((2,), 1), ((), 4), ((6, 6), 3), ((2, 3), 0)]
)


@FORMS
def test_the_matrix_written_out_is_that_of_its_jacobian(own, shared):
    made = case(1, own=own, shared=shared)
    assert made.arrow.size == shared + sum(own)
    np.testing.assert_allclose(made.arrow.dense(), made.dense, rtol=1e-12, atol=1e-12)


@FORMS
def test_the_diagonal_is_that_of_the_matrix(own, shared):
    made = case(2, own=own, shared=shared)
    np.testing.assert_allclose(made.arrow.diagonal(), np.diag(made.dense), rtol=1e-12)


@FORMS
def test_times_a_vector_is_that_of_the_matrix(own, shared):
    made = case(3, own=own, shared=shared)
    x = made.random.normal(size=made.size)
    expected = made.dense @ x
    np.testing.assert_allclose(
        made.arrow.times(x), expected, rtol=0, atol=1e-12 * np.abs(made.dense).max()
    )


def test_sums_and_differences_are_those_of_the_matrices():
    one = case(4)
    two = Arrow(
        1.5 * one.arrow.shared + np.eye(5),
        -0.5 * one.arrow.cross,
        2.5 * one.arrow.own,
        one.arrow.shared_at,
        one.arrow.own_at,
    )
    first, second = one.arrow.dense(), two.dense()
    np.testing.assert_allclose((one.arrow + two).dense(), first + second, rtol=1e-13)
    np.testing.assert_allclose((one.arrow - two).dense(), first - second, rtol=1e-13)


def solved(dense, right, added, free):
    """The rows and columns that are free, solved alone."""
    x = np.zeros(len(right))
    matrix = dense + np.diag(added)
    x[free] = np.linalg.solve(matrix[np.ix_(free, free)], right[free])
    return x


@FORMS
def test_all_rows_free_solve_the_whole_matrix(own, shared):
    made = case(5, own=own, shared=shared)
    right = made.random.normal(size=made.size)
    added = made.random.uniform(0.1, 3.0, made.size)
    expected = solved(made.dense, right, added, np.ones(made.size, bool))
    found = made.arrow.solve(right, added)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


@settings(deadline=None, max_examples=60)
@SEEDS
def test_rows_that_are_held_stay_zero_and_the_rest_is_solved_without_them(seed):
    made = case(seed)
    right = made.random.normal(size=made.size)
    added = made.random.uniform(0.1, 3.0, made.size)
    free = made.random.random(made.size) < made.random.uniform(0, 1)
    expected = solved(made.dense, right, added, free)
    found = made.arrow.solve(right, added, free)
    assert not found[~free].any()
    np.testing.assert_allclose(
        found, expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max(initial=0.0)
    )


@pytest.mark.parametrize("held", ["all", "shared", "own", "one block"])
def test_whole_groups_may_be_held(held):
    made = case(6)
    arrow, free = made.arrow, np.ones(made.size, bool)
    own = arrow.own_at[arrow.own_at >= 0]
    block = arrow.own_at[2][arrow.own_at[2] >= 0]
    free[{"all": slice(None), "shared": arrow.shared_at, "own": own, "one block": block}[held]] = (
        False
    )
    right, added = made.random.normal(size=made.size), np.full(made.size, 0.5)
    expected = solved(made.dense, right, added, free)
    found = arrow.solve(right, added, free)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_coordinates_of_most_unlike_sizes_are_solved_as_well():
    # Stiffness in N/m beside rotations in rad: columns 1e9 apart, each solved to its own size.
    made = case(7)
    scale = 10.0 ** made.random.uniform(-4.5, 4.5, made.size)
    arrow, own = made.arrow, np.append(scale, 0.0)[made.arrow.own_at]
    shared = scale[arrow.shared_at]
    scaled = Arrow(
        arrow.shared * np.outer(shared, shared),
        arrow.cross * own[:, :, None] * shared,
        arrow.own * own[:, :, None] * own[:, None, :],
        arrow.shared_at,
        arrow.own_at,
    )
    right, added = made.random.normal(size=made.size), np.full(made.size, 0.3)
    expected = arrow.solve(right, added)
    found = scaled.solve(right * scale, added * scale**2)
    np.testing.assert_allclose(found * scale, expected, rtol=1e-8)


def test_a_matrix_that_is_not_positive_definite_is_an_error():
    arrow = case(8).arrow
    wrong = Arrow(arrow.shared, 5 * arrow.cross, arrow.own, arrow.shared_at, arrow.own_at)
    with pytest.raises(np.linalg.LinAlgError):
        wrong.solve(np.ones(arrow.size), np.full(arrow.size, 0.1))
