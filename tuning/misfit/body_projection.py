"""Projection of a body's weighted channels onto its six motions, without loss.

Motion of bodies changes the channels of one body by L q, with L known and q six numbers for each
line and input. With W the square root of the weights, diagonal or a full matrix, and the QR
factorisation W L = Q R,

    (W L q)' (W L p) = (Q' W L q)' (Q' W L p),    (W L q)' W r = (Q' W L q)' Q' W r.

The at most six rows of Q' W thus give all products that the normal equations need, and a body with
twelve channels costs half. All channels are kept only where shared coordinates change the sensors
themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from tuning.misfit.reduction import BodyWeightRoot

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
