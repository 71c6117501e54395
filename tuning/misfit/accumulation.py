"""Weighted derivatives of many lines, run by run, and their sums over lines."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import Forward, Model
from tuning.misfit.body_projection import View
from tuning.misfit.normal_equations import Arrow
from tuning.misfit.partition import Shares
from tuning.parametrisation.parametrisation import Freedom

_CHUNK = 2**20  # numbers of the Jacobian that are held at once


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
class Freed:
    """What forces of free spectra take from the normal equations, each alone.

    Args:
        normal: from N; (n_force, n_x, n_x).
        gradient: from the gradient; (n_force, n_x).
        value: from J; (n_force,).
        chance: ln(1 + p |u|^2), what a force of any shape gains anyway; (n_force,).
    """

    normal: Real
    gradient: Real
    value: Real
    chance: Real

    @classmethod
    def nothing(cls, forces: int, size: int) -> "Freed":
        """To which to add."""
        return cls(
            np.zeros((forces, size, size)),
            np.zeros((forces, size)),
            np.zeros(forces),
            np.zeros(forces),
        )


@dataclass(frozen=True, eq=False)
class Own:
    """What a sensor's own coordinates move, its own rows alone.

    Args:
        view: number of its body's view.
        seen: what the view sees of it; (n_freq, n_in, 2, m, n_own).
        weighted: all of it; (n_freq, n_in, 2, n_row, n_own).
        aim: weighted residual of its rows; (n_freq, n_in, 2, n_row).
    """

    view: int
    seen: Real
    weighted: Real
    aim: Real


@dataclass(frozen=True, eq=False)
class Runs:
    """Sums over lines, run by run: the shared columns of all lines at once would fill memory.

    Args:
        plan: how coordinates divide.
        forward: derivatives by the shared parameters, times d theta / dx.
        views: what counts of the channels of each body.
        own: of each sensor.
    """

    plan: Shares
    forward: Forward
    views: tuple[View, ...]
    own: tuple[Own, ...] = ()

    @property
    def _numbers(self) -> int:
        """How many the shared columns have on one line."""
        n_in = self.views[0].aim.shape[1] if self.views else 1
        return max(2 * n_in * self._seen * self.forward.count, 1)

    @property
    def _seen(self) -> int:
        """How many numbers count, of all bodies."""
        return self.views[-1].at.stop if self.views else 0

    def sums(self, groups: Integers, threads: int) -> list[tuple[Real, ...]]:
        """S, its part of the gradient, C, O and their parts of it, for each group of lines.

        The same bits with any number of threads.
        """
        spans = list(_spans(groups, max(1, _CHUNK // self._numbers)))
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
        columns = self._columns(span)
        flat = _flat(columns)
        n_block, n_own = self.plan.own_at.shape
        cross = np.zeros((n_block, n_own, columns.shape[-1]))
        blocks, slopes = np.zeros((n_block, n_own, n_own)), np.zeros((n_block, n_own))
        of_views = [_flat(columns[..., view.at, :]) for view in self.views]
        for number, one in enumerate(self.own):
            part, count = _flat(one.weighted[span]), one.seen.shape[-1]
            cross[number, :count] = _flat(one.seen[span]).T @ of_views[one.view]
            blocks[number, :count, :count] = part.T @ part
            slopes[number, :count] = part.T @ one.aim[span].ravel()
        return flat.T @ flat, flat.T @ self._aim(span), cross, blocks, slopes

    def probe(self, more: "Runs", blocks: list[slice], found: Probed) -> None:
        """Add up what further columns, seen alike, have to do with these."""
        n_freq = len(self.forward.lines.values)
        step = max(1, _CHUNK // (self._numbers + more._numbers))  # of one kind
        for span in _spans(np.zeros(n_freq, int), step):
            columns, others = self._columns(span), more._columns(span)
            flat = _flat(others)
            found.slope[:] += flat.T @ self._aim(span)
            found.cross[self.plan.shared_at] += _flat(columns).T @ flat
            of_views = [_flat(others[..., view.at, :]) for view in self.views]
            for one, at in zip(self.own, self.plan.own_at, strict=True):
                found.cross[at[at >= 0]] += _flat(one.seen[span]).T @ of_views[one.view]
            for block in blocks:
                found.blocks[block, block] += flat[:, block].T @ flat[:, block]

    def freed(self, forces: Real, power: float, found: Freed) -> None:
        """Add up what forces of free spectra take.

        Args:
            forces: at the joints' coordinates; (nv, n_force).
            power: p |u|^2 of the median line.
            found: sums.
        """
        self.forward.prepare()
        n_freq = len(self.forward.lines.values)
        spans = list(_spans(np.zeros(n_freq, int), max(1, _CHUNK // self._numbers)))
        answers = [self._answers(forces, span) for span in spans]
        sizes = [(np.abs(answer) ** 2).sum(axis=2) for answer in answers]
        middle = np.median(np.concatenate(sizes), axis=(0, 1))
        variance = power / np.where(middle > 0, middle, 1.0)
        for span, answer, size in zip(spans, answers, sizes, strict=True):
            root = np.sqrt(variance / (1 + variance * size))
            shares = (root[:, :, None] * answer).conj().swapaxes(2, 3)
            columns = self._everything(span)
            aim = self._aim(span).reshape(*columns.shape[:2], 2, -1)
            taken = shares @ columns  # (n_line, n_in, n_force, n_x)
            pulled = (shares @ (aim[:, :, 0] + 1j * aim[:, :, 1])[..., None])[..., 0]
            n_line, n_in, n_force, size_x = taken.shape
            flat = taken.transpose(2, 0, 1, 3).reshape(n_force, n_line * n_in, size_x)
            parts = np.concatenate([flat.real, flat.imag], axis=1)
            own = pulled.transpose(2, 0, 1).reshape(len(found.value), -1)
            pull = np.concatenate([own.real, own.imag], axis=1)
            found.normal[:] += parts.swapaxes(1, 2) @ parts
            found.gradient[:] += (pull[:, None] @ parts)[:, 0]
            found.value[:] += 0.5 * (pull**2).sum(axis=1)
            found.chance[:] += np.log1p(variance * size).sum(axis=(0, 1))

    def _answers(self, forces: Real, span: slice) -> Complex:
        """Weighted answers to unit forces at the joints; (n_line, n_in, m, n_force)."""
        readers = self.forward.readers(span)
        bare = (readers[:, :, 0] @ forces + 1j * (readers[:, :, 1] @ forces))[:, None]
        return np.concatenate(
            [view.matrix[span] @ bare[:, :, view.rows] for view in self.views], axis=2
        )

    def _everything(self, span: slice) -> Complex:
        """Weighted columns of all coordinates; (n_line, n_in, m, n_x)."""
        columns = self._columns(span)
        plan = self.plan
        size = len(plan.shared_at) + int((plan.own_at >= 0).sum())
        found = np.zeros((*columns.shape[:2], columns.shape[3], size), complex)
        found[..., plan.shared_at] = columns[:, :, 0] + 1j * columns[:, :, 1]
        for one, at in zip(self.own, plan.own_at, strict=True):
            seen = one.seen[span]
            found[:, :, self.views[one.view].at, at[at >= 0]] = seen[:, :, 0] + 1j * seen[:, :, 1]
        return found

    def _aim(self, span: slice) -> Real:
        """What the shared columns aim at, flat as they are."""
        return np.concatenate([view.aim[span] for view in self.views], axis=-1).ravel()

    def _columns(self, span: slice) -> Real:
        """Weighted columns of the shared coordinates; (n_line, n_in, 2, m, n_s)."""
        forward = self.forward
        readers, pushes = forward.readers(span), forward.pushes(span)
        n_line, n_in, _, nv, count = pushes.shape
        bare = readers.reshape(n_line, 1, -1, 2 * nv)
        read = np.empty((n_line, n_in, 2, self._seen, 2, nv))
        for view in self.views:
            seen = (view.matrix[span] @ bare[:, :, view.rows]).reshape(n_line, n_in, -1, 2, nv)
            read[:, :, 0, view.at, 0] = read[:, :, 1, view.at, 1] = seen[..., 0, :]
            read[:, :, 1, view.at, 0] = seen[..., 1, :]
            np.negative(seen[..., 1, :], out=read[:, :, 0, view.at, 1])
        columns = (
            read.reshape(n_line, n_in, -1, 2 * nv) @ pushes.reshape(n_line, n_in, 2 * nv, count)
        ).reshape(n_line, n_in, 2, self._seen, count)
        for share in forward.moves(span):
            for view in self.views:
                frame = (view.matrix[span] @ view.frame)[:, :, None]
                columns[..., view.at, share.places] += frame @ share.values[..., view.body, :]
        for share in forward.read_off(span):
            for view in self.views:
                seen = view.matrix[span][:, :, None] @ share.values[..., view.rows, :]
                columns[..., view.at, share.places] += seen
        return columns if self.plan.joined is None else np.asarray(columns @ self.plan.joined)


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
