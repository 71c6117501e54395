"""Weights at the centres of mass: the misfit of channels once they are reduced to bodies.

The channels y of a body give the motion of its centre of mass, x = R y (seed, eq. 2.5), with the
covariance R V R', V the diagonal of the variances of y. The weighted misfit of the body's motion
is a quadratic form of the channels' residual r with a full matrix for each body,

    (R r)^H (R V R')^-1 (R r) = r^H M r,    M = R' (R V R')^-1 R.

M has the rank of R: contradictions between the channels of a solid body do not count.

Projection of a body's weighted channels onto its six motions, without loss.

Motion of bodies changes the channels of one body by L q, with L known and q six numbers for each
line and input. With W the square root of the weights, diagonal or a full matrix, and the QR
factorisation W L = Q R,

    (W L q)' (W L p) = (Q' W L q)' (Q' W L p),    (W L q)' W r = (Q' W L q)' Q' W r.

The at most six rows of Q' W thus give all products that the normal equations need, and a body with
twelve channels costs half. All channels are kept only where shared coordinates change the sensors
themselves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identification import body_inverse
from identification.words import Complex, Integers, Layout, Mask, Output, Real

# Eigenvalues of a weight below this part of the largest one count as zero.
_WEIGHT_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class BodyWeight:
    """Weight matrix of one body's channels.

    Args:
        rows: rows of the channels; (n_row,).
        weight: M; (n_freq, n_test, n_row, n_row).
        values: number of values that count: degrees of freedom, lines and tests together.
    """

    rows: Integers
    weight: Real
    values: int


def body_weights(
    layout: Layout, outputs: Sequence[Output], variance: Real, counts: Mask
) -> tuple[BodyWeight, ...]:
    """Return M of each body whose channels determine at least one of its six degrees of freedom.

    Args:
        outputs: labels of the channels; n_out.
        variance: V, including the model-error floor; (n_freq, n_out, n_test).
        counts: whether each value counts; (n_freq, n_out, n_test). A line of a body counts if all
            its live channels count.
    """
    rows = layout.rows(tuple(outputs))
    weights = []
    for block in _motions_of_channels(rows):
        channels = np.flatnonzero(block.any(axis=1))
        n_freq, _, n_test = variance.shape
        weight = np.zeros((n_freq, n_test, len(channels), len(channels)))
        n_values = 0
        for test in range(n_test):
            live = counts[:, channels, test].any(axis=0)
            inverse, is_determined = body_inverse(block[channels[live]])
            if not is_determined.any():
                continue
            inverse = inverse[is_determined]
            lines = counts[:, channels[live], test].all(axis=1)
            spread = variance[lines][:, channels[live], test]
            covariance = np.einsum("in,fn,jn->fij", inverse, spread, inverse)
            scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
            scaled = covariance / (scale[:, :, None] * scale[:, None, :])
            half = np.linalg.solve(scaled, inverse / scale[:, :, None])
            live_weight = np.einsum("fin,fim->fnm", inverse / scale[:, :, None], half)
            live_channels = np.flatnonzero(live)
            padded = np.zeros((len(live_weight), len(channels), len(channels)))
            padded[:, live_channels[:, None], live_channels] = live_weight
            weight[lines, test] = padded
            n_values += int(lines.sum()) * int(is_determined.sum())
        if n_values:
            weights.append(BodyWeight(channels, weight, n_values))
    return tuple(weights)


def _motions_of_channels(rows: Real) -> Iterator[Real]:
    """Yield the rows of the channels on each body, then of each channel on none; (n_out, 6).

    A channel that reads no single body, such as an encoder, counts as one motion of its own.

    Args:
        rows: of all channels; (n_out, 6 n_body).
    """
    yield from np.split(rows, rows.shape[1] // 6, axis=1)
    for channel in np.flatnonzero(~rows.any(axis=1)):
        block = np.zeros((len(rows), 6))
        block[channel, 0] = 1.0
        yield block


def apply_body_weights(weights: Sequence[BodyWeight], residual: Complex) -> Complex:
    """Return M r; (n_freq, n_out, n_test).

    Args:
        residual: r; (n_freq, n_out, n_test).
    """
    product = np.zeros_like(residual)
    for body in weights:
        product[:, body.rows] = np.einsum("ftij,fjt->fit", body.weight, residual[:, body.rows])
    return product


@dataclass(frozen=True, eq=False)
class BodyWeightRoot:
    """Symmetric square root of 2 M, summed over the tests of an input, and its pseudo-inverse.

    Args:
        rows: rows of the channels; (n_row,).
        root: square root; (n_freq, n_in, n_row, n_row).
        inverse: pseudo-inverse, zero where M is; (n_freq, n_in, n_row, n_row).
    """

    rows: Integers
    root: Real
    inverse: Real


def body_weight_roots(
    weights: Sequence[BodyWeight], columns: Integers, n_in: int, factor: Complex | None = None
) -> tuple[BodyWeightRoot, ...]:
    """Return the square roots by which derivatives are weighted.

    With factors c of the readings the weight is Re diag(conj c) M diag(c). It contains the range
    of the complex one, so that gradients stay exact; the normal equations lose a term of the
    order of the difference in phase between a body's channels.

    Args:
        columns: index of each test's input; (n_test,).
        n_in: number of inputs.
        factor: c, None where all are one; (n_freq, n_out).
    """
    roots = []
    for body in weights:
        n_freq, _, n_row, _ = body.weight.shape
        summed = np.zeros((n_freq, n_in, n_row, n_row))
        for test, column in enumerate(columns):
            summed[:, column] += 2 * body.weight[:, test]
        if factor is not None:
            of_rows = factor[:, body.rows]
            summed *= (of_rows.conj()[:, :, None] * of_rows[:, None]).real[:, None]
        values, vectors = np.linalg.eigh(summed)
        kept = values > _WEIGHT_RANK * values[..., -1:]
        sizes = np.sqrt(np.where(kept, values, 0.0))
        flipped = vectors.swapaxes(2, 3)
        root = (vectors * sizes[..., None, :]) @ flipped
        inverse = (vectors * np.where(kept, 1 / np.where(kept, sizes, 1.0), 0.0)[..., None, :]) @ (
            flipped
        )
        roots.append(BodyWeightRoot(body.rows, root, inverse))
    return tuple(roots)


N_MOTIONS = 6  # translations and rotations of a body


@dataclass(frozen=True, eq=False)
class BodyProjection:
    """Projection of the channels of one body.

    Args:
        rows: rows of the channels; (n_row,).
        span: position of its m values among those of all projections.
        matrix: Q' W, or W if all channels are kept; (n_freq, n_in, m, n_row).
        body_columns: columns of L that belong to the body; all for channels on no single body.
        rigid_motion: L in these columns; (n_row, 6 or 6 n_body).
        target: Q' times the weighted residual; (n_freq, n_in, 2, m).
    """

    rows: Integers
    span: slice
    matrix: Real
    body_columns: slice
    rigid_motion: Real
    target: Real


def body_projections(
    readout: Real,
    root: Real,
    target: Complex,
    body_roots: Sequence[BodyWeightRoot],
    *,
    together: Sequence[Integers] = (),
    all_channels: bool,
) -> tuple[BodyProjection, ...]:
    """Return the projection of the channels of each body.

    Args:
        readout: L; (n_out, 6 n_body).
        root: square roots of the weights of single channels; (n_freq, n_out, n_in).
        target: weighted residual; (n_freq, n_out, n_in).
        body_roots: weights that a body's channels have together, besides ``root``.
        together: rows of each sensor with parameters, which no body may divide: the channels of a
            bending body are its own where a mode has a zero, and else move with the mode too.
        all_channels: whether all channels are kept.
    """
    blocks: Mask = np.any(readout.reshape(len(readout), -1, N_MOTIONS), axis=2)
    is_on_one_body = blocks.sum(axis=1) == 1
    body_of = np.where(is_on_one_body, blocks.argmax(axis=1), -1)
    for sensor in together:
        if len(np.unique(body_of[sensor])) > 1:
            body_of[sensor] = -1
    projections: list[BodyProjection] = []
    start = 0
    for body in np.unique(body_of):
        rows = np.flatnonzero(body_of == body)
        columns = slice(N_MOTIONS * body, N_MOTIONS * body + N_MOTIONS)
        if body < 0:  # encoders, differences of two bodies; sensors of a body that bends
            columns = slice(0, readout.shape[1])
        rigid_motion, matrix = readout[rows, columns], _weights(rows, root, body_roots)
        targets = target[:, rows].transpose(0, 2, 1)
        if len(rows) > N_MOTIONS and body >= 0 and not all_channels:
            basis = np.linalg.qr(matrix @ rigid_motion)[0].swapaxes(2, 3)
            matrix, targets = basis @ matrix, (basis @ targets[..., None])[..., 0]
        end = start + matrix.shape[2]
        parts = np.stack([targets.real, targets.imag], axis=2)
        projections.append(
            BodyProjection(rows, slice(start, end), matrix, columns, rigid_motion, parts)
        )
        start = end
    return tuple(projections)


def _weights(rows: Integers, root: Real, body_roots: Sequence[BodyWeightRoot]) -> Real:
    """Return W of some channels; (n_freq, n_in, n_row, n_row)."""
    diagonal = root[:, rows].transpose(0, 2, 1)
    matrix: Real = diagonal[..., None] * np.eye(len(rows))
    for body in body_roots:
        is_weighted = np.isin(rows, body.rows)
        if is_weighted.any():
            block = np.ix_(is_weighted, is_weighted)
            matrix[:, :, block[0], block[1]] = body.root @ matrix[:, :, block[0], block[1]]
    return matrix
