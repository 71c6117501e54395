"""Which coordinates all channels share, and which belong to one sensor alone."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel import Change, Forward, Model
from tuning.parametrisation.parametrisation import Freedom


@dataclass(frozen=True, eq=False)
class Shares:
    """How the coordinates of a model divide.

    Args:
        shared: parameters whose columns are formed everywhere; (n_parameter,).
        shared_at: their coordinates in that order, without doubles; (n_s,).
        joined: which of them each shared parameter moves, None where each has its own;
            (n_shared_parameter, n_s).
        own: numbers of the Parts with coordinates of their own.
        own_at: those coordinates; (n_block, n_own), -1 where a block has fewer.
        of_sensors: parameters that belong to one sensor; (n_parameter,).
    """

    shared: Mask
    shared_at: Integers
    joined: Real | None
    own: tuple[int, ...]
    own_at: Integers
    of_sensors: Mask

    def gather(self, forward: Forward, span: slice) -> Complex:
        """Derivatives by the shared coordinates; (n_line, n_out, n_in, n_s).

        Args:
            forward: derivatives by the shared parameters, times d theta / dx.
            span: lines.
        """
        columns = forward.columns(span)
        return columns if self.joined is None else np.asarray(columns @ self.joined, complex)

    def own_columns(
        self, forward: Forward, rates: Real
    ) -> Iterator[tuple[Integers, Complex, Integers]]:
        """Derivatives by each sensor's own coordinates.

        Args:
            forward: derivatives by the parameters of sensors.
            rates: d theta / dx; (n_parameter,).

        Yields:
            Rows that it touches, (n_freq, n_row, n_in, n_own), and those coordinates.
        """
        model = forward.lines.model
        pieces = zip(model.pieces(rates), model.pieces(self.of_sensors), strict=True)
        rates_of = [rate[mask] for rate, mask in pieces]
        for part, at in zip(self.own, self.own_at, strict=True):
            rows, values = forward.rows(part)
            yield rows, values * rates_of[part], at[at >= 0]


def shares(model: Model, freedom: Freedom, *, apart: bool = True) -> Shares:
    """Sensors whose coordinates are all their own, if they touch their own rows alone.

    Args:
        model: machine and Parts.
        freedom: coordinates of the parameters.
        apart: whether rows count one by one; else sensors share those of their body.
    """
    slopes = model.slopes(model.drawn, None, freedom.free)
    frees, members = model.pieces(freedom.free), model.pieces(freedom.member)
    shared = freedom.free.copy()
    spans = np.cumsum([0, *(len(part.parameters) for part in model.parts)])
    own: list[int] = []
    at: list[Integers] = []
    for number, (changes, free, member) in enumerate(zip(slopes, frees, members, strict=True)):
        mine = member[free]
        alone = np.isin(freedom.member, mine).sum() == len(np.unique(mine)) == len(mine)
        if apart and len(mine) and alone and _is_plain(changes):
            own.append(number)
            at.append(mine)
            shared[spans[number] : spans[number + 1]] = False
    own_at = np.full((len(at), max((len(mine) for mine in at), default=0)), -1)
    for row, mine in zip(own_at, at, strict=True):
        row[: len(mine)] = mine
    moved = freedom.member[shared]
    shared_at = np.array(list(dict.fromkeys(moved.tolist())), np.intp)
    joined = (moved[:, None] == shared_at).astype(float)
    return Shares(
        shared,
        shared_at,
        None if len(joined) == len(shared_at) else joined,
        tuple(own),
        own_at,
        freedom.free & ~shared,
    )


def _is_plain(changes: tuple[Change, ...]) -> bool:
    """Whether these are rows of one sensor, the same at all lines."""
    if [change.slot for change in changes] != ["sensor"]:
        return False
    return changes[0].shape is None and not changes[0].core[:, 1:].any()
