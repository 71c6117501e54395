"""Parts of equal structure, whose own normal equations are formed together."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import ForceEntries, Model
from tuning.misfit.reduction import N_MOTIONS
from tuning.parametrisation.parametrisation import Parametrisation


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
