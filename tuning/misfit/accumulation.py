"""Weighted derivatives of many lines, chunk by chunk, and their sums over lines."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import prod

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import ForwardSensitivities
from tuning.misfit.partition import CoordinatePartition
from tuning.misfit.reduction import BodyProjection

MAX_JACOBIAN_VALUES = 2**19  # held in memory at once, 4 MB: what a cache holds
_MAX_FORCE_VALUES = 2**21  # with free forces, for each of which a run of lines adds to a matrix


@dataclass(frozen=True, eq=False)
class FreeForceReduction:
    """Reduction of the normal equations by forces whose spectra are free, one force at a time.

    Args:
        normal: subtracted from N; (n_force, n_x, n_x).
        gradient: subtracted from the gradient; (n_force, n_x).
        value: subtracted from J; (n_force,).
        expected_gain: ln(1 + p |u|^2), the gain of a force where nothing is missing; (n_force,).
    """

    normal: Real
    gradient: Real
    value: Real
    expected_gain: Real

    @classmethod
    def zeros(cls, forces: int, size: int) -> "FreeForceReduction":
        """Return zero sums for some forces and a number of coordinates."""
        return cls(
            np.zeros((forces, size, size)),
            np.zeros((forces, size)),
            np.zeros(forces),
            np.zeros(forces),
        )


@dataclass(frozen=True, eq=False)
class SensorColumns:
    """Derivatives by a sensor's own coordinates, which change its own rows alone.

    Args:
        projection: index of its body's projection.
        projected: derivatives in that projection; (n_freq, n_in, 2, m, n_own).
        weighted: weighted derivatives of its rows; (n_freq, n_in, 2, n_row, n_own).
        target: weighted residual of its rows; (n_freq, n_in, 2, n_row).
    """

    projection: int
    projected: Real
    weighted: Real
    target: Real


@dataclass(frozen=True, eq=False)
class _StackedSensors:
    """Derivatives by the own coordinates of all sensors of one body.

    Args:
        projection: index of the body's projection.
        projected: derivatives in that projection; (n_freq, n_in, 2, m, n_column).
        blocks: block of each column; (n_column,).
        rows: its row in that block; (n_column,).
    """

    projection: int
    projected: Real
    blocks: Integers
    rows: Integers


@dataclass(frozen=True, eq=False)
class WeightedJacobian:
    """Weighted derivatives of one batch, summed over lines in chunks that fit into memory.

    Args:
        partition: shared coordinates and blocks of sensors.
        forward: derivatives by the shared parameters, times d theta / dx.
        projections: projection of the channels of each body.
        sensors: derivatives by each sensor's own coordinates.
    """

    partition: CoordinatePartition
    forward: ForwardSensitivities
    projections: tuple[BodyProjection, ...]
    sensors: tuple[SensorColumns, ...] = ()

    @property
    def values_per_line(self) -> int:
        """Number of values of the shared columns on one line."""
        n_in = self.projections[0].target.shape[1] if self.projections else 1
        return max(2 * n_in * self._n_projected * self.forward.count, 1)

    @property
    def _n_projected(self) -> int:
        """Number of projected values per line and input, over all bodies."""
        return self.projections[-1].span.stop if self.projections else 0

    def sums(self, groups: Integers, threads: int) -> list[tuple[Real, ...]]:
        """Return the sums of the normal equations for each group of lines.

        Chunks are summed in order, so that the result does not depend on the number of threads.

        Args:
            groups: group of each line, from 0; (n_freq,).
            threads: threads that form the chunks.

        Returns:
            Five sums for each group: S (n_s, n_s), the gradient by the shared coordinates (n_s,),
            C (n_block, n_own, n_s), O (n_block, n_own, n_own), and the gradient by the blocks'
            coordinates (n_block, n_own).
        """
        spans = list(split_lines(groups, max(1, MAX_JACOBIAN_VALUES // self.values_per_line)))
        totals: dict[int, tuple[Real, ...]] = {}
        self.forward.prepare()
        _ = self._stacked_sensors
        with ThreadPoolExecutor(threads) as pool:
            chunks = pool.map if threads > 1 else map
            for span, parts in zip(spans, chunks(self._sum_shared, spans), strict=True):
                _add_parts(totals, int(groups[span.start]), parts)
        of_blocks: dict[int, tuple[Real, ...]] = {}
        for span in split_lines(groups, len(groups)):
            _add_parts(of_blocks, int(groups[span.start]), self._sum_blocks(span))
        return [totals[group] + of_blocks[group] for group in range(int(groups.max()) + 1)]

    def _sum_shared(self, span: slice) -> tuple[Real, ...]:
        """Return S, the gradient by the shared coordinates, and C over one chunk of lines."""
        columns = self.columns(span)
        flat = flatten(columns)
        cross = np.zeros((*self.partition.block_coordinates.shape, columns.shape[-1]))
        for stacked in self._stacked_sensors:
            of_body = flatten(columns[..., self.projections[stacked.projection].span, :])
            products = flatten(stacked.projected[span]).T @ of_body
            cross[stacked.blocks, stacked.rows] = products
        return flat.T @ flat, flat.T @ self.target(span), cross

    def _sum_blocks(self, span: slice) -> tuple[Real, ...]:
        """Return O and the gradient by the blocks' coordinates over one run of lines."""
        n_block, n_own = self.partition.block_coordinates.shape
        blocks, slopes = np.zeros((n_block, n_own, n_own)), np.zeros((n_block, n_own))
        for number, sensor in enumerate(self.sensors):
            part, count = flatten(sensor.weighted[span]), sensor.projected.shape[-1]
            blocks[number, :count, :count] = part.T @ part
            slopes[number, :count] = part.T @ sensor.target[span].ravel()
        return blocks, slopes

    @cached_property
    def _stacked_sensors(self) -> tuple["_StackedSensors", ...]:
        """Sensors of each body side by side: one product serves them all."""
        stacked = []
        for projection in sorted({sensor.projection for sensor in self.sensors}):
            numbers = [k for k, s in enumerate(self.sensors) if s.projection == projection]
            projected = [self.sensors[k].projected for k in numbers]
            counts = [values.shape[-1] for values in projected]
            rows = np.concatenate([np.arange(count) for count in counts])
            stacked.append(
                _StackedSensors(
                    projection, np.concatenate(projected, -1), np.repeat(numbers, counts), rows
                )
            )
        return tuple(stacked)

    def add_force_reduction(self, forces: Real, powers: Real, sums: FreeForceReduction) -> None:
        """Add the reduction by forces whose spectra are free.

        Each force has a Gaussian prior of variance p on each line; it is integrated out by the
        Woodbury identity.

        Args:
            forces: generalised forces at the joints' coordinates; (nv, n_force).
            powers: p |u|^2 of the median line, for each force; (n_force,).
            sums: sums to which to add.
        """
        spans, responses, sizes, middle = self._respond_to_forces(forces)
        variance = powers / middle
        for span, response, size in zip(spans, responses, sizes, strict=True):
            root = np.sqrt(variance / (1 + variance * size))
            weights = (root[:, :, None] * response).conj().swapaxes(2, 3)
            columns = self._all_columns(span)
            removed = weights @ columns  # (n_line, n_in, n_force, n_x)
            force_targets = (weights @ self._complex_target(span)[..., None])[..., 0]
            n_line, n_in, n_force, size_x = removed.shape
            flat = removed.transpose(2, 0, 1, 3).reshape(n_force, n_line * n_in, size_x)
            parts = np.concatenate([flat.real, flat.imag], axis=1)
            flat_targets = force_targets.transpose(2, 0, 1).reshape(len(sums.value), -1)
            targets = np.concatenate([flat_targets.real, flat_targets.imag], axis=1)
            for normal, of_force in zip(sums.normal, parts, strict=True):
                np.add(normal, of_force.T @ of_force, out=normal)
            sums.gradient[:] += (targets[:, None] @ parts)[:, 0]
            sums.value[:] += 0.5 * (targets**2).sum(axis=1)
            sums.expected_gain[:] += np.log1p(variance * size).sum(axis=(0, 1))

    def force_gains(self, forces: Real, powers: Real) -> Real:
        """Return the gain of forces whose spectra are free, if nothing else varies.

        Args:
            forces: generalised forces at the joints' coordinates; (nv, n_force).
            powers: p |u|^2 of the median line; (n_power,).

        Returns:
            (n_power, n_force).
        """
        spans, responses, sizes, middle = self._respond_to_forces(forces)
        gains = np.zeros((len(powers), forces.shape[1]))
        for span, response, size in zip(spans, responses, sizes, strict=True):
            target = self._complex_target(span)[:, :, None]
            projected = np.abs(target @ response.conj())[:, :, 0] ** 2
            for k, variance in enumerate(np.divide.outer(powers, middle)):
                explained = variance / (1 + variance * size) * projected
                gains[k] += (explained / 2 - np.log1p(variance * size)).sum(axis=(0, 1))
        return gains

    def _respond_to_forces(
        self, forces: Real
    ) -> tuple[list[slice], list[Complex], list[Real], Real]:
        """Return spans of lines, weighted responses, their |u|^2, and its median over lines."""
        self.forward.prepare()
        n_freq = len(self.forward.solution.values)
        step = max(1, _MAX_FORCE_VALUES // self.values_per_line)
        spans = list(split_lines(np.zeros(n_freq, int), step))
        responses = [self._force_responses(forces, span) for span in spans]
        sizes = [(np.abs(response) ** 2).sum(axis=2) for response in responses]
        middle = np.median(np.concatenate(sizes), axis=(0, 1))
        return spans, responses, sizes, np.where(middle > 0, middle, 1.0)

    def _complex_target(self, span: slice) -> Complex:
        """Return the weighted residual that the shared columns fit; (n_line, n_in, m)."""
        target = np.concatenate([projection.target[span] for projection in self.projections], -1)
        return target[:, :, 0] + 1j * target[:, :, 1]

    def _force_responses(self, forces: Real, span: slice) -> Complex:
        """Return weighted responses to unit forces at the joints; (n_line, n_in, m, n_force)."""
        adjoints = self.forward.output_adjoints(span)
        per_force = (adjoints[:, :, 0] @ forces + 1j * (adjoints[:, :, 1] @ forces))[:, None]
        return np.concatenate(
            [
                projection.matrix[span] @ per_force[:, :, projection.rows]
                for projection in self.projections
            ],
            axis=2,
        )

    def _all_columns(self, span: slice) -> Complex:
        """Return weighted columns of all coordinates; (n_line, n_in, m, n_x)."""
        columns = self.columns(span)
        partition = self.partition
        size = len(partition.shared_coordinates) + int((partition.block_coordinates >= 0).sum())
        all_columns = np.zeros((*columns.shape[:2], columns.shape[3], size), complex)
        all_columns[..., partition.shared_coordinates] = columns[:, :, 0] + 1j * columns[:, :, 1]
        for sensor, at in zip(self.sensors, partition.block_coordinates, strict=True):
            projected = sensor.projected[span]
            all_columns[:, :, self.projections[sensor.projection].span, at[at >= 0]] = (
                projected[:, :, 0] + 1j * projected[:, :, 1]
            )
        return all_columns

    def target(self, span: slice) -> Real:
        """Return the weighted residual that the shared columns fit, flattened like them."""
        return np.concatenate(
            [projection.target[span] for projection in self.projections], axis=-1
        ).ravel()

    def projected_adjoints(self, span: slice) -> Real:
        """Return A, weighted FRFs per pseudo-force, real and imaginary parts one after the other.

        Returns:
            (n_line, n_in, 2 m, 2 nv).
        """
        adjoints = self.forward.output_adjoints(span)
        n_line, n_in, nv = len(adjoints), self.projections[0].target.shape[1], adjoints.shape[-1]
        flat_adjoints = adjoints.reshape(n_line, 1, -1, 2 * nv)
        projected_adjoints = np.empty((n_line, n_in, 2, self._n_projected, 2, nv))
        for projection in self.projections:
            projected = (projection.matrix[span] @ flat_adjoints[:, :, projection.rows]).reshape(
                n_line, n_in, -1, 2, nv
            )
            projected_adjoints[:, :, 0, projection.span, 0] = projected_adjoints[
                :, :, 1, projection.span, 1
            ] = projected[..., 0, :]
            projected_adjoints[:, :, 1, projection.span, 0] = projected[..., 1, :]
            np.negative(projected[..., 1, :], out=projected_adjoints[:, :, 0, projection.span, 1])
        return projected_adjoints.reshape(n_line, n_in, -1, 2 * nv)

    def columns(self, span: slice) -> Real:
        """Return weighted columns of the shared coordinates; (n_line, n_in, 2, m, n_s)."""
        forward = self.forward
        forces = forward.pseudo_forces(span)
        n_line, n_in, _, nv, count = forces.shape
        columns = (
            self.projected_adjoints(span) @ forces.reshape(n_line, n_in, 2 * nv, count)
        ).reshape(n_line, n_in, 2, self._n_projected, count)
        for term in forward.kinematic_terms(span):
            for projection in self.projections:
                body_motion = (projection.matrix[span] @ projection.rigid_motion)[:, :, None]
                columns[..., projection.span, term.indices] += (
                    body_motion @ term.values[..., projection.body_columns, :]
                )
        for term in forward.readout_terms(span):
            for projection in self.projections:
                projected = (
                    projection.matrix[span][:, :, None] @ term.values[..., projection.rows, :]
                )
                columns[..., projection.span, term.indices] += projected
        return columns


def split_lines(groups: Integers, max_lines: int) -> Iterator[slice]:
    """Yield chunks of lines, each of one group and of at most ``max_lines`` lines."""
    ends = [0, *(np.flatnonzero(np.diff(groups)) + 1), len(groups)]
    for first, last in pairwise(ends):
        for start in range(int(first), int(last), max_lines):
            yield slice(start, min(start + max_lines, int(last)))


def flatten(columns: Real) -> Real:
    """Reshape (.., n) to (rows, n)."""
    return columns.reshape(prod(columns.shape[:-1]), columns.shape[-1])


def _add_parts(totals: dict[int, tuple[Real, ...]], group: int, parts: tuple[Real, ...]) -> None:
    """Add sums over some lines to those of their group."""
    sums = totals.setdefault(group, parts)
    if sums is not parts:
        for total, part in zip(sums, parts, strict=True):
            np.add(total, part, out=total)
