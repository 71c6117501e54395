r"""Derivatives of every FRF by every parameter, on any run of lines.

Each slot's share of dH (see ``derivatives`` for the whole) is a short sum of products

    dH_p = sum_k s^k A(s) core_pk B(s),   A read by the outputs, B felt from the inputs,

with r columns in A and t rows in B, the rank of the Part. So the small products core B of all
parameters of a Part stand side by side, and one product with A per line gives all of them. With x
the motion of the joints, y = Z^-T T' L' the readers, b = T x the motion of the bodies relative to
the floor, a = b + U s^(q - 2) their absolute one:

    joint    A = -y' left                    B = right' x
    body     A = -y' T' left                 B = right' b, right' a for masses
    path     A = (L - y' T' Zb) left         B = right' x,    and
             A = y' right (with core')       B = left' (P s^q - Zb b or Mb a)
    hammer   A = y' T' right (core')         B = left' (directions of the inputs) s^q
    sensor   A = directions of the outputs   B = right' a

Gravity's stiffness adds y' dK x of full rank where bodies or joints change.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel.gravity import gravity_slope
from mbmodel.modal import real_times
from mbmodel.model import shaped_core
from mbmodel.parts import Change
from mbmodel.places import selection
from mbmodel.solved import Solved

Slopes = Sequence[tuple[Change, ...]]
_Term = tuple[
    Complex, Real, Complex
]  # A (n_line, n_out, r), core (p, 3, r, t), B (n_line, t, n_in)

_MASS = 2  # the power of s of masses


class Forward:
    """Derivatives of the FRFs of one linearised model.

    Args:
        lines: the model linearised at theta.
        slopes: of every Part that has parameters among the chosen.
        chosen: parameters asked for; (n_parameter,).
    """

    def __init__(self, lines: Solved, slopes: Slopes, chosen: Mask) -> None:
        self.lines = lines
        self._chosen = lines.model.pieces(chosen)
        self._slopes = slopes

    @cached_property
    def _readers(self) -> Complex:
        """The y of every output; (nv, n_out, n_freq)."""
        return self.lines.solver.solve(self.lines.readout.T[:, :, None], transposed=True)

    @cached_property
    def _relative(self) -> Complex:
        """T x, what springs between bodies feel; (6 n_body, n_in, n_freq)."""
        return real_times(self.lines.assembly.jacobian, self.lines.motion)

    @cached_property
    def _absolute(self) -> Complex:
        """T x + U s^(q - 2), what masses and sensors feel; (6 n_body, n_in, n_freq)."""
        lines = self.lines
        if not lines.places.has_floor:
            return self._relative
        return self._relative + lines.places.floor[:, :, None] * lines.carrying

    def _felt(self, power: int) -> Complex:
        return self._absolute if power == _MASS else self._relative

    @cached_property
    def _pressed(self) -> Complex:
        """P s^q - Zb (..), what the joints carry of each body; (6 n_body, n_in, n_freq)."""
        lines = self.lines
        total: Complex = lines.places.force[:, :, None] * lines.question.factor
        for power in np.flatnonzero(lines.assembly.body.any(axis=(1, 2))):
            pressed = real_times(lines.assembly.body[power], self._felt(int(power)))
            total -= pressed * lines.question.laplace**power
        for change in self._shaped_bodies:
            felt = real_times(change.right.T, self._relative).transpose(2, 0, 1)
            pressed = shaped_core(change, lines.question.laplace) @ felt
            total -= real_times(change.left, pressed.transpose(1, 2, 0))
        return total

    @cached_property
    def _shaped_bodies(self) -> list[Change]:
        """What depends on frequency in its own way at bodies."""
        shaped = self.lines.assembly.shaped
        return [term.change for term in shaped if term.change.slot == "body"]

    def _read(self, frame: Real, span: slice) -> Complex:
        """(L - y' T' Zb) frame, how outputs read what moves the bodies; (n_line, n_out, r)."""
        lines = self.lines
        laplace = lines.question.laplace[span, None, None]
        constant = lines.places.readout @ frame
        total: Complex = np.tile(constant.astype(complex), (len(laplace), 1, 1))
        for power in np.flatnonzero(lines.assembly.body.any(axis=(1, 2))):
            pressed = lines.assembly.jacobian.T @ (lines.assembly.body[power] @ frame)
            total -= laplace**power * _reading(pressed, self._readers, span)
        for change in self._shaped_bodies:
            core = shaped_core(change, lines.question.laplace[span])
            pushed = lines.assembly.jacobian.T @ change.left
            total -= _reading(pushed, self._readers, span) @ core @ (change.right.T @ frame)
        return total

    def prepare(self) -> None:
        """Compute what all lines share, so that runs of lines can be asked for by threads."""
        _ = self._readers, self._absolute, self._pressed

    def columns(self, span: slice = slice(None)) -> Complex:
        """Derivatives by the chosen parameters; (n_line, n_out, n_in, n_chosen)."""
        shape = (len(self.lines.question.laplace[span]), *self.lines.values.shape[1:])
        total = np.zeros((*shape, sum(int(mask.sum()) for mask in self._chosen)), complex)
        for places, block in self.blocks(range(len(self._chosen)), span):
            total[..., places] = block
        return total

    def blocks(self, parts: Iterable[int], span: slice) -> Iterator[tuple[slice, Complex]]:
        """The same for some Parts, one by one.

        Args:
            parts: their numbers.
            span: lines.

        Yields:
            Places among the chosen parameters of these Parts, and (n_line, n_out, n_in, n_own).
        """
        laplace = self.lines.question.laplace[span]
        start = 0
        for part in parts:
            mask, changes = self._chosen[part], self._slopes[part]
            end = start + int(mask.sum())
            total: Complex | None = None
            for change in changes:
                for reader, core, felt in self._terms(change, mask, span):
                    product = _product(reader, core, felt, laplace)
                    if change.shape is not None:
                        product *= change.shape(laplace)[:, None, None, None]
                    total = product if total is None else total + product
            if total is not None:
                yield slice(start, end), total
            start = end

    def rows(self, part: int) -> tuple[Integers, Complex]:
        """Which outputs a sensor's Part touches, and the derivatives of these alone.

        Returns:
            Numbers of the outputs (n_row,), and (n_freq, n_row, n_in, n_own).
        """
        (change,), mask = self._slopes[part], self._chosen[part]
        directions = selection(self.lines.question.outputs, change.point)
        places = np.flatnonzero(directions.any(axis=1))
        left = directions[places] @ change.left @ change.core[mask, 0]
        felt = _feeling(change.right, self._absolute, slice(None))
        return places, _side_by_side(left, felt)

    def _terms(self, change: Change, mask: Mask, span: slice) -> Iterator[_Term]:
        """All products of one slope."""
        lines, core = self.lines, change.core[mask]
        jacobian = lines.assembly.jacobian
        flipped = core.swapaxes(2, 3)
        if change.slot == "joint":
            reader = _reading(-change.left, self._readers, span)
            yield reader, core, _feeling(change.right, lines.motion, span)
        elif change.slot == "body":
            reader = _reading(-jacobian.T @ change.left, self._readers, span)
            yield reader, core, _feeling(change.right, self._relative, span)
            if lines.places.has_floor and core[:, _MASS].any():
                carried = self._absolute - self._relative
                mass = core * (np.arange(3) == _MASS)[:, None, None]
                yield reader, mass, _feeling(change.right, carried, span)
            yield from self._weight(change, core, span)
        elif change.slot == "path":
            reader = self._read(change.left, span)
            yield reader, core, _feeling(change.right, lines.motion, span)
            reader = _reading(change.right, self._readers, span)
            yield reader, flipped, _feeling(change.left, self._pressed, span)
            yield from self._weight(change, core, span)
        elif change.slot == "hammer":
            pushed = (selection(lines.question.inputs, change.point) @ change.left).T
            felt = lines.question.factor[span, None, None] * pushed
            yield _reading(jacobian.T @ change.right, self._readers, span), flipped, felt
        else:
            read = selection(lines.question.outputs, change.point) @ change.left
            felt = _feeling(change.right, self._absolute, span)
            yield np.broadcast_to(read, (len(felt), *read.shape)).astype(complex), core, felt

    def _weight(self, change: Change, core: Real, span: slice) -> Iterator[_Term]:
        """- y' dK x of gravity."""
        assembly, machine = self.lines.assembly, self.lines.model.machine
        power = _MASS if change.slot == "body" else 0
        if not assembly.has_weight or not core[:, power].any():
            return
        slopes = np.zeros((len(core), 3, *assembly.matrices.mass.shape))
        for slope, own in zip(slopes, core[:, power], strict=True):
            whole = change.left @ own @ change.right.T
            given = {"jacobian_change": whole}
            if change.slot == "body":
                given = {"inertia_change": machine.weighed[:, None] * whole}
            slope[0] = gravity_slope(
                machine.gravity, machine.order, assembly.jacobian, assembly.heavy, **given
            )
        unit = np.eye(len(slopes[0, 0]))
        reader = _reading(-unit, self._readers, span)
        yield reader, slopes, _feeling(unit, self.lines.motion, span)


def _product(reader: Complex, core: Real, felt: Complex, laplace: Complex) -> Complex:
    """Sum over k of s^k A core_pk B; (n_line, n_out, n_in, p)."""
    total = None
    for power in np.flatnonzero(core.any(axis=(0, 2, 3))):
        inner = _side_by_side(core[:, power], felt)
        if power:
            inner *= laplace[:, None, None, None] ** power
        total = inner if total is None else total + inner
    shape = (len(reader), reader.shape[1], felt.shape[2], len(core))
    if total is None:
        return np.zeros(shape, complex)
    product: Complex = reader @ total.reshape(len(total), total.shape[1], -1)
    return product.reshape(shape)


def _through(frame: Real, array: Complex, span: slice) -> Complex:
    """Frame' times an array on some lines; (n, m, n_freq) to (r, m, n_line)."""
    rows = np.flatnonzero(frame.any(axis=1))
    chosen = array[..., span]
    if not rows.size:
        return np.zeros((frame.shape[1], *chosen.shape[1:]), complex)
    return real_times(frame[rows].T, chosen[rows])


def _reading(frame: Real, readers: Complex, span: slice) -> Complex:
    """Readers through a frame; (n_line, n_out, r)."""
    return np.ascontiguousarray(_through(frame, readers, span).transpose(2, 1, 0))


def _feeling(frame: Real, motion: Complex, span: slice) -> Complex:
    """Motion through a frame; (n_line, t, n_in)."""
    return np.ascontiguousarray(_through(frame, motion, span).transpose(2, 0, 1))


def _side_by_side(cores: Real, felt: Complex) -> Complex:
    """Each core times B; (p, r, t) and (n_line, t, n_in) to (n_line, r, n_in, p)."""
    count, rank, _ = cores.shape
    n_line, width, n_in = felt.shape
    flat = np.ascontiguousarray(felt.transpose(1, 0, 2)).reshape(width, -1).view(float)
    found = (cores.reshape(-1, width) @ flat).view(complex)
    return np.ascontiguousarray(found.reshape(count, rank, n_line, n_in).transpose(2, 1, 3, 0))
