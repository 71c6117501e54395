"""Partition of the coordinates: those that all channels share, and those of one sensor alone."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from identification.words import Complex, Integers, Mask, Real
from mbmodel import Change, ForwardSensitivities, Model, Part
from tuning.parametrisation.parametrisation import Parametrisation


@dataclass(frozen=True, eq=False)
class CoordinatePartition:
    """Partition of a model's coordinates for the arrow normal equations.

    Args:
        shared_parameters: whether each parameter has columns in all channels; (n_parameter,).
        shared_coordinates: their coordinates in that order, each once; (n_s,).
        places: number of each shared parameter's coordinate among those; (n_shared_parameter,).
        sensor_parts: indices of the Parts whose coordinates form a block each; n_block.
        block_coordinates: coordinates of each block, -1 for missing ones; (n_block, n_own).
        sensor_parameters: whether each parameter belongs to one sensor alone; (n_parameter,).
    """

    shared_parameters: Mask
    shared_coordinates: Integers
    places: Integers
    sensor_parts: tuple[int, ...]
    block_coordinates: Integers
    sensor_parameters: Mask

    def sensor_columns(
        self, forward: ForwardSensitivities, rates: Real
    ) -> Iterator[tuple[Integers, Complex, Integers]]:
        """Yield derivatives by each sensor's own coordinates, before the factors of the readings.

        Args:
            forward: derivatives by the parameters of sensors.
            rates: d theta / dx; (n_parameter,).

        Yields:
            Rows that the sensor changes, derivatives (n_freq, n_row, n_in, n_own), and coordinates.
        """
        model = forward.solution.model
        pieces = zip(
            model.split_parameters(rates),
            model.split_parameters(self.sensor_parameters),
            strict=True,
        )
        rates_of_part = [rate[mask] for rate, mask in pieces]
        for part, at in zip(self.sensor_parts, self.block_coordinates, strict=True):
            rows, values = forward.sensor_rows(part)
            yield rows, values * rates_of_part[part], at[at >= 0]


def partition_coordinates(
    model: Model, parametrisation: Parametrisation, *, separate_channels: bool = True
) -> CoordinatePartition:
    """Partition the coordinates into shared ones and a block for each sensor.

    A sensor has a block if its coordinates change its own rows only.

    Args:
        separate_channels: whether channels have weights of their own; if they are weighted
            together with those of their body, there are no blocks.
    """
    is_plain = _find_plain(model, parametrisation.free)
    free_of_parts, coordinates_of_parts = (
        model.split_parameters(parametrisation.free),
        model.split_parameters(parametrisation.coordinate_of),
    )
    shared = parametrisation.free.copy()
    spans = np.cumsum([0, *(len(part.parameters) for part in model.parts)])
    sensor_parts: list[int] = []
    blocks: list[Integers] = []
    for number, (part, free, coordinates_of_part) in enumerate(
        zip(model.parts, free_of_parts, coordinates_of_parts, strict=True)
    ):
        coordinates = coordinates_of_part[free]
        is_exclusive = (
            np.isin(parametrisation.coordinate_of, coordinates).sum()
            == len(np.unique(coordinates))
            == len(coordinates)
        )
        if separate_channels and len(coordinates) and is_exclusive and is_plain[part]:
            sensor_parts.append(number)
            blocks.append(coordinates)
            shared[spans[number] : spans[number + 1]] = False
    block_coordinates = np.full(
        (len(blocks), max((len(coordinates) for coordinates in blocks), default=0)), -1
    )
    for row, coordinates in zip(block_coordinates, blocks, strict=True):
        row[: len(coordinates)] = coordinates
    shared_members = parametrisation.coordinate_of[shared]
    place_of = {member: k for k, member in enumerate(dict.fromkeys(shared_members.tolist()))}
    shared_coordinates = np.array(list(place_of), np.intp)
    places = np.array([place_of[member] for member in shared_members.tolist()], np.intp)
    return CoordinatePartition(
        shared,
        shared_coordinates,
        places,
        tuple(sensor_parts),
        block_coordinates,
        parametrisation.free & ~shared,
    )


# Whether each Part in use changes the rows of one sensor alone.
_PLAIN: WeakKeyDictionary[Part, bool] = WeakKeyDictionary()


def _find_plain(model: Model, free: Mask) -> Mapping[Part, bool]:
    """Return whether each Part with free parameters changes the rows of one sensor alone."""
    is_new = [part not in _PLAIN for part in model.parts]
    chosen = free & np.repeat(is_new, [len(part.parameters) for part in model.parts])
    if chosen.any():
        slopes = model.slopes(model.drawn, None, chosen)
        for part, mask, changes in zip(
            model.parts, model.split_parameters(chosen), slopes, strict=True
        ):
            if mask.any():
                _PLAIN[part] = _is_plain(changes)
    return _PLAIN


def _is_plain(changes: tuple[Change, ...]) -> bool:
    """Return whether changes are those of one sensor's rows and readings, without a shape."""
    if not changes or len({change.point for change in changes}) > 1:
        return False
    return all(
        change.shape is None
        and (change.slot == "output" or (change.slot == "sensor" and not change.core[:, 1:].any()))
        for change in changes
    )
