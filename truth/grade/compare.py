r"""The drawing against the measurement, channel by channel, as the classical measures have it.

For a channel c of measured H and drawn D, over the lines of the band,

    FRAC_c = |sum H D*|^2 / (sum |H|^2 sum |D|^2),   residual_c = sqrt(sum |H - D|^2 / sum |H|^2),

and for a coordinate i (an output), over all lines, hits and files, as the COMAC has it over modes,

    COMAC_i = (sum |H| |D|)^2 / (sum |H|^2 sum |D|^2).

The drawing's FRFs come from this package's own twin, hit exactly where the drawing says. Channels
whose noise is more than 0.3 of their signal are left out, as far as a coherence tells.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truth.errors import TruthError
from truth.grade.json_reading import items, number, read_bytes, table, text
from truth.grade.uff_reader import Channel, Measured, read_uff
from truth.machine.mujoco_reader import read_station
from truth.machine.rig import Prepared, accelerance, build
from truth.machine.station import Complex, Hammer, Mask, Real, Station

_NOISY = 0.3
_COHERENT = 0.5


@dataclass(frozen=True)
class Agreement:
    """How a channel, or a coordinate, of the drawing agrees with the measured one.

    Args:
        node, axis: of the output; the axis is 1, 2 or 3.
        frac, residual: of a channel.
    """

    node: int
    axis: int
    frac: float
    residual: float


@dataclass(frozen=True, eq=False)
class DrawingComparison:
    """A campaign against its drawing.

    Args:
        station: the drawing.
        nodes: where the hammer hits.
        channels: every channel that counts, of all files.
        coordinates: COMAC of each output (node, axis) of these channels.
    """

    station: Station
    nodes: tuple[int, ...]
    channels: tuple[Agreement, ...]
    coordinates: Mapping[tuple[int, int], float]


def compare(folder: Path) -> DrawingComparison:
    """Compare a campaign with its drawing.

    Raises:
        TruthError: a file is missing, or is none of those that this package writes.
    """
    tests, model = _tests(folder / "campaign.toml")
    station = read_station(folder / model)
    if any(not file.endswith(".uff") for file, _ in tests):
        raise TruthError(f"{folder.name}: baselines read universal files, and its tests are arrays")
    measured = [(read_uff(folder / file), averages) for file, averages in tests]
    drawn: dict[tuple[object, ...], Complex] = {}
    channels: list[tuple[Agreement, float]] = []
    sums: dict[tuple[int, int], Real] = {}
    for test, averages in measured:
        key = (test.freq_hz.tobytes(), test.references)
        if key not in drawn:
            drawn[key] = _drawn_frf(station, test)
        band = _band(test)
        values = drawn[key][:, _rows(station, test.responses)] * _signs(test.responses)
        parts = channel_sums(test.frf[band], values[band])
        noise = _noise(test, band, averages)
        for out, into in zip(*np.nonzero(test.present & (parts[0] > 0)), strict=True):
            node, direction = test.responses[out]
            part = parts[:, out, into]
            place = (node, abs(direction))
            channels.append((Agreement(*place, *channel_measures(part)), float(noise[out, into])))
            if noise[out, into] <= _NOISY:
                sums[place] = sums.get(place, np.zeros(3)) + part[[0, 1, 4]]
    quiet = tuple(agreement for agreement, noise in channels if noise <= _NOISY)
    if not quiet:
        raise TruthError(f"{folder.name}: no channel stands out of its noise")
    nodes = tuple(dict.fromkeys(node for test, _ in measured for node, _ in test.references))
    return DrawingComparison(
        station, nodes, quiet, {place: comac(total) for place, total in sums.items()}
    )


def _tests(path: Path) -> tuple[list[tuple[str, float | None]], str]:
    """Return file and averages of each test, and the model's name."""
    try:
        given = tomllib.loads(read_bytes(path).decode("utf-8"))
    except ValueError as error:
        raise TruthError(f"{path.name}: is not TOML ({error})") from error
    table(given, path.name, "model", "test")
    if "sensor" in given:
        raise TruthError(f"{path.name}: [sensor] is not handled; the drawing must say it all")
    tests: list[tuple[str, float | None]] = []
    for item in items(given["test"], "test"):
        test = table(item, "test", "file")
        if test.get("window_tau", 0.0) != 0.0:
            raise TruthError(f"{path.name}: an exponential window is not handled")
        averages = test.get("averages")
        count = None if averages is None else number(averages, "averages", 2.0)
        tests.append((text(test["file"], "file"), count))
    return tests, text(given["model"], "model")


def _drawn_frf(station: Station, test: Measured) -> Complex:
    """The drawing's accelerance at a file's hits; (n_freq, n_sensor x 3, n_in)."""
    hammers = []
    for node, direction in test.references:
        stage, point = station.aim(node)
        axis = np.sign(direction) * station.aim_axes(node)[abs(direction) - 1]
        hammers.append(Hammer(node, stage, point, axis))
    return accelerance(build(Prepared(station, tuple(hammers))), test.freq_hz)


def _rows(station: Station, responses: tuple[Channel, ...]) -> list[int]:
    points = [sensor.node for _, sensor in station.sensors()]
    unknown = sorted({node for node, _ in responses} - set(points))
    if unknown:
        raise TruthError(f"node {unknown[0]}: was measured, but the drawing has no acc{unknown[0]}")
    return [3 * points.index(node) + abs(direction) - 1 for node, direction in responses]


def _signs(responses: tuple[Channel, ...]) -> Real:
    return np.sign([direction for _, direction in responses]).astype(np.float64)[:, None]


def _band(test: Measured) -> Mask:
    """From the first to the last line whose median coherence is over 0.5; else all but 0 Hz."""
    if test.coherence is None:
        return np.asarray(test.freq_hz > 0)
    good = np.flatnonzero(np.median(test.coherence[:, test.present], axis=1) > _COHERENT)
    if not good.size:
        raise TruthError("no line has a median coherence over 0.5")
    band = np.zeros(test.freq_hz.size, dtype=np.bool_)
    band[good[0] : good[-1] + 1] = True
    return band


def _noise(test: Measured, band: Mask, averages: float | None) -> Real:
    """Noise over signal of each channel, sqrt(sum var / sum |H|^2); 0 where nothing tells."""
    if test.coherence is None or averages is None:
        return np.zeros(test.present.shape)
    power, coherence = np.abs(test.frf[band]) ** 2, np.maximum(test.coherence[band], 1e-12)
    variance = power * np.maximum(1 - coherence, 0.0) / (coherence * (averages - 1))
    return np.asarray(np.sqrt(variance.sum(axis=0) / np.maximum(power.sum(axis=0), 1e-300)))


def channel_sums(measured: Complex, drawn: Complex) -> Real:
    """Return sums over lines of |H|^2, |D|^2, |H - D|^2, |sum H D*|^2, |H||D|; (5, n_out, n_in)."""
    return np.array(
        [
            (np.abs(measured) ** 2).sum(axis=0),
            (np.abs(drawn) ** 2).sum(axis=0),
            (np.abs(measured - drawn) ** 2).sum(axis=0),
            np.abs((measured * drawn.conj()).sum(axis=0)) ** 2,
            (np.abs(measured) * np.abs(drawn)).sum(axis=0),
        ]
    )


def channel_measures(sums: Real) -> tuple[float, float]:
    """Return FRAC and relative residual of a channel from its sums; (5,)."""
    measured, drawn, apart, cross, _ = sums.tolist()
    return cross / (measured * drawn) if drawn > 0 else 0.0, float(np.sqrt(apart / measured))


def comac(sums: Real) -> float:
    """Return the COMAC of an output from its sums of |H|^2, |D|^2 and |H||D|; (3,)."""
    measured, drawn, cross = sums.tolist()
    return cross**2 / (measured * drawn) if drawn > 0 else 0.0
