"""Mode shapes to universal files: datasets 55 and 2414, with nodes (15, 2411), units and header.

A mode is written as a complex eigenvalue of first order (analysis type 3). Its record holds the
eigenvalue s_r, modal A = a_r and modal B = -s_r a_r. The receptance is
H = sum_r phi_r phi_r^T / (a_r (s - s_r)) + conjugate. The three values of a node are its
translation along world axes: the channels of a sensor, each along its axis, added as vectors. An
unmeasured direction is zero; rotations are left out. Numbers have the six digits of E13.5.

Mode shapes from universal files: datasets 55, or 2414 if there are none; real or complex.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from identification.readers.uff_datasets import Record, read_records
from identification.readers.uff_nodes import read_nodes
from identification.words import (
    Complex,
    Dof,
    HasPoles,
    InputError,
    Integers,
    Layout,
    Mask,
    Output,
    Real,
    Signal,
    frozen_array,
    node_number,
)

_MARK_LINE = f"{-1:6d}\n"  # begins and ends each dataset


@dataclass(frozen=True, eq=False)
class NodeShapes(HasPoles):
    """Modes with their translations at numbered nodes.

    Args:
        poles: poles s_r [rad/s]; (n_mode,).
        modal_a: modal scaling a_r of receptance [kg/s], zero if unknown; (n_mode,).
        nodes: numbers of the nodes; (n_node,).
        positions: positions of the nodes [m], zero if unknown; (n_node, 3).
        values: translations along world axes; (n_node, 3, n_mode).
        remarks: sentences on what was read, such as axes that a file turns.

    Raises:
        ValueError: the shape of an array contradicts this description.
    """

    poles: Complex
    modal_a: Complex
    nodes: Integers
    positions: Real
    values: Complex
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        n, m = len(self.nodes), len(self.poles)
        for name, kind, shape in (
            ("poles", np.complex128, (m,)),
            ("modal_a", np.complex128, (m,)),
            ("nodes", np.intp, (n,)),
            ("positions", np.float64, (n, 3)),
            ("values", np.complex128, (n, 3, m)),
        ):
            object.__setattr__(self, name, frozen_array(getattr(self, name), kind, shape, name))

    def at_channels(self, outputs: Sequence[Output], layout: Layout) -> tuple[Complex, Mask]:
        """Return the shapes along the axes of channels, and which channels have a value.

        Args:
            outputs: channels at points whose names end in a node number.
            layout: layout with the axes of the points.

        Returns:
            Shapes (n_out, n_mode), zero at channels without a value; mask of channels whose node
            is known and which are translations (n_out,).
        """
        rows = {int(node): row for row, node in enumerate(self.nodes)}
        points = list(dict.fromkeys(dof.point for dof in outputs if isinstance(dof, Dof)))
        numbers = dict(zip(points, _number_points(points), strict=True))
        shapes = np.zeros((len(outputs), len(self.poles)), complex)
        is_available = np.zeros(len(outputs), bool)
        for k, dof in enumerate(outputs):
            if isinstance(dof, Signal):
                continue
            row = rows.get(numbers[dof.point])
            if row is not None and not dof.is_rotation:
                shapes[k] = _axis(dof, layout) @ self.values[row]
                is_available[k] = True
        return shapes, is_available


def node_shapes(
    poles: Complex, modal_a: Complex, shapes: Complex, outputs: Sequence[Dof], layout: Layout
) -> NodeShapes:
    """Combine the shapes of channels to vectors at nodes, for a universal file.

    Args:
        poles: poles s_r [rad/s]; (n_mode,).
        modal_a: modal scaling a_r of receptance [kg/s]; empty if unknown.
        shapes: mode shapes of the channels; (n_out, n_mode).
        outputs: channels; rotations are left out.
        layout: layout with positions and axes of the sensors.
    """
    translations = [k for k, dof in enumerate(outputs) if not dof.is_rotation]
    points = list(dict.fromkeys(outputs[k].point for k in translations))
    numbers = _number_points(points)
    values = np.zeros((len(points), 3, len(poles)), complex)
    for k in translations:
        values[points.index(outputs[k].point)] += np.multiply.outer(
            _axis(outputs[k], layout), shapes[k]
        )
    positions = np.array([layout.positions[layout.points.index(p)] for p in points]).reshape(-1, 3)
    scale = modal_a if len(modal_a) else np.zeros(len(poles), complex)
    return NodeShapes(poles, scale, np.array(numbers, np.intp), positions, values)


def _axis(dof: Dof, layout: Layout) -> Real:
    """Return the signed axis of a channel in world axes; (3,)."""
    return dof.sign * layout.axes[layout.points.index(dof.point)][:, dof.axis % 3]


def _node(point: str) -> int:
    """Return the node number in which a name ends, or -1."""
    number = node_number(point)
    return -1 if number is None else number


def _number_points(points: Sequence[str]) -> list[int]:
    """Return the node number in which each name ends.

    A name without a number, or with one already in use, gets the next above the largest.
    """
    largest = max((_node(point) for point in points), default=0)
    numbers = []
    for point in points:
        if _node(point) < 0 or _node(point) in numbers:
            largest += 1
            numbers.append(largest)
        else:
            numbers.append(_node(point))
    return numbers


def write_uff_modes(path: Path, modes: NodeShapes, title: str, written: datetime) -> None:
    """Write modes as an ASCII universal file: 151, 164, 15, 2411, and 55 and 2414 for each mode.

    Args:
        path: path of the file, which is replaced if it exists.
        modes: modes at nodes.
        title: title of the header and of each mode, cut at 80 characters.
        written: date and time of the header.
    """
    name = " ".join(title.split())[:80] or "NONE"
    parts = [_header(name, written), units(), *_nodes(modes)]
    for number in range(len(modes.poles)):
        parts += [_shape_55(modes, number, name), _shape_2414(modes, number, name)]
    path.write_text("".join(parts), encoding="ascii", errors="replace")


def dataset(kind: int, lines: Sequence[str]) -> str:
    """Return a dataset between its two marks."""
    return "".join([_MARK_LINE, f"{kind:6d}\n", *(line + "\n" for line in lines), _MARK_LINE])


def _header(name: str, written: datetime) -> str:
    """Return the header, dataset 151."""
    stamp = f"{written:%d-%b-%y} {written:%H:%M:%S} "
    date = f"{stamp[:10]:10}{stamp[10:20]:10}"
    lines = [name, "modal model", "mbworkbench", f"{date}{0:10d}{0:10d}{0:10d}", date]
    return dataset(151, [*lines, "mbworkbench", date])


def units() -> str:
    """Return the units, dataset 164: SI, with factors of one."""
    factors = f"{1:25.16E}{1:25.16E}{1:25.16E}".replace("E", "D")
    offset = f"{273.15:25.16E}".replace("E", "D")
    return dataset(164, [f"{1:10d}{'SI: Meter (newton)':20}{2:10d}", factors, offset])


def _nodes(modes: NodeShapes) -> tuple[str, str]:
    """Return the nodes as datasets 15 and 2411."""
    rows = list(zip(modes.nodes, modes.positions, strict=True))
    single = [f"{n:10d}{0:10d}{0:10d}{0:10d}" + "".join(f"{v:13.5E}" for v in p) for n, p in rows]
    double = [
        f"{n:10d}{0:10d}{0:10d}{0:10d}\n" + "".join(f"{v:25.16E}" for v in p) for n, p in rows
    ]
    return dataset(15, single), dataset(2411, double)


def _eigenvalue(modes: NodeShapes, number: int) -> str:
    """Return the line with s_r, modal A and modal B."""
    pole, scale = modes.poles[number], modes.modal_a[number]
    return _row([pole, scale, -pole * scale])


def _row(values: Sequence[complex] | Complex) -> str:
    """Return complex values as text, real and imaginary parts in E13.5."""
    return "".join(f"{part:13.5E}" for value in values for part in (value.real, value.imag))


def _identity(modes: NodeShapes, number: int, name: str) -> list[str]:
    """Return the five identification lines of a mode."""
    freq, damping = modes.freq_hz[number], modes.damping[number]
    state = f"MODE {number + 1:10d} FREQUENCY {freq:13.5E} HZ DAMPING {100 * damping:10.4f} %"
    return [name, "complex mode shape", "NONE", "NONE", state]


def _values(modes: NodeShapes, number: int) -> list[str]:
    """Return the lines of node numbers and values of a mode."""
    return [
        f"{node:10d}\n{_row(value)}"
        for node, value in zip(modes.nodes, modes.values[:, :, number], strict=True)
    ]


def _shape_55(modes: NodeShapes, number: int, name: str) -> str:
    """Return one mode as dataset 55."""
    kinds = "".join(f"{kind:10d}" for kind in (1, 3, 2, 8, 5, 3))
    head = [*_identity(modes, number, name), kinds]
    count = "".join(f"{k:10d}" for k in (2, 6, 1, number + 1))
    return dataset(55, [*head, count, _eigenvalue(modes, number), *_values(modes, number)])


def _shape_2414(modes: NodeShapes, number: int, name: str) -> str:
    """Return one mode as dataset 2414."""
    kinds = "".join(f"{kind:10d}" for kind in (1, 3, 2, 8, 5, 3))
    head = [f"{number + 1:10d}", name, f"{1:10d}", *_identity(modes, number, name), kinds]
    integers = "".join(f"{k:10d}" for k in (0, 0, 1, 0, 1, number + 1, 0, 0))
    reserved = f"{0:10d}{0:10d}"
    return dataset(
        2414,
        [
            *head, integers, reserved, _row([0j, 0j, 0j]),
            _eigenvalue(modes, number), *_values(modes, number),
        ],
    )  # fmt: skip


def read_uff_modes(path: Path) -> NodeShapes:
    """Read the modes of a universal file.

    The poles of normal modes (analysis type 2) come from frequency and viscous damping.
    Translations along the axes of the displacement systems of the nodes become translations along
    world axes.

    Raises:
        InputError: there is no mode, or modes have different nodes.
    """
    table = read_nodes(path)
    modes = _read_modes(path, 55) or _read_modes(path, 2414)
    if not modes:
        raise InputError(
            f"{path} holds no mode shape: export datasets 55 or 2414, analysis type 2 or 3"
        )
    first_number, first = modes[0]
    nodes = first["node_nums"]
    for number, mode in modes:
        if not np.array_equal(mode["node_nums"], nodes):
            raise InputError(
                f"{path}: records {first_number} and {number} have different nodes: export all "
                "modes at the same nodes"
            )
    positions, values = np.zeros((len(nodes), 3)), np.stack([m["values"] for _, m in modes], -1)
    for row, number in enumerate(nodes):
        node = table.nodes.get(int(number))
        if node is not None:
            positions[row], values[row] = node.position, node.axes @ values[row]
    return NodeShapes(
        np.array([mode["pole"] for _, mode in modes]),
        np.array([mode["modal_a"] for _, mode in modes]),
        nodes,
        positions,
        values,
        remarks=table.remarks,
    )


def _read_modes(path: Path, kind: int) -> list[tuple[int, Record]]:
    """Read the modes among the datasets of one kind, each with its record number."""
    return [(number, mode) for number, mode in read_records(path, (kind,))[0] if mode["is_mode"]]
