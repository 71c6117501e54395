"""Nominal values of unknown gains, from the nominal model before any fit.

A channel i of an unknown gain and a force channel j of an unknown gain read H_measured = g_i h_j H.
The logarithms add, so that each cell (channel, test) states

    median over lines of ln |H_measured / H_nominal| = ln |g_i| + ln |h_j| + error,

a two-way additive model. It is fitted by least absolute deviations (iteratively reweighted least
squares), so that a few wrong cells do not matter. The signs follow from the mean cosine of the
phase between both. Stiffness that is off moves all resonances: the nominal FRFs are stretched along
frequency by one factor a, which for the accelerance equals a factor a^2 on all stiffnesses, and the
stretch with the best agreement of phases counts. The FRFs are then divided by the gains found, and
around these a gain is a parameter with a wide prior.

In a group of channels and tests without any known gain, only products g_i h_j are seen. The gain of
one of its hammers is then set to 1, and the channels' gains are stated as products.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Complex,
    Dof,
    Frf,
    Integers,
    Mask,
    NominalGain,
    Output,
    Real,
    Test,
)
from mbmodel import Machine, as_drawn
from mbmodel.frf.ports import find_ports
from tuning.misfit.batch import predict

_Node = tuple[str, str | None]  # location and direction of an unknown gain


@dataclass(frozen=True)
class _Settings:
    """Constants of the estimate."""

    # Factors on frequency: stiffness off by up to a factor of 2, in steps below a mode's spacing.
    stretches: tuple[float, ...] = tuple(np.exp(np.linspace(-0.36, 0.36, 19)).tolist())
    max_lines: int = 240  # of the nominal FRFs: medians over more change nothing
    min_power_ratio: float = 9.0  # |H|^2 over its variance, below which a line does not count
    min_lines: int = 6  # of a cell
    min_motion_ratio: float = 1e-9  # of the largest FRF: below it the nominal channel is still
    smallest_residual: float = 0.02  # ln of a factor, where deviations stop to count as absolute
    iterations: int = 40
    max_flipped_hammers: int = 8  # whose signs are all tried
    min_sign_agreement: float = 0.25  # mean cosine below which a sign is uncertain


_SETTINGS = _Settings()


@dataclass(frozen=True)
class _Cell:
    """One FRF with an unknown gain.

    Args:
        nodes: unknown gains that it holds, the channel's and the force channel's.
        level: median of ln |H_measured / H_nominal|.
        cosine: mean cosine of the phase between both.
    """

    nodes: tuple[_Node, ...]
    level: float
    cosine: float


def divide_by_unknown_gains(machine: Machine, campaign: Campaign) -> Campaign:
    """Return the campaign divided by the nominal values of its unknown gains, with remarks.

    Args:
        machine: the nominal machine.
        campaign: tests on the lines of the band.
    """
    if not campaign.unknown_gains:
        return campaign
    cells = _compare_cells(machine, campaign)
    nodes = list(dict.fromkeys(node for cell in cells for node in cell.nodes))
    references, groups = _product_groups(cells, nodes)
    levels = _fit_levels(cells, nodes, references)
    signs, uncertain = _fit_signs(cells, nodes, references)
    gains = {node: float(signs[k] * np.exp(levels[k])) for k, node in enumerate(nodes)}
    of_products = {node for group in groups for node in group if node[1] is not None}
    nominal = tuple(
        NominalGain(*node, gain, node in of_products)
        for node, gain in gains.items()
        if node not in references
    )
    remarks = (
        *(_product_sentence(group) for group in groups),
        *(
            f"the sign of the gain of {NominalGain(*nodes[k], 1.0).label} is uncertain: the "
            "nominal model is too far from the measurement; check it at a drive point"
            for k in uncertain
        ),
        *_missing_sentences(campaign, set(nodes)),
    )
    return replace(
        campaign,
        tests=tuple(_divide(test, gains) for test in campaign.tests),
        unknown_gains=replace(campaign.unknown_gains, nominal=nominal),
        remarks=(*campaign.remarks, *remarks),
    )


def _channel_node(dof: Output) -> _Node:
    """Return location and direction of a channel's gain; a signal has a single channel."""
    return f"sensor:{dof.point}", dof.direction[1:] if isinstance(dof, Dof) else ""


def _nodes_of(campaign: Campaign, test: Test, dof: Output) -> tuple[_Node, ...]:
    """Return the unknown gains in the FRF of a channel."""
    unknown, nodes = campaign.unknown_gains, list[_Node]()
    if dof.point in unknown.sensors:
        nodes.append(_channel_node(dof))
    if test.condition.instrument in unknown.hammers:
        nodes.append((f"hammer:{test.condition.instrument}", None))
    return tuple(nodes)


def _compare_cells(machine: Machine, campaign: Campaign) -> list[_Cell]:
    """Return the cells with unknown gains at the stretch whose phases agree best."""
    stride = max(1, len(campaign.freq_hz) // _SETTINGS.max_lines)
    lines = np.zeros(len(campaign.freq_hz), bool)
    lines[::stride] = True
    thin = campaign.select_lines(lines & (campaign.freq_hz > 0))
    model = as_drawn(machine)
    best: list[_Cell] = []
    for stretch in _SETTINGS.stretches:
        predicted = predict(model, model.drawn, _stretch(thin, 1 / stretch))
        scaled = [
            values * stretch ** (_orders_of(machine, test.estimate.frf)[:, None] - 2.0)
            for test, values in zip(thin.tests, predicted, strict=True)
        ]
        cells = _cells(thin, scaled)
        agreement = sum(abs(cell.cosine) for cell in cells)
        if not best or agreement > sum(abs(cell.cosine) for cell in best):
            best = cells
    return best


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


def _cells(campaign: Campaign, predicted: Sequence[Complex]) -> list[_Cell]:
    """Compare measured and nominal FRFs, cell by cell."""
    cells = []
    for test, values in zip(campaign.tests, predicted, strict=True):
        estimate = test.estimate
        largest = np.abs(values).max(initial=0.0)
        for row, dof in enumerate(estimate.frf.outputs):
            nodes = _nodes_of(campaign, test, dof)
            measured, nominal = estimate.frf.values[:, row, 0], values[:, row, 0]
            power = np.abs(measured) ** 2
            counts = (power > 0) & (
                power >= _SETTINGS.min_power_ratio * estimate.variance[:, row, 0]
            )
            counts &= np.abs(nominal) > _SETTINGS.min_motion_ratio * largest
            if nodes and estimate.measured[row, 0] and counts.sum() >= _SETTINGS.min_lines:
                cells.append(_Cell(nodes, *_level_and_cosine(measured, nominal, counts)))
    return cells


def _level_and_cosine(measured: Complex, nominal: Complex, counts: Mask) -> tuple[float, float]:
    """Return the median of ln |measured / nominal| and the mean cosine of its phase."""
    ratio = measured[counts] / nominal[counts]
    size = np.abs(ratio)
    return float(np.median(np.log(size))), float((ratio.real / size).mean())


def _product_groups(
    cells: Sequence[_Cell], nodes: Sequence[_Node]
) -> tuple[set[_Node], list[list[_Node]]]:
    """Return the groups of gains that no known gain anchors, and one hammer of each.

    A cell with one unknown gain anchors it, since the other gain of that cell is known.
    """
    group_of = {node: node for node in nodes}

    def root(node: _Node) -> _Node:
        while group_of[node] != node:
            node = group_of[node]
        return node

    for cell in cells:
        for node in cell.nodes[1:]:
            group_of[root(node)] = root(cell.nodes[0])
    anchored = {root(cell.nodes[0]) for cell in cells if len(cell.nodes) == 1}
    groups: dict[_Node, list[_Node]] = {}
    for node in nodes:
        if root(node) not in anchored:
            groups.setdefault(root(node), []).append(node)
    references = {
        next(node for node in group if node[0].startswith("hammer:")) for group in groups.values()
    }
    return references, list(groups.values())


def _fit_levels(cells: Sequence[_Cell], nodes: Sequence[_Node], fixed: set[_Node]) -> Real:
    """Fit ln |gain| of each node by least absolute deviations, zero for fixed ones; (n_node,)."""
    if not nodes:
        return np.zeros(0)
    design = np.array(
        [[float(node in cell.nodes and node not in fixed) for node in nodes] for cell in cells]
    )
    target = np.array([cell.level for cell in cells])
    root_weight, levels = np.ones(len(cells)), np.zeros(len(nodes))
    for _ in range(_SETTINGS.iterations):
        levels = np.linalg.lstsq(root_weight[:, None] * design, root_weight * target)[0]
        residual = np.maximum(np.abs(target - design @ levels), _SETTINGS.smallest_residual)
        root_weight = 1 / np.sqrt(residual)
    fitted: Real = levels
    return fitted


def _fit_signs(
    cells: Sequence[_Cell], nodes: Sequence[_Node], fixed: set[_Node]
) -> tuple[Real, list[int]]:
    """Return the sign of each gain, and the numbers of those whose sign is uncertain.

    The signs maximise the sum of cosines. All signs of the first hammers are tried, and the others
    follow one by one until none changes.
    """
    if not nodes:
        return np.zeros(0), []
    number = {node: k for k, node in enumerate(nodes)}
    members = [[number[node] for node in cell.nodes] for cell in cells]
    cosines = np.array([cell.cosine for cell in cells])
    cells_of: list[list[int]] = [[] for _ in nodes]
    for k, cell_nodes in enumerate(members):
        for node in cell_nodes:
            cells_of[node].append(k)
    held = {number[node] for node in fixed}
    hammers = [k for k, node in enumerate(nodes) if node[1] is None and k not in held]
    hammers = hammers[: _SETTINGS.max_flipped_hammers]
    best, best_sum = np.ones(len(nodes)), -np.inf
    for choice in product((1.0, -1.0), repeat=len(hammers)):
        signs = np.ones(len(nodes))
        signs[hammers] = choice
        for _ in nodes:
            before = signs.copy()
            for k in (k for k in range(len(nodes)) if k not in held):
                vote = sum(signs[members[c]].prod() * cosines[c] for c in cells_of[k]) * signs[k]
                signs[k] = -1.0 if vote < 0 else 1.0
            if (signs == before).all():
                break
        total = float(sum(signs[m].prod() * c for m, c in zip(members, cosines, strict=True)))
        if total > best_sum:
            best, best_sum = signs, total
    agreement = np.array(
        [np.mean([best[members[c]].prod() * cosines[c] for c in of_node]) for of_node in cells_of]
    )
    uncertain = np.flatnonzero(agreement < _SETTINGS.min_sign_agreement)
    return best, [int(k) for k in uncertain if int(k) not in held]


def _divide(test: Test, gains: dict[_Node, float]) -> Test:
    """Return a test with its FRFs divided by the gains."""
    estimate = test.estimate
    hammer = gains.get((f"hammer:{test.condition.instrument}", None), 1.0)
    factors = np.array(
        [hammer * gains.get(_channel_node(dof), 1.0) for dof in estimate.frf.outputs]
    )[None, :, None]
    frf = replace(estimate.frf, values=estimate.frf.values / factors)
    divided = replace(estimate, frf=frf, variance=estimate.variance / factors**2)
    return replace(test, estimate=divided)


def _product_sentence(group: Sequence[_Node]) -> str:
    """Return a sentence on gains of which only products are seen."""
    hammers = [node[0].partition(":")[2] for node in group if node[1] is None]
    sensors = dict.fromkeys(node[0].partition(":")[2] for node in group if node[1] is not None)
    return (
        f"only the products of the gains of {', '.join(sensors)} and of the force channel "
        f"{' or '.join(hammers)} are seen, since both are unknown: the gain of {hammers[0]} is "
        "set to 1; state one of them to know the others"
    )


def _missing_sentences(campaign: Campaign, estimated: set[_Node]) -> list[str]:
    """Return sentences on unknown gains that no FRF shows."""
    nodes = {
        node
        for test in campaign.tests
        for dof in test.estimate.frf.outputs
        for node in _nodes_of(campaign, test, dof)
    }
    labels = sorted(NominalGain(*node, 1.0).label for node in nodes - estimated)
    if not labels:
        return []
    return [
        f"the gain of {', '.join(labels)} is unknown and stays so: there is no motion above the "
        "noise that the model predicts"
    ]
