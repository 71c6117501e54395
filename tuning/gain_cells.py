r"""Cells (channel, test) with unknown gains: level and phase of the measurement over the model.

Stiffness that is off moves all resonances: the nominal FRFs are stretched along frequency by one
factor a, which for the accelerance equals a factor a^2 on all stiffnesses. A drive or an encoder of
unknown gain may come late, as amplifiers and converters do: exp(-i w tau) turns the phases of all
its cells. The stretch and the delays with the best agreement of phases count. Delays are taken one
after the other, and only if the phases agree much better with them, since a short one and wrong
stiffness look alike.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Complex,
    Dof,
    Frf,
    Integers,
    Mask,
    Output,
    Real,
    Test,
)
from mbmodel import Machine, as_drawn
from mbmodel.ports.ports import find_ports
from tuning.misfit.batch import predict

GainNode = tuple[str, str | None]  # location and direction of an unknown gain


@dataclass(frozen=True)
class _CellSettings:
    """Constants of the comparison."""

    # Factors on frequency: stiffness off by up to a factor of 2, in steps below a mode's spacing.
    stretches: tuple[float, ...] = tuple(np.exp(np.linspace(-0.36, 0.36, 19)).tolist())
    max_lines: int = 240  # of the nominal FRFs: medians over more change nothing
    min_power_ratio: float = 9.0  # |H|^2 over its variance, below which a line does not count
    min_lines: int = 6  # of a cell
    min_motion_ratio: float = 1e-9  # of the largest FRF: below it the nominal channel is still
    min_delay_range_s: float = 4e-3  # amplifiers, filters, cycles of a controller
    max_delay_step_rad: float = 0.5  # of the phase at the last line, between delays that are tried
    max_delays: int = 400  # that are tried on either side
    min_delay_gain: float = (
        0.2  # of the mean agreement, for which a delay is taken: springs off by 30 % stay below
    )


_CELL_SETTINGS = _CellSettings()


@dataclass(frozen=True, eq=False)
class GainCell:
    """One FRF with an unknown gain.

    Args:
        nodes: unknown gains that it holds, the channel's and the force channel's.
        level: median of ln |H_measured / H_nominal|.
        turns: H_measured / H_nominal over its magnitude at the lines that count; (n_freq,).
        omega: of these lines [rad/s]; (n_freq,).
        delay_s: delay of its drive and encoder that is taken off [s].
    """

    nodes: tuple[GainNode, ...]
    level: float
    turns: Complex
    omega: Real
    delay_s: float = 0.0

    @property
    def cosine(self) -> float:
        """Mean cosine of the phase between both, without the delay."""
        return float((self.turns * np.exp(1j * self.omega * self.delay_s)).real.mean())


def channel_node(dof: Output) -> GainNode:
    """Return location and direction of a channel's gain; a signal has a single channel."""
    return f"sensor:{dof.point}", dof.direction[1:] if isinstance(dof, Dof) else ""


def nodes_of(campaign: Campaign, test: Test, dof: Output) -> tuple[GainNode, ...]:
    """Return the unknown gains in the FRF of a channel."""
    unknown, nodes = campaign.unknown_gains, list[GainNode]()
    if dof.point in unknown.sensors:
        nodes.append(channel_node(dof))
    if test.condition.instrument in unknown.hammers:
        nodes.append((f"hammer:{test.condition.instrument}", None))
    return tuple(nodes)


def compare_cells(
    machine: Machine, campaign: Campaign, delay_ranges: Mapping[str, float]
) -> tuple[list[GainCell], dict[str, float]]:
    """Return the cells with unknown gains at the stretch and delays whose phases agree best.

    Args:
        campaign: tests on the lines of the band.
        delay_ranges: largest delay of each drive and encoder that its tolerance allows [s], by its
            location.

    Returns:
        The cells; the delay of each drive and encoder of unknown gain that has one [s], by its
        location.
    """
    stride = max(1, len(campaign.freq_hz) // _CELL_SETTINGS.max_lines)
    lines = np.zeros(len(campaign.freq_hz), bool)
    lines[::stride] = True
    thin = campaign.select_lines(lines & (campaign.freq_hz > 0))
    model = as_drawn(machine)
    best: tuple[list[GainCell], dict[str, float]] = [], {}
    highest = -np.inf
    for stretch in _CELL_SETTINGS.stretches:
        predicted = predict(model, model.drawn, _stretch(thin, 1 / stretch))
        scaled = [
            values * stretch ** (_orders_of(machine, test.estimate.frf)[:, None] - 2.0)
            for test, values in zip(thin.tests, predicted, strict=True)
        ]
        cells, delays, agreement = _find_delays(_cells(thin, scaled), delay_ranges)
        if agreement > highest:
            best, highest = (cells, delays), agreement
    return best


def _find_delays(
    cells: list[GainCell], delay_ranges: Mapping[str, float]
) -> tuple[list[GainCell], dict[str, float], float]:
    """Return cells without the delays of drives and encoders, these, and the agreement of phases.

    A delay counts against the agreement as much as it has to gain.
    """
    delays: dict[str, float] = {}
    late = [node for node in dict.fromkeys(node for cell in cells for node in cell.nodes)
            if not node[1]]  # fmt: skip
    cost = 0.0
    while True:
        steps = [
            _best_delay([cell for cell in cells if node in cell.nodes], node, delay_ranges)
            for node in late
            if node[0] not in delays
        ]
        gain, delay, node = max(steps, default=(0.0, 0.0, ("", None)), key=lambda step: step[0])
        if gain <= 0:
            break
        delays[node[0]] = delay
        cost += _CELL_SETTINGS.min_delay_gain * sum(node in cell.nodes for cell in cells)
        cells = [
            replace(cell, delay_s=cell.delay_s + delay) if node in cell.nodes else cell
            for cell in cells
        ]
    return cells, delays, sum(abs(cell.cosine) for cell in cells) - cost


def _best_delay(
    cells: Sequence[GainCell], node: GainNode, delay_ranges: Mapping[str, float]
) -> tuple[float, float, GainNode]:
    """Return what a further delay of a node gains beyond its cost, the delay [s], and the node."""
    tried = _delays(cells, delay_ranges.get(node[0], 0.0))
    sizes = np.zeros(len(tried))
    for cell in cells:
        turns = cell.turns * np.exp(1j * cell.omega * cell.delay_s)
        sizes += np.abs((turns @ np.exp(1j * np.outer(cell.omega, tried))).real) / len(turns)
    best = int(np.argmax(sizes))
    gain = float(sizes[best]) - sum(abs(cell.cosine) for cell in cells)
    return gain - _CELL_SETTINGS.min_delay_gain * len(cells), float(tried[best]), node


def _delays(group: Sequence[GainCell], largest: float) -> Real:
    """Return delays to be tried, on either side [s]; (n_delay,)."""
    end = max(largest, _CELL_SETTINGS.min_delay_range_s)
    fastest = max(float(cell.omega.max()) for cell in group)
    count = int(np.ceil(end * fastest / _CELL_SETTINGS.max_delay_step_rad))
    count = min(count, _CELL_SETTINGS.max_delays)
    return np.linspace(-end, end, 2 * count + 1)


def _orders_of(machine: Machine, frf: Frf) -> Integers:
    """Return the derivative that each channel reads: 0, 1, 2 for position to acceleration."""
    stated = find_ports(machine, frf.outputs, ()).orders
    quantity = DERIVATIVE_ORDER[frf.quantity]
    return np.array([quantity if order is None else order for order in stated], np.intp)


def _stretch(campaign: Campaign, factor: float) -> Campaign:
    """Return the campaign at other frequencies."""
    tests = []
    for test in campaign.tests:
        frf = replace(test.estimate.frf, freq_hz=factor * test.estimate.frf.freq_hz)
        tests.append(replace(test, estimate=replace(test.estimate, frf=frf)))
    return replace(campaign, tests=tuple(tests))


def _cells(campaign: Campaign, predicted: Sequence[Complex]) -> list[GainCell]:
    """Compare measured and nominal FRFs, cell by cell."""
    cells = []
    for test, values in zip(campaign.tests, predicted, strict=True):
        estimate = test.estimate
        largest = np.abs(values).max(initial=0.0)
        for row, dof in enumerate(estimate.frf.outputs):
            nodes = nodes_of(campaign, test, dof)
            measured, nominal = estimate.frf.values[:, row, 0], values[:, row, 0]
            power = np.abs(measured) ** 2
            counts = (power > 0) & (
                power >= _CELL_SETTINGS.min_power_ratio * estimate.variance[:, row, 0]
            )
            counts &= np.abs(nominal) > _CELL_SETTINGS.min_motion_ratio * largest
            if nodes and estimate.measured[row, 0] and counts.sum() >= _CELL_SETTINGS.min_lines:
                cells.append(_cell(nodes, measured, nominal, estimate.frf.freq_hz, counts))
    return cells


def _cell(
    nodes: tuple[GainNode, ...], measured: Complex, nominal: Complex, freq_hz: Real, counts: Mask
) -> GainCell:
    """Return a cell at the lines that count."""
    ratio = measured[counts] / nominal[counts]
    size = np.abs(ratio)
    level = float(np.median(np.log(size)))
    return GainCell(nodes, level, ratio / size, 2 * np.pi * freq_hz[counts])
