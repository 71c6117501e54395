"""Nodes of universal files in world axes, and remarks on their coordinate systems."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identification.readers.uff_datasets import (
    NODE_DATASETS,
    SYSTEMS_DATASETS,
    UNITS_DATASET,
    read_records,
    unit_factors,
)
from identification.readers.uff_systems import (
    KIND_NAMES,
    WORLD,
    WORLD_LABELS,
    CoordinateSystem,
    is_turned,
    resolve_systems,
)
from identification.words import MAX_INPUT_MAGNITUDE, InputError, Layout, Real

_MAX_NAMED_NODES = 6  # in a remark
# Above it a site and a node have other axes: three standard deviations of a sensor's mounting
# angle by default ([tolerance] sensor_angle).
_MAX_AXES_ANGLE_RAD = 3 * 0.01745


@dataclass(frozen=True, eq=False)
class Node:
    """Node of a dataset 15 or 2411.

    Args:
        number: number of the node.
        definition: label of the system of its coordinates.
        displacement: label of the system of its motion and forces.
        position: position in world axes [m]; (3,).
        axes: axes of its motion and forces as columns, in world axes; (3, 3).
    """

    number: int
    definition: int
    displacement: int
    position: Real
    axes: Real


@dataclass(frozen=True, eq=False)
class NodeTable:
    """Nodes of a universal file, in world axes.

    Args:
        nodes: nodes by number; if a number appears twice, the later node counts.
        remarks: sentences on coordinate systems that were applied, or that the file lacks.
    """

    nodes: dict[int, Node]
    remarks: tuple[str, ...]


def read_nodes(path: Path) -> NodeTable:
    """Read the nodes of a universal file and apply their coordinate systems (datasets 2420, 18).

    Raises:
        InputError: the file is missing, a dataset of nodes, systems or units is malformed, or a
            unit factor is not a positive number.
    """
    records, _ = read_records(path, (*NODE_DATASETS, *SYSTEMS_DATASETS, UNITS_DATASET))
    lengths = {number: factor for number, (factor, _) in unit_factors(path, records).items()}
    if min(lengths.values(), default=1.0) < 1 / MAX_INPUT_MAGNITUDE:
        raise InputError(f"{path}: the unit factor of length is absurdly small: correct it")
    systems = resolve_systems(
        [
            (record, lengths[number])
            for number, record in records
            if record["type"] in SYSTEMS_DATASETS
        ]
    )
    nodes = {}
    for number, record in records:
        if record["type"] not in NODE_DATASETS:
            continue
        columns = (record[key] for key in ("node_nums", "def_cs", "disp_cs", "coordinates"))
        for node, definition, displacement, coordinates in zip(*columns, strict=True):
            position = systems.get(definition, WORLD).position(coordinates, lengths[number])
            axes = systems.get(displacement, WORLD).axes_at(position)
            nodes[int(node)] = Node(int(node), int(definition), int(displacement), position, axes)
    return NodeTable(nodes, _remarks(path, list(nodes.values()), systems))


def _remarks(
    path: Path, nodes: Sequence[Node], systems: dict[int, CoordinateSystem]
) -> tuple[str, ...]:
    """Return remarks on systems that move positions, turn axes, or are not defined."""
    moved = [node for node in nodes if _is_moved(systems.get(node.definition, WORLD))]
    turned = [node for node in nodes if is_turned(node.axes)]
    unknown = [
        (node, label)
        for node in nodes
        for label in dict.fromkeys((node.definition, node.displacement))
        if label not in systems and label not in WORLD_LABELS
    ]
    remarks = []
    if moved:
        remarks.append(
            f"{path.name}: positions of {_name_nodes(moved)} were converted from coordinate "
            f"{_name_systems([node.definition for node in moved], systems)} to world axes"
        )
    if turned:
        remarks.append(
            f"{path.name}: channels and references at {_name_nodes(turned)} are along the axes of "
            f"coordinate {_name_systems([node.displacement for node in turned], systems)}, as the "
            "file states"
        )
    if unknown:
        remarks.append(
            f"{path.name}: {_name_nodes([node for node, _ in unknown])} refer to coordinate "
            f"{_name_systems([label for _, label in unknown], systems)}, which the file does not "
            "define (datasets 2420, 18), so world axes are used: export the systems, or set turn "
            "in [sensor.NAME] where the axes differ"
        )
    return tuple(remarks)


def _is_moved(system: CoordinateSystem) -> bool:
    """Return whether coordinates of a system differ from those in world axes."""
    return system.kind in KIND_NAMES or bool(system.origin.any()) or is_turned(system.axes)


def _name_nodes(nodes: Sequence[Node]) -> str:
    """Return the numbers of nodes as text, the first few of many."""
    numbers = list(dict.fromkeys(node.number for node in nodes))
    more = len(numbers) - _MAX_NAMED_NODES
    named = ", ".join(map(str, numbers[:_MAX_NAMED_NODES]))
    return f"node{'s'[: len(numbers) - 1]} {named}{f' and {more} more' if more > 0 else ''}"


def _name_systems(labels: Sequence[int], systems: dict[int, CoordinateSystem]) -> str:
    """Return the labels of systems as text with their kinds, the first few of many."""
    names = []
    for label in dict.fromkeys(labels):
        kind = KIND_NAMES.get(systems[label].kind) if label in systems else None
        names.append(f"{label} ({kind})" if kind else f"{label}")
    more = len(names) - _MAX_NAMED_NODES
    named = ", ".join(names[:_MAX_NAMED_NODES])
    return f"system{'s'[: len(names) - 1]} {named}{f' and {more} more' if more > 0 else ''}"


def site_axes_remarks(path: Path, layout: Layout) -> list[str]:
    """Return a remark if a measurement file turns axes at nodes whose sites have other axes.

    The axes of the sites of a model or layout are the directions of the channels. A column that is
    reversed, as ``flip`` does, counts as the same axis.

    Args:
        path: universal file with the measurement.
        layout: bodies and points, corrected by ``correct_layout``.
    """
    try:
        nodes = read_nodes(path).nodes.values()
    except InputError:  # the measurement does not need them
        return []
    different = []
    for node in nodes:
        site = layout.sensor_at_node(node.number)
        if site is None or not is_turned(node.axes):
            continue
        axes = layout.axes[layout.points.index(site)]
        cosines = np.abs(np.sum(axes * node.axes, axis=0))
        if cosines.min() < np.cos(_MAX_AXES_ANGLE_RAD):
            different.append((node, site, axes))
    if not different:
        return []
    node, site, axes = different[0]
    rotation = node.axes @ axes.T
    advice = ""
    if np.linalg.det(rotation) > 0:  # else one of both is left-handed, as after a flip
        turn = ", ".join(f"{x:.4g}" for x in Rotation.from_matrix(rotation).as_rotvec())
        advice = f", as with turn = [{turn}] in [sensor.{site}]"
    labels = [node.displacement for node, _, _ in different]
    return [
        f"{path.name}: the file turns the axes of {_name_nodes([node for node, _, _ in different])}"
        f" (coordinate {_name_systems(labels, {})}), but the axes of their sites count, which "
        f"differ: if the file is right, turn the sites{advice}"
    ]
