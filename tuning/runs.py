"""Weighted derivatives of many lines, run by run, and their sums over lines."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import Forward, Model
from tuning.freedom import Freedom
from tuning.normal import Arrow
from tuning.reduction import Root
from tuning.shares import Shares

_CHUNK = 2**21  # numbers of the Jacobian that are held at once
_WIDE = 2**24  # the same of probes: many Parts of few columns, each with an overhead of its own


@dataclass(frozen=True, eq=False)
class Probed:
    """Normal equations, and how further coordinates bear on them.

    Args:
        gradient: of J, priors and all; (n_x,).
        normal: N of the data.
        cross: N between what varies and the probes; (n_x, n_probe).
        blocks: N of the probes, of each Part alone; (n_probe, n_probe).
        slope: gradient by the probes; (n_probe,).
    """

    gradient: Real
    normal: Arrow
    cross: Real
    blocks: Real
    slope: Real


@dataclass(frozen=True, eq=False)
class Runs:
    """Sums over lines, run by run: the shared columns of all lines at once would fill memory.

    Args:
        plan: how coordinates divide.
        forward: derivatives by all parameters that vary.
        rates: d theta / dx; (n_parameter,).
        root: square root of the weights; (n_freq, n_out, n_in).
        aim: weighted residual; (n_out, 2, n_freq, n_in).
        own: rows of each sensor, and its weighted columns.
        mixing: roots of the weights of bodies, if these count.
    """

    plan: Shares
    forward: Forward
    rates: Real
    root: Real
    aim: Real
    own: list[tuple[slice | Integers, Real]]
    mixing: tuple[Root, ...]

    def sums(self, groups: Integers, threads: int) -> list[tuple[Real, ...]]:
        """S, its part of the gradient, C, O and their parts of it, for each group of lines.

        The same bits with any number of threads.
        """
        _, n_out, n_in = self.root.shape
        step = max(1, _CHUNK // max(2 * n_out * n_in * int(self.plan.shared.sum()), 1))
        spans = list(_spans(groups, step))
        found: dict[int, tuple[Real, ...]] = {}
        self.forward.prepare()
        with ThreadPoolExecutor(threads) as pool:
            for span, parts in zip(spans, pool.map(self._sum, spans), strict=True):
                sums = found.setdefault(int(groups[span.start]), parts)
                if sums is not parts:
                    for total, part in zip(sums, parts, strict=True):
                        np.add(total, part, out=total)
        return [found[group] for group in range(int(groups.max()) + 1)]

    def _sum(self, span: slice) -> tuple[Real, ...]:
        columns, aim = self._columns(span), self.aim[:, :, span]
        flat = _flat(columns)
        n_block, n_own = self.plan.own_at.shape
        cross = np.zeros((n_block, n_own, columns.shape[-1]))
        blocks, slopes = np.zeros((n_block, n_own, n_own)), np.zeros((n_block, n_own))
        for number, (rows, mine) in enumerate(self.own):
            part, count = _flat(mine[:, :, span]), mine.shape[-1]
            cross[number, :count] = part.T @ _flat(columns[rows])
            blocks[number, :count, :count] = part.T @ part
            slopes[number, :count] = part.T @ aim[rows].ravel()
        return flat.T @ flat, flat.T @ aim.ravel(), cross, blocks, slopes

    def probe(self, more: "Runs", blocks: list[slice], found: Probed) -> None:
        """Add up what further columns have to do with these."""
        n_freq, n_out, n_in = self.root.shape
        count = len(more.plan.shared_at) + len(self.plan.shared_at)
        step = max(1, _WIDE // max(2 * n_out * n_in * count, 1))
        for span in _spans(np.zeros(n_freq, int), step):
            columns, others, aim = self._columns(span), more._rows(span), self.aim[:, :, span]
            flat = others.reshape(len(others), -1)
            found.slope[:] += flat @ aim.ravel()
            found.cross[self.plan.shared_at] += _flat(columns).T @ flat.T
            for (rows, mine), at in zip(self.own, self.plan.own_at, strict=True):
                part = _flat(mine[:, :, span])
                found.cross[at[at >= 0]] += part.T @ others[:, rows].reshape(len(others), -1).T
            for block in blocks:
                found.blocks[block, block] += flat[block] @ flat[block].T

    def _rows(self, span: slice) -> Real:
        """Weighted columns one by one, (n_s, n_out, 2, n_line, n_in): quicker where Parts are many.

        Each must have coordinates of its own.
        """
        root = self.root[span].transpose(1, 0, 2)
        rates = self.rates[np.flatnonzero(self.plan.shared)]
        n_out, n_line, n_in = root.shape
        rows = np.zeros((len(rates), n_out, 2, n_line, n_in))
        for places, block in self.forward.blocks(self.plan.parts, span):
            scale = root * rates[places, None, None, None]
            values = block.transpose(3, 1, 0, 2)
            np.multiply(values.real, scale, out=rows[places, :, 0])
            np.multiply(values.imag, scale, out=rows[places, :, 1])
        return rows

    def _columns(self, span: slice) -> Real:
        """Weighted columns of the shared coordinates; (n_out, 2, n_line, n_in, n_s)."""
        plan, root = self.plan, self.root[span].transpose(1, 0, 2)[..., None]
        chosen = np.flatnonzero(plan.shared)
        n_out, n_line, n_in, _ = root.shape
        columns = np.zeros((n_out, 2, n_line, n_in, len(chosen)))
        for places, block in self.forward.blocks(plan.parts, span):
            scale = root * self.rates[chosen[places]]
            values = block.transpose(1, 0, 2, 3)
            np.multiply(values.real, scale, out=columns[:, 0, ..., places])
            np.multiply(values.imag, scale, out=columns[:, 1, ..., places])
        for one in self.mixing:
            columns[one.rows] = np.einsum(
                "ftij,jpfts->ipfts", one.root[span], columns[one.rows], optimize=True
            )
        return columns if plan.joined is None else np.asarray(columns @ plan.joined)


def blocks_of(model: Model, probes: Freedom) -> list[slice]:
    """Coordinates of each Part among the probes."""
    counts = [int(mask.sum()) for mask in model.pieces(probes.free)]
    ends = np.cumsum([0, *(count for count in counts if count)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _spans(groups: Integers, most: int) -> Iterator[slice]:
    """Runs of lines of one group, of so many lines at most."""
    ends = [0, *(np.flatnonzero(np.diff(groups)) + 1), len(groups)]
    for first, last in pairwise(ends):
        for start in range(int(first), int(last), most):
            yield slice(start, min(start + most, int(last)))


def _flat(columns: Real) -> Real:
    """(.., n) to (rows, n)."""
    return columns.reshape(int(np.prod(columns.shape[:-1])), columns.shape[-1])


def split(values: Complex) -> Real:
    """(n_freq, n_out, ...) to real and imaginary parts (n_out, 2, n_freq, ...)."""
    parts = np.stack([values.real, values.imag])
    return np.moveaxis(parts, 2, 0)


def run_of(rows: Integers) -> "slice | Integers":
    """A slice for rows that follow each other: nothing is copied then."""
    if len(rows) and np.array_equal(rows, np.arange(rows[0], rows[0] + len(rows))):
        return slice(int(rows[0]), int(rows[0]) + len(rows))
    return rows
