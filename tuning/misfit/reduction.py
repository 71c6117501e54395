"""Weights at the centres of mass: what counts of a residual once channels are reduced to bodies.

A body's channels y give the motion of its centre of mass as x = R y (seed, eq. 2.5), known but for
the covariance R V R' with V the variances of y. The misfit of the 36 x 3 is then that of the
channels, weighted by a full matrix for each body,

    (R r)^H (R V R')^-1 (R r) = r^H M r,    M = R' (R V R')^-1 R,

of the rank of R: what channels say against each other about a solid body does not count.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import body_inverse
from identification.words import Complex, Dof, Integers, Layout, Mask, Real

_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Mixing:
    """Weights of one body's channels.

    Args:
        rows: of the channels; (n_row,).
        weight: M; (n_freq, n_test, n_row, n_row).
        values: how many numbers count: degrees of freedom, lines and tests together.
    """

    rows: Integers
    weight: Real
    values: int


def mixings(
    layout: Layout, outputs: Sequence[Dof], variance: Real, counts: Mask
) -> tuple[Mixing, ...]:
    """M of each body whose channels determine at least one of its six degrees of freedom.

    Args:
        layout: bodies and points.
        outputs: labels of the channels.
        variance: V, with what the model may be off; (n_freq, n_out, n_test).
        counts: which values do; a line of a body counts if all its live channels do; same shape.
    """
    rows = layout.rows(tuple(outputs))
    found = []
    for body in range(len(layout.bodies)):
        block = rows[:, 6 * body : 6 * body + 6]
        here = np.flatnonzero(block.any(axis=1))
        n_freq, _, n_test = variance.shape
        weight = np.zeros((n_freq, n_test, len(here), len(here)))
        values = 0
        for test in range(n_test):
            live = counts[:, here, test].any(axis=0)
            inverse, known = body_inverse(block[here[live]])
            if not known.any():
                continue
            inverse = inverse[known]
            lines = counts[:, here[live], test].all(axis=1)
            spread = variance[lines][:, here[live], test]
            covariance = np.einsum("in,fn,jn->fij", inverse, spread, inverse)
            scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
            scaled = covariance / (scale[:, :, None] * scale[:, None, :])
            half = np.linalg.solve(scaled, inverse / scale[:, :, None])
            whole = np.einsum("fin,fim->fnm", inverse / scale[:, :, None], half)
            places = np.flatnonzero(live)
            part = np.zeros((len(whole), len(here), len(here)))
            part[:, places[:, None], places] = whole
            weight[lines, test] = part
            values += int(lines.sum()) * int(known.sum())
        if values:
            found.append(Mixing(here, weight, values))
    return tuple(found)


def weighed(mixed: Sequence[Mixing], residual: Complex) -> Complex:
    """M r; (n_freq, n_out, n_test)."""
    found = np.zeros_like(residual)
    for one in mixed:
        found[:, one.rows] = np.einsum("ftij,fjt->fit", one.weight, residual[:, one.rows])
    return found


@dataclass(frozen=True, eq=False)
class Root:
    """The symmetric square root of 2 M, summed over the tests of an input, and its inverse.

    Args:
        rows: of the channels; (n_row,).
        root: (n_freq, n_in, n_row, n_row).
        inverse: the same shape; zero where M is.
    """

    rows: Integers
    root: Real
    inverse: Real


def roots(mixed: Sequence[Mixing], columns: Integers, n_in: int) -> tuple[Root, ...]:
    """Roots by which derivatives are weighted.

    Args:
        mixed: weights of each body.
        columns: number of the input of each test; (n_test,).
        n_in: how many inputs there are.
    """
    found = []
    for one in mixed:
        n_freq, _, n_row, _ = one.weight.shape
        summed = np.zeros((n_freq, n_in, n_row, n_row))
        for test, column in enumerate(columns):
            summed[:, column] += 2 * one.weight[:, test]
        values, vectors = np.linalg.eigh(summed)
        kept = values > _RANK * values[..., -1:]
        sizes = np.sqrt(np.where(kept, values, 0.0))
        flipped = vectors.swapaxes(2, 3)
        root = (vectors * sizes[..., None, :]) @ flipped
        inverse = (vectors * np.where(kept, 1 / np.where(kept, sizes, 1.0), 0.0)[..., None, :]) @ (
            flipped
        )
        found.append(Root(one.rows, root, inverse))
    return tuple(found)
