r"""Coupling of the normal equations to further coordinates (probes), by their columns or forces.

A probe p changes the FRFs by A g_p: its pseudo-forces g_p at the joints, and the weighted adjoint
solutions A of the channels. With the weighted columns C of what varies,

    C' A g_p = V' g_p,   V = A' C,      g_p' (A' A) g_p',

so that a probe costs what its few entries cost: an appendage is one force on one body, whose
spectrum alone depends on its frequency. Loads l on bodies, g = T' l, keep their few entries with
T V in place of V. Parameters that move joints or sensors have columns of their own.

Parts of equal structure, whose own normal equations are formed together.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import ForceEntries, ForwardSensitivities, Model
from tuning.misfit.accumulation import MAX_JACOBIAN_VALUES, WeightedJacobian, flatten, split_lines
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.misfit.reduction import N_MOTIONS
from tuning.parametrisation.parametrisation import Parametrisation

_MAX_PROJECTED_VALUES = 2**21  # of V, held in memory at once, 16 MB


@dataclass(frozen=True, eq=False)
class ProbedEquations:
    """Normal equations, and their coupling to further coordinates (probes).

    Args:
        gradient: gradient of J with its priors; (n_x,).
        normal: N of the data.
        cross: N between the coordinates that vary and the probes; (n_x, n_probe).
        blocks: N of the probes, zero between different Parts; (n_probe, n_probe).
        slope: gradient of J by the probes; (n_probe,).
    """

    gradient: Real
    normal: ArrowMatrix
    cross: Real
    blocks: Real
    slope: Real


def probe_by_columns(
    fitted: WeightedJacobian,
    probes: WeightedJacobian,
    blocks: Sequence[Integers],
    sums: ProbedEquations,
) -> None:
    """Add the coupling of probes from their weighted columns, of equal projections.

    Args:
        probes: derivatives by the probes of some Parts.
        blocks: coordinates of each of these Parts, in the order of the columns.
        sums: sums to which to add.
    """
    n_freq = len(fitted.forward.solution.values)
    step = max(1, MAX_JACOBIAN_VALUES // (fitted.values_per_line + probes.values_per_line))
    places = np.concatenate(blocks)
    ends = np.cumsum([0, *map(len, blocks)])
    spans_of_blocks = [slice(first, last) for first, last in pairwise(ends)]
    for span in split_lines(np.zeros(n_freq, int), step):
        columns, probe_columns = fitted.columns(span), probes.columns(span)
        flat = flatten(probe_columns)
        sums.slope[places] += flat.T @ fitted.target(span)
        shared = fitted.partition.shared_coordinates
        sums.cross[np.ix_(shared, places)] += flatten(columns).T @ flat
        by_body = [
            flatten(probe_columns[..., projection.span, :]) for projection in fitted.projections
        ]
        for sensor, at in zip(fitted.sensors, fitted.partition.block_coordinates, strict=True):
            sums.cross[np.ix_(at[at >= 0], places)] += (
                flatten(sensor.projected[span]).T @ by_body[sensor.projection]
            )
        for block, at_columns in zip(blocks, spans_of_blocks, strict=True):
            sums.blocks[np.ix_(block, block)] += flat[:, at_columns].T @ flat[:, at_columns]


def probe_by_forces(
    fitted: WeightedJacobian,
    forward: ForwardSensitivities,
    blocks: Sequence[Integers],
    sums: ProbedEquations,
) -> None:
    """Add the coupling of probes that act by forces alone, from the entries of these.

    Args:
        forward: derivatives by the probes of some Parts.
        blocks: coordinates of each of these Parts, in the order of the parameters.
        sums: sums to which to add.
    """
    solution = fitted.forward.solution
    to_bodies = solution.assembly.jacobian
    order = _order_coordinates(fitted)
    n_freq, n_in = len(solution.values), solution.values.shape[2]
    values_per_line = 2 * n_in * sum(to_bodies.shape) * (len(order) + 1)
    step = max(1, _MAX_PROJECTED_VALUES // values_per_line)
    counts = list(map(len, blocks))
    total = np.zeros((forward.count, len(order) + 1))
    of_parts = [np.zeros((count, count)) for count in counts]
    groups: list[PartGroup] = []
    for span in split_lines(np.zeros(n_freq, int), step):
        adjoints = fitted.projected_adjoints(span)
        projected = _project_columns(fitted, span, adjoints)
        forces = list(forward.force_entries(span))
        for of_target in forces:
            at = projected if of_target.target == "force" else to_bodies @ projected
            _couple(at, of_target, total)
        groups = groups or group_parts(forces, counts)
        half = adjoints.shape[2] // 2, adjoints.shape[3] // 2
        at_joints = adjoints[..., : half[0], : half[1]] + 1j * adjoints[..., half[0] :, : half[1]]
        complex_adjoints = {"force": at_joints, "load": at_joints @ to_bodies.T}
        for group in groups:
            for number, block in group.find_blocks(complex_adjoints, forces):
                of_parts[number] += block
    places = np.concatenate(blocks)
    sums.cross[np.ix_(order, places)] += total[:, :-1].T
    sums.slope[places] += total[:, -1]
    for at_part, block in zip(blocks, of_parts, strict=True):
        sums.blocks[np.ix_(at_part, at_part)] += block


def _order_coordinates(fitted: WeightedJacobian) -> Integers:
    """Return the coordinates in the order of ``_project_columns``: shared ones, then sensors'."""
    partition = fitted.partition
    of_sensors = [
        at[at >= 0]
        for number in range(len(fitted.projections))
        for sensor, at in zip(fitted.sensors, partition.block_coordinates, strict=True)
        if sensor.projection == number
    ]
    return np.concatenate([partition.shared_coordinates, *of_sensors])


def _project_columns(fitted: WeightedJacobian, span: slice, adjoints: Real) -> Real:
    """Return V = A' C of all coordinates, and A' r of the residual last.

    Args:
        adjoints: A; (n_line, n_in, 2 m, 2 nv).

    Returns:
        (n_line, n_in, 2, nv, n_x + 1).
    """
    columns = fitted.columns(span)
    n_line, n_in, _, n_projected, n_shared = columns.shape
    parts = [adjoints.swapaxes(2, 3) @ columns.reshape(n_line, n_in, -1, n_shared)]
    by_part = adjoints.reshape(n_line, n_in, 2, n_projected, -1)
    for number, projection in enumerate(fitted.projections):
        of_sensors = [s.projected[span] for s in fitted.sensors if s.projection == number]
        if of_sensors:
            rows = by_part[:, :, :, projection.span].reshape(n_line, n_in, -1, by_part.shape[-1])
            stacked = np.concatenate(of_sensors, axis=-1)
            parts.append(rows.swapaxes(2, 3) @ stacked.reshape(n_line, n_in, -1, stacked.shape[-1]))
    parts.append(adjoints.swapaxes(2, 3) @ fitted.target(span).reshape(n_line, n_in, -1, 1))
    projected: Real = np.concatenate(parts, axis=-1)
    return projected.reshape(n_line, n_in, 2, -1, projected.shape[-1])


def _couple(projected: Real, forces: ForceEntries, total: Real) -> None:
    """Add V' g of each parameter.

    Args:
        projected: V; (n_line, n_in, 2, n, n_column).
        forces: entries of g.
        total: sums; (n_parameter, n_column).
    """
    for first, last in _runs(forces.coordinates):
        of_coordinate = projected[..., forces.coordinates[first], :]
        values = forces.values[first:last].reshape(last - first, -1)
        total[forces.parameters[first:last]] += values @ of_coordinate.reshape(values.shape[1], -1)


def _runs(coordinates: Integers) -> Iterator[tuple[int, int]]:
    """Yield first and last entry of each run of equal coordinates."""
    ends = [0, *(np.flatnonzero(np.diff(coordinates)) + 1), len(coordinates)]
    for first, last in pairwise(ends):
        if last > first:
            yield int(first), int(last)


def probe_blocks(model: Model, probes: Parametrisation) -> list[Integers]:
    """Return the coordinates of each Part among the probes."""
    counts = [int(mask.sum()) for mask in model.split_parameters(probes.free)]
    ends = np.cumsum([0, *(count for count in counts if count)])
    return [np.arange(first, last) for first, last in pairwise(ends)]


@dataclass(frozen=True, eq=False)
class PartGroup:
    """Parts whose forces act at the same places, each with as many parameters.

    Args:
        parts: numbers of the Parts.
        coordinates: coordinates of pseudo-forces, and of loads on bodies.
        places: of each of both, entries, their coordinates here and parameters here.
        count: number of parameters of each Part.
    """

    parts: tuple[int, ...]
    coordinates: dict[str, Integers]
    places: dict[str, tuple[Integers, Integers, Integers]]
    count: int

    def find_blocks(
        self, adjoints: dict[str, Complex], forces: Sequence[ForceEntries]
    ) -> Iterator[tuple[int, Real]]:
        """Yield g' (A' A) g of each Part over some lines, and its number.

        Args:
            adjoints: A, and A T'; (n_line, n_in, m, n) each.
            forces: entries of g, and of loads.
        """
        chosen = [adjoints[target][..., rows] for target, rows in self.coordinates.items()]
        columns = np.concatenate(chosen, axis=-1)
        gram = columns.conj().swapaxes(2, 3) @ columns
        shape = (*gram.shape[:3], len(self.parts) * self.count)
        values = np.zeros(shape, complex)
        for of_target in forces:
            entries, rows, places = self.places[of_target.target]
            complex_values = of_target.values[entries].view(complex)[..., 0]
            values[:, :, rows, places] = np.moveaxis(complex_values, 0, -1)
        left, right = (
            np.ascontiguousarray(
                array.reshape(-1, len(self.parts), self.count).transpose(1, 2, 0)
            ).view(float)
            for array in (values, gram @ values)
        )
        yield from zip(self.parts, left @ right.swapaxes(1, 2), strict=True)


def group_parts(forces: Sequence[ForceEntries], counts: Sequence[int]) -> list[PartGroup]:
    """Return groups of Parts.

    Args:
        forces: entries of pseudo-forces, and of loads on bodies.
        counts: number of parameters of each Part.
    """
    part_of = np.repeat(np.arange(len(counts)), counts)
    first_of = np.cumsum([0, *counts])
    coordinates: list[dict[str, set[int]]] = [{"force": set(), "load": set()} for _ in counts]
    for of_target in forces:
        parts = part_of[of_target.parameters]
        for part, coordinate in set(
            zip(parts.tolist(), of_target.coordinates.tolist(), strict=True)
        ):
            at = coordinates[part][of_target.target]
            first = coordinate - coordinate % N_MOTIONS
            at.update(
                range(first, first + N_MOTIONS) if of_target.target == "load" else (coordinate,)
            )
    members: dict[tuple[tuple[int, ...], ...], list[int]] = defaultdict(list)
    for part, (count, at) in enumerate(zip(counts, coordinates, strict=True)):
        members[tuple(sorted(at["force"])), tuple(sorted(at["load"])), (count,)].append(part)
    groups = []
    for (joints, loads, (count,)), parts_of_group in members.items():
        rows = {"force": np.array(joints, np.intp), "load": np.array(loads, np.intp)}
        starts = {"force": 0, "load": len(joints)}
        place_of = np.full(len(counts), -1)
        place_of[parts_of_group] = np.arange(len(parts_of_group))
        places: dict[str, tuple[Integers, Integers, Integers]] = {}
        for of_target in forces:
            place = place_of[part_of[of_target.parameters]]
            entries = np.flatnonzero(place >= 0)
            parameters = of_target.parameters[entries]
            target = of_target.target
            places[target] = (
                entries,
                starts[target] + np.searchsorted(rows[target], of_target.coordinates[entries]),
                place[entries] * count + parameters - first_of[part_of[parameters]],
            )
        groups.append(PartGroup(tuple(parts_of_group), rows, places, count))
    return groups
