"""Nominal values of unknown gains, from the nominal model before any fit.

A channel i of an unknown gain and a force channel j of an unknown gain read H_measured = g_i h_j H.
The logarithms add, so that each cell (channel, test) states

    median over lines of ln |H_measured / H_nominal| = ln |g_i| + ln |h_j| + error,

a two-way additive model. It is fitted by least absolute deviations (iteratively reweighted least
squares), so that a few wrong cells do not matter. The signs follow from the mean cosine of the
phase between both, after stiffness that is off and late drives were allowed for (``gain_cells``).
The FRFs are then divided by the gains found, and around these a gain is a parameter with a wide
prior. They are also freed from the delay of a drive, if its tolerance allows this delay.

In a group of channels and tests without any known gain, only products g_i h_j are seen. The gain of
one of its hammers is then set to 1, and the channels' gains are stated as products.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from identification.readers.toml_files import toml_key
from identification.words import Campaign, NominalGain, Real, Test, group_by_key
from mbmodel import Machine
from tuning.gain_cells import GainCell, GainNode, channel_node, compare_cells, nodes_of


@dataclass(frozen=True)
class _Settings:
    """Constants of the estimate."""

    smallest_residual: float = 0.02  # ln of a factor, where deviations stop to count as absolute
    iterations: int = 40
    max_flipped_hammers: int = 8  # whose signs are all tried
    min_sign_agreement: float = 0.25  # mean cosine below which a sign is uncertain


_SETTINGS = _Settings()


def divide_by_unknown_gains(
    machine: Machine, campaign: Campaign, delay_ranges: Mapping[str, float]
) -> Campaign:
    """Return the campaign divided by the nominal values of its unknown gains, with remarks.

    Args:
        campaign: tests on the lines of the band.
        delay_ranges: largest delay of each drive and encoder that its tolerance allows [s], by its
            location.
    """
    if not campaign.unknown_gains:
        return campaign
    cells, delays = compare_cells(machine, campaign, delay_ranges)
    taken = {place: tau for place, tau in delays.items() if abs(tau) <= delay_ranges[place]}
    nodes = list(dict.fromkeys(node for cell in cells for node in cell.nodes))
    references, groups = _product_groups(cells, nodes)
    levels = _fit_levels(cells, nodes, references)
    signs, uncertain = _fit_signs(cells, nodes, references)
    gains = {node: float(signs[k] * np.exp(levels[k])) for k, node in enumerate(nodes)}
    of_products = {node for group in groups for node in group if node[1] is not None}
    nominal = tuple(
        NominalGain(*node, gain, node in of_products, taken.get(node[0], 0.0))
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
        *(_late_sentence(place, tau) for place, tau in delays.items() if place not in taken),
        *_missing_sentences(campaign, set(nodes)),
    )
    return replace(
        campaign,
        tests=tuple(_divide(test, gains, taken) for test in campaign.tests),
        unknown_gains=replace(campaign.unknown_gains, nominal=nominal),
        remarks=(*campaign.remarks, *remarks),
    )


def with_unit_gains(campaign: Campaign) -> Campaign:
    """Return a campaign that nobody has measured yet, whose unknown gains all are 1.

    Args:
        campaign: tests that a model gives, with what is unknown of their gains.
    """
    held = dict.fromkeys(
        nodes_of(campaign, test, dof)
        for test in campaign.tests
        for dof in test.estimate.frf.outputs
    )
    cells = [GainCell(nodes, 0.0, np.zeros(0, complex), np.zeros(0)) for nodes in held if nodes]
    nodes = list(dict.fromkeys(node for cell in cells for node in cell.nodes))
    references, groups = _product_groups(cells, nodes)
    of_products = {node for group in groups for node in group if node[1] is not None}
    nominal = tuple(
        NominalGain(*node, 1.0, node in of_products) for node in nodes if node not in references
    )
    return replace(
        campaign,
        unknown_gains=replace(campaign.unknown_gains, nominal=nominal),
        remarks=(*campaign.remarks, *map(_product_sentence, groups)),
    )


def _product_groups(
    cells: Sequence[GainCell], nodes: Sequence[GainNode]
) -> tuple[set[GainNode], list[list[GainNode]]]:
    """Return the groups of gains that no known gain anchors, and one hammer of each.

    A cell with one unknown gain anchors it, since the other gain of that cell is known.
    """
    group_of = {node: node for node in nodes}

    def root(node: GainNode) -> GainNode:
        while group_of[node] != node:
            node = group_of[node]
        return node

    for cell in cells:
        for node in cell.nodes[1:]:
            group_of[root(node)] = root(cell.nodes[0])
    anchored = {root(cell.nodes[0]) for cell in cells if len(cell.nodes) == 1}
    groups = group_by_key((root(node), node) for node in nodes if root(node) not in anchored)
    references = {
        next(node for node in group if node[0].startswith("hammer:")) for group in groups.values()
    }
    return references, list(groups.values())


def _fit_levels(cells: Sequence[GainCell], nodes: Sequence[GainNode], fixed: set[GainNode]) -> Real:
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
    return levels


def _fit_signs(
    cells: Sequence[GainCell], nodes: Sequence[GainNode], fixed: set[GainNode]
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


def _late_sentence(location: str, delay: float) -> str:
    """Return that a drive or encoder is late beyond its tolerance."""
    kind, _, name = location.partition(":")
    noun = "drive" if kind == "hammer" else "channel"
    return (
        f"the {noun} {name} seems to be {'late' if delay > 0 else 'early'} by {abs(delay):.2g} s, "
        "beyond its tolerance: if an amplifier, filter or converter does that, state "
        f"delay_tolerance in [{kind}.{toml_key(name)}]"
    )


def _divide(test: Test, gains: dict[GainNode, float], delays: dict[str, float]) -> Test:
    """Return a test with its FRFs divided by the gains, and by delays of drive and encoders."""
    estimate, drive = test.estimate, f"hammer:{test.condition.instrument}"
    nodes = [channel_node(dof) for dof in estimate.frf.outputs]
    hammer = gains.get((drive, None), 1.0)
    factors = np.array([hammer * gains.get(node, 1.0) for node in nodes])[None, :, None]
    late = delays.get(drive, 0.0) + np.array(
        [0.0 if node[1] else delays.get(node[0], 0.0) for node in nodes]
    )
    values = estimate.frf.values / factors
    if late.any():
        turns = np.exp(2j * np.pi * np.outer(estimate.frf.freq_hz, late))
        values = values * turns[:, :, None]
    frf = replace(estimate.frf, values=values)
    divided = replace(estimate, frf=frf, variance=estimate.variance / factors**2)
    return replace(test, estimate=divided)


def _product_sentence(group: Sequence[GainNode]) -> str:
    """Return a sentence on gains of which only products are seen."""
    hammers = [node[0].partition(":")[2] for node in group if node[1] is None]
    sensors = dict.fromkeys(node[0].partition(":")[2] for node in group if node[1] is not None)
    return (
        f"only the products of the gains of {', '.join(sensors)} and of the force channel "
        f"{' or '.join(hammers)} are seen, since both are unknown: the gain of {hammers[0]} is "
        "set to 1; state one of them to know the others"
    )


def _missing_sentences(campaign: Campaign, estimated: set[GainNode]) -> list[str]:
    """Return sentences on unknown gains that no FRF shows."""
    nodes = {
        node
        for test in campaign.tests
        for dof in test.estimate.frf.outputs
        for node in nodes_of(campaign, test, dof)
    }
    labels = sorted(NominalGain(*node, 1.0).label for node in nodes - estimated)
    if not labels:
        return []
    return [
        f"the gain of {', '.join(labels)} is unknown and stays so: there is no motion above the "
        "noise that the model predicts"
    ]
