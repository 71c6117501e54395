r"""Derivatives of every FRF by every parameter, on any run of lines.

Whatever a parameter changes pushes the joints, moves the bodies, or is read off:

    dH_p = y' g_p + L d_p + c_p,    y = Z^-T T' L' the readers of the outputs,

each a sum of s^k f(s) K_p v: a real matrix of the slope left core_pk right' times what it feels.
With x the motion of the joints, b = T x that of the bodies relative to the floor, a = b + U s^(q-2)
their absolute one, e the inputs' unit forces s^q:

    joint    g = -left core right' x
    body     g = -T' left core right' b,  of a for masses
    path     d = left core right' x,      g = -T' Zb d + right core' left' (P s^q - Zb b or Mb a)
    hammer   g = T' right core' left' (directions of the inputs) e
    sensor   c = (directions of the outputs) left core right' a

The matrices of all parameters with the same k, f and v stand side by side, so that one real product
gives all their g. Gravity's stiffness adds -dK x to g where bodies or joints change.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.ports import selection
from mbmodel.frf.solution import Solved
from mbmodel.linearisation.gravity import gravity_slope
from mbmodel.model import shaped_core
from mbmodel.parts import Change

Slopes = Sequence[tuple[Change, ...]]
_Goal = Literal["push", "move", "read"]
_Felt = Literal["joints", "relative", "absolute", "pressed", "inputs"]
_Shape = Callable[[Complex], Complex] | None
_Key = tuple[_Goal, _Felt, int, _Shape]  # with the power of s

_MASS = 2  # the power of s of masses


@dataclass(frozen=True, eq=False)
class Share:
    """What some parameters bring, real and imaginary parts one after the other.

    Args:
        places: numbers of the parameters among the chosen.
        values: (n_line, n_in, 2, n, n_own).
    """

    places: Integers | slice
    values: Real


@dataclass(frozen=True, eq=False)
class _Group:
    """K of parameters that stand side by side.

    Args:
        places: numbers of the parameters among the chosen.
        count: how many.
        matrix: K; (m, n count).
    """

    places: Integers | slice
    count: int
    matrix: Real


class Forward:
    """Derivatives of the FRFs of one linearised model.

    Args:
        lines: the model linearised at theta.
        slopes: of every Part that has parameters among the chosen.
        chosen: parameters asked for; (n_parameter,).
        rates: by which each derivative is multiplied; one if None; (n_parameter,).
    """

    def __init__(
        self, lines: Solved, slopes: Slopes, chosen: Mask, rates: Real | None = None
    ) -> None:
        self.lines = lines
        self.count = int(chosen.sum())
        self._chosen = lines.model.pieces(chosen)
        self._rates = np.ones(self.count) if rates is None else rates[chosen]
        self._slopes = slopes

    @property
    def reads(self) -> bool:
        """Whether some parameter changes how outputs read, and not only how bodies move."""
        return any(goal == "read" for goal, *_ in self._groups)

    def prepare(self) -> None:
        """Compute what all lines share, so that runs of lines can be asked for by threads."""
        _ = self._readers, self._absolute, self._pressed, self._groups

    def readers(self, span: slice) -> Real:
        """Real and imaginary parts of y'; (n_line, n_out, 2, nv)."""
        chosen = self._readers[..., span]
        found = np.empty((chosen.shape[2], chosen.shape[1], 2, chosen.shape[0]))
        found[:, :, 0] = chosen.real.transpose(2, 1, 0)
        found[:, :, 1] = chosen.imag.transpose(2, 1, 0)
        return found

    def pushes(self, span: slice) -> Real:
        """G of all chosen parameters; (n_line, n_in, 2, nv, n_chosen)."""
        n_in = self.lines.values.shape[2]
        n_line = len(self.lines.question.laplace[span])
        total = np.zeros((n_line, n_in, 2, len(self.lines.motion), self.count))
        for share in self._shares("push", span):
            total[..., share.places] += share.values
        return total

    def moves(self, span: slice) -> Iterator[Share]:
        """D of the parameters that move joints, n = 6 n_body; shares of one parameter add up."""
        return self._shares("move", span)

    def read_off(self, span: slice) -> Iterator[Share]:
        """C of the parameters of sensors, n = n_out; shares of one parameter add up."""
        return self._shares("read", span)

    def columns(self, span: slice = slice(None)) -> Complex:
        """Derivatives by the chosen parameters; (n_line, n_out, n_in, n_chosen)."""
        pushes = self.pushes(span)
        whole = pushes[:, :, 0] + 1j * pushes[:, :, 1]
        readers = self.readers(span)
        total = (readers[:, :, 0] + 1j * readers[:, :, 1])[:, None] @ whole
        for share in self.moves(span):
            moved = self.lines.places.readout @ share.values
            total[..., share.places] += moved[:, :, 0] + 1j * moved[:, :, 1]
        for share in self.read_off(span):
            total[..., share.places] += share.values[:, :, 0] + 1j * share.values[:, :, 1]
        return np.asarray(total.swapaxes(1, 2), complex)

    def pulled(self, weights: Complex, adjoint: Complex) -> Real:
        """Re sum W H' over lines and inputs, without any column: a matrix for all that act alike.

        Args:
            weights: W, conjugate; (n_out, n_in, n_freq).
            adjoint: a = Z^-T G' W; (nv, n_in, n_freq).

        Returns:
            (n_chosen,).
        """
        goals = {"push": adjoint, "read": weights}
        if any(goal == "move" for goal, *_ in self._groups):
            goals["move"] = real_times(self.lines.places.readout.T, weights)
        flat = {goal: _flat(values.conj()) for goal, values in goals.items()}
        total = np.zeros(self.count)
        for (goal, what, power, shape), group in self._groups.items():
            felt = self._shaken(what, power, shape, slice(None))
            both = _flat(felt) @ flat[goal].T
            total[group.places] += both.ravel() @ group.matrix.reshape(-1, group.count)
        return total

    def rows(self, part: int) -> tuple[Integers, Complex]:
        """Which outputs a sensor's Part touches, and the derivatives of these alone.

        Returns:
            Numbers of the outputs (n_row,), and (n_freq, n_row, n_in, n_own).
        """
        (change,), mask = self._slopes[part], self._chosen[part]
        directions = selection(self.lines.question.outputs, change.point)
        places = np.flatnonzero(directions.any(axis=1))
        left = directions[places] @ change.left @ change.core[mask, 0]
        rows = np.flatnonzero(change.right.any(axis=1))
        felt = real_times(change.right[rows].T, self._absolute[rows])
        return places, np.einsum("prt,tif->frip", left, felt, optimize=True)

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

    @cached_property
    def _pressed(self) -> Complex:
        """P s^q - Zb (..), what the joints carry of each body; (6 n_body, n_in, n_freq)."""
        lines = self.lines
        total: Complex = lines.places.force[:, :, None] * lines.question.factor
        for power in np.flatnonzero(lines.assembly.body.any(axis=(1, 2))):
            felt = self._absolute if power == _MASS else self._relative
            total -= real_times(lines.assembly.body[power], felt) * lines.question.laplace**power
        for change in self._shaped_bodies:
            moved = real_times(change.right.T, self._relative).transpose(2, 0, 1)
            pressed = shaped_core(change, lines.question.laplace) @ moved
            total -= real_times(change.left, pressed.transpose(1, 2, 0))
        return total

    @cached_property
    def _shaped_bodies(self) -> list[Change]:
        """What depends on frequency in its own way at bodies."""
        shaped = self.lines.assembly.shaped
        return [term.change for term in shaped if term.change.slot == "body"]

    def _felt(self, what: _Felt, span: slice) -> Complex:
        """What is felt; (m, n_in, n_line)."""
        if what == "joints":
            return self.lines.motion[..., span]
        if what == "inputs":
            n_in = self.lines.values.shape[2]
            return np.eye(n_in)[:, :, None] * self.lines.question.factor[span]
        known = {
            "relative": self._relative,
            "absolute": self._absolute,
            "pressed": self._pressed,
        }
        return known[what][..., span]

    def _shaken(self, what: _Felt, power: int, shape: _Shape, span: slice) -> Complex:
        """What is felt, times s^power and a shape of s; (m, n_in, n_line)."""
        felt, laplace = self._felt(what, span), self.lines.question.laplace[span]
        if power or shape is not None:
            factor = laplace**power
            felt = felt * (factor if shape is None else factor * shape(laplace))
        return felt

    def _shares(self, goal: _Goal, span: slice) -> Iterator[Share]:
        """What reaches a goal, one product for all that feel the same in the same way."""
        for (own, what, power, shape), group in self._groups.items():
            if own != goal:
                continue
            felt = self._shaken(what, power, shape, span)
            m, n_in, n_line = felt.shape
            flat = np.empty((n_line, n_in, 2, m))
            flat[:, :, 0] = felt.real.transpose(2, 1, 0)
            flat[:, :, 1] = felt.imag.transpose(2, 1, 0)
            values = flat.reshape(-1, m) @ group.matrix
            yield Share(group.places, values.reshape(n_line, n_in, 2, -1, group.count))

    @cached_property
    def _groups(self) -> dict[_Key, _Group]:
        """Parameters that push, move or read alike."""
        found: dict[_Key, list[tuple[Integers, Real]]] = {}
        start = 0
        for mask, changes in zip(self._chosen, self._slopes, strict=True):
            own = np.arange(start, start + int(mask.sum()))
            start += len(own)
            for change in changes if len(own) else ():
                core = change.core[mask] * self._rates[own][:, None, None, None]
                for key, matrices in self._terms(change, core):
                    acts = matrices.any(axis=(1, 2))
                    if acts.any():
                        found.setdefault(key, []).append((own[acts], matrices[acts]))
        return {key: _side_by_side(terms) for key, terms in found.items()}

    def _terms(self, change: Change, core: Real) -> Iterator[tuple[_Key, Real]]:
        """K (n_own, n, m) of one slope."""
        lines, shape = self.lines, change.shape
        left, right, turned = change.left, change.right.T, lines.assembly.jacobian.T
        for power in map(int, np.flatnonzero(core.any(axis=(0, 2, 3)))):
            own, flipped = core[:, power], core[:, power].swapaxes(1, 2)
            if change.slot == "joint":
                yield ("push", "joints", power, shape), -left @ own @ right
            elif change.slot == "body":
                felt: _Felt = "absolute" if power == _MASS else "relative"
                yield ("push", felt, power, shape), (-turned @ left) @ own @ right
            elif change.slot == "path":
                moved = left @ own @ right
                yield ("move", "joints", power, shape), moved
                yield from self._carried(moved, power, shape)
                yield ("push", "pressed", power, shape), change.right @ flipped @ left.T
            elif change.slot == "hammer":
                directions = selection(lines.question.inputs, change.point) @ left
                pushed = (turned @ change.right) @ flipped @ directions.T
                yield ("push", "inputs", power, shape), pushed
            else:
                read = selection(lines.question.outputs, change.point) @ left
                yield ("read", "absolute", power, shape), read @ own @ right
        if change.slot in ("body", "path"):
            yield from self._weight(change, core)

    def _carried(self, moved: Real, power: int, shape: _Shape) -> Iterator[tuple[_Key, Real]]:
        """- T' Zb d of joints that move, d (n_own, 6 n_body, nv)."""
        assembly = self.lines.assembly
        turned = assembly.jacobian.T
        for more in map(int, np.flatnonzero(assembly.body.any(axis=(1, 2)))):
            pressed = turned @ assembly.body[more]
            yield ("push", "joints", power + more, shape), -pressed @ moved
        for change in self._shaped_bodies:
            both = _product(shape, change.shape)
            for more in map(int, np.flatnonzero(change.core.any(axis=(1, 2)))):
                pressed = turned @ change.left @ change.core[more] @ change.right.T
                yield ("push", "joints", power + more, both), -pressed @ moved

    def _weight(self, change: Change, core: Real) -> Iterator[tuple[_Key, Real]]:
        """- dK x of gravity."""
        assembly, machine = self.lines.assembly, self.lines.model.machine
        power = _MASS if change.slot == "body" else 0
        if not assembly.has_weight or not core[:, power].any():
            return
        slopes = np.zeros((len(core), *assembly.matrices.mass.shape))
        for slope, own in zip(slopes, core[:, power], strict=True):
            whole = change.left @ own @ change.right.T
            given = {"jacobian_change": whole}
            if change.slot == "body":
                given = {"inertia_change": machine.weighed[:, None] * whole}
            slope[:] = gravity_slope(
                machine.gravity, machine.order, assembly.jacobian, assembly.heavy, **given
            )
        yield ("push", "joints", 0, change.shape), -slopes


def _side_by_side(terms: Sequence[tuple[Integers, Real]]) -> _Group:
    """What several Parts bring, summed where a parameter brings it twice."""
    places = np.concatenate([own for own, _ in terms])
    matrices = np.concatenate([own for _, own in terms])
    numbers, inverse = np.unique(places, return_inverse=True)
    if len(numbers) < len(places):
        summed = np.zeros((len(numbers), *matrices.shape[1:]))
        np.add.at(summed, inverse, matrices)
        places, matrices = numbers, summed
    flat = np.ascontiguousarray(matrices.transpose(2, 1, 0))
    return _Group(_run(places), len(places), flat.reshape(len(flat), -1))


def _flat(values: Complex) -> Real:
    """(m, n_in, n_freq) as real numbers in m rows."""
    return np.ascontiguousarray(values).reshape(len(values), -1).view(float)


def _product(one: _Shape, other: _Shape) -> _Shape:
    """Of two shapes, either of which may be none."""
    if one is None or other is None:
        return other if one is None else one
    return lambda laplace: one(laplace) * other(laplace)


def _run(places: Integers) -> Integers | slice:
    """A slice for places that follow each other in even steps: adding to them is quicker."""
    steps = np.unique(np.diff(places))
    if len(steps) > 1 or (len(steps) and steps[0] < 1) or not len(places):
        return places
    step = int(steps[0]) if len(steps) else 1
    return slice(int(places[0]), int(places[-1]) + 1, step)
