r"""What counts of the channels of one body: never more numbers than a body has motions.

What moves bodies moves the channels of one body by L q, L known and q six numbers, whatever else
varies. With weights W = V^1/2 in a full matrix or one by one, and W L = Q R,

    (W L q)' (W L p) = (Q' W L q)' (Q' W L p),    (W L q)' W r = (Q' W L q)' Q' W r,

so that Q' W, at most six rows for each line and input, counts as all channels do: nothing is lost,
and a body of twelve channels costs half. Only where sensors themselves change in a way that all
share do all channels count one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from tuning.misfit.reduction import Root

_MOTIONS = 6


@dataclass(frozen=True, eq=False)
class View:
    """The channels of one body.

    Args:
        rows: of the channels; (n_row,).
        at: where it stands among all views' numbers; m of them.
        matrix: Q' W, or W; (n_freq, n_in, m, n_row).
        body: which columns of L are not zero: the body's.
        frame: L there; (n_row, 6).
        aim: Q' times the weighted residual; (n_freq, n_in, 2, m).
    """

    rows: Integers
    at: slice
    matrix: Real
    body: slice
    frame: Real
    aim: Real


def views(
    readout: Real, root: Real, aim: Complex, mixing: Sequence[Root], *, whole: bool
) -> tuple[View, ...]:
    """The channels of each body.

    Args:
        readout: L; (n_out, 6 n_body).
        root: weights of channels one by one; (n_freq, n_out, n_in).
        aim: weighted residual, the same shape.
        mixing: what weighs channels of a body together beside ``root``.
        whole: whether all channels count, one by one.
    """
    blocks: Mask = np.any(readout.reshape(len(readout), -1, _MOTIONS), axis=2)
    body_of = np.where(blocks.any(axis=1), blocks.argmax(axis=1), -1)
    found: list[View] = []
    start = 0
    for body in np.unique(body_of):
        rows = np.flatnonzero(body_of == body)
        span = slice(_MOTIONS * max(body, 0), _MOTIONS * max(body, 0) + _MOTIONS)
        frame, matrix = readout[rows, span], _weights(rows, root, mixing)
        aims = aim[:, rows].transpose(0, 2, 1)
        if len(rows) > _MOTIONS and not whole:
            across = np.linalg.qr(matrix @ frame)[0].swapaxes(2, 3)
            matrix, aims = across @ matrix, (across @ aims[..., None])[..., 0]
        end = start + matrix.shape[2]
        parts = np.stack([aims.real, aims.imag], axis=2)
        found.append(View(rows, slice(start, end), matrix, span, frame, parts))
        start = end
    return tuple(found)


def _weights(rows: Integers, root: Real, mixing: Sequence[Root]) -> Real:
    """W of some channels; (n_freq, n_in, n_row, n_row)."""
    own = root[:, rows].transpose(0, 2, 1)
    matrix: Real = own[..., None] * np.eye(len(rows))
    for one in mixing:
        here = np.isin(rows, one.rows)
        if here.any():
            chosen = np.ix_(here, here)
            matrix[:, :, chosen[0], chosen[1]] = one.root @ matrix[:, :, chosen[0], chosen[1]]
    return matrix
