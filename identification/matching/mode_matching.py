"""Match of measured to simulated modes: shapes at channels, odds and probabilities.

One-to-one assignment of measured to simulated modes, with probabilities and "no match".

Let W[m, a] be the odds that measured mode m is the simulated mode a rather than none. Then a
partial matching has the weight prod W over its pairs. The sums over all partial matchings, and over
those that hold a pair, give the probability of each pair exactly. They are computed by a
forward-backward recursion over measured modes, whose states are the sets of simulated modes that
are already taken. A simulated mode that no later measured one can match is dropped from the sets,
since it no longer distinguishes them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import linear_sum_assignment

from identification.impacts import ImpactSpectra
from identification.matching.likelihood import MatchingPriors, pairing_odds
from identification.matching.measured_modes import ImpactModes, impact_modes
from identification.modal import mac
from identification.shapes import Shapes, ShapeSampling, shapes_at
from identification.words import Dof, Integers, Layout, Real, UsageError


@dataclass(frozen=True, eq=False)
class ModeMatch:
    """Measured and simulated modes, paired.

    Args:
        measured: modes of the impacts.
        simulated_hz: (n_simulated,) [Hz].
        simulated_shapes: simulated modes at the channels, signed; (n_simulated, n_channel).
        odds: odds of each pair against no match; (n_measured, n_simulated).
    """

    measured: ImpactModes
    simulated_hz: Real
    simulated_shapes: Real
    odds: Real

    @cached_property
    def probability(self) -> Real:
        """Return the probability of every pair, one to one; (n_measured, n_simulated)."""
        return pair_probabilities(self.odds)

    @cached_property
    def pairs(self) -> dict[int, int]:
        """Return the simulated mode of each measured one, by the most probable matching."""
        return best_matching(self.odds)

    @cached_property
    def mac(self) -> Real:
        """Return the MAC of signed shapes at the channels; (n_measured, n_simulated)."""
        measured, simulated = (
            self.measured.shapes.T.astype(complex),
            self.simulated_shapes.T.astype(complex),
        )
        return mac(measured, simulated)

    def telling_channels(self, mode: int, count: int = 3) -> tuple[int, ...]:
        """Return the channels that best distinguish a measured mode's two best candidates."""
        best = np.argsort(-self.odds[mode], kind="stable")[:2]
        if len(best) < 2:  # no second candidate
            return ()
        shape = self.measured.shapes[mode]
        residuals = [
            np.abs(
                shape
                - candidate * float(shape @ candidate) / max(float(candidate @ candidate), 1e-300)
            )
            for candidate in self.simulated_shapes[best]
        ]
        return tuple(np.argsort(residuals[0] - residuals[1], kind="stable")[:count].tolist())


def shapes_at_channels(
    shapes: Shapes, layout: Layout, dofs: Sequence[Dof], sampling: ShapeSampling = "interpolated"
) -> Real:
    """Compute shapes along the directions of channels.

    Args:
        shapes: modes on a mesh, in the layout's axes.
        layout: places and orientations of the channels' sites.
        sampling: as for ``shapes_at``.

    Returns:
        (n_mode, n_channel).

    Raises:
        UsageError: a channel at no site of the layout.
        InputError: a site off the mesh.
    """
    places, axes = channel_geometry(layout, dofs)
    vectors = shapes_at(shapes, places, [dof.point for dof in dofs], sampling=sampling)
    return np.einsum("mcx,cx->mc", vectors, axes)


def channel_geometry(layout: Layout, dofs: Sequence[Dof]) -> tuple[Real, Real]:
    """Return the places of channels [m] and the axes along which they read; (n_channel, 3) each.

    Raises:
        UsageError: a channel at no site of the layout.
    """
    unknown = [dof.point for dof in dofs if dof.point not in layout.points]
    if unknown:
        raise UsageError(f"{unknown[0]} has no place. Give [site.{unknown[0]}] in the layout.")
    sites = [layout.points.index(dof.point) for dof in dofs]
    axes = [layout.axes[k][:, dof.axis % 3] for k, dof in zip(sites, dofs, strict=True)]
    return layout.positions[sites], np.array(axes)


def match_modes(
    shapes: Shapes,
    layout: Layout,
    spectra: ImpactSpectra,
    sampling: ShapeSampling = "interpolated",
    priors: MatchingPriors | None = None,
) -> ModeMatch:
    """Identify the modes of impacts and match them to simulated modes.

    Args:
        shapes: modes on a mesh, without unsupported rigid modes.
        layout: layout of the channels.
        sampling: as for ``shapes_at``.
        priors: prior assumptions of the match.
    """
    simulated = shapes_at_channels(shapes, layout, spectra.dofs, sampling)
    measured = impact_modes(spectra)
    band = (float(spectra.freq_hz[0]), float(spectra.freq_hz[-1]))
    table = pairing_odds(measured, simulated, shapes.frequencies, band, priors)
    return ModeMatch(measured, shapes.frequencies, simulated, table)


_MIN_RELATIVE_ODDS = 1e-9  # odds of a pair over the best of its measured mode that still count
# Sets of simulated modes that are followed, the most probable ones; reached from 15 modes on.
_MAX_SETS = 30_000
_NO_MATCH = -1  # number of the simulated mode for a measured mode without a match


@dataclass(frozen=True, eq=False)
class _Step:
    """One measured mode: sets before it, sets behind it, transitions between them.

    Args:
        weights: weights of the sets before it; (n_before,).
        transitions: a simulated mode or no match, its odds, the sets before and behind;
            n_way.
        behind: number of sets behind it.
    """

    weights: Real
    transitions: tuple[tuple[int, float, Integers, Integers], ...]
    behind: int


def pair_probabilities(odds: Real) -> Real:
    """Compute the probability of every pair.

    Args:
        odds: W; (n_measured, n_simulated).

    Returns:
        (n_measured, n_simulated); one minus the sum of a row is the probability of no match.
    """
    best = odds.max(axis=1, keepdims=True, initial=1.0)
    # Rows and the odds of no match are scaled alike, so that products neither over- nor underflow.
    kept, none = np.where(odds > _MIN_RELATIVE_ODDS * best, odds, 0.0) / best, 1 / best[:, 0]
    used = np.flatnonzero(kept.any(axis=0))  # bits of the sets
    steps = _forward_pass(kept[:, used], none)
    probabilities = np.zeros_like(odds)
    behind = np.ones(steps[-1].behind if steps else 0)
    for row, step in zip(probabilities[::-1], reversed(steps), strict=True):
        before = np.zeros(len(step.weights))
        shares = np.zeros(len(used) + 1)  # the last of none
        for mode, weight, begin, end in step.transitions:
            onward = weight * behind[end]
            np.add.at(before, begin, onward)
            shares[mode] = step.weights[begin] @ onward
        row[used] = shares[:-1] / shares.sum()
        behind = before / before.max()
    return probabilities


def _forward_pass(odds: Real, none: Real) -> list[_Step]:
    """Run the recursion forward over all measured modes."""
    is_possible = np.logical_or.accumulate(odds[::-1] > 0, axis=0)[::-1]
    later = np.vstack([is_possible[1:], np.zeros((1, odds.shape[1]), bool)])
    taken, weights, steps = [0], np.ones(1), []
    for row, none_odds, ahead in zip(odds, none.tolist(), later, strict=True):
        mask = sum(1 << mode_number for mode_number in np.flatnonzero(ahead).tolist())
        number: dict[int, int] = {}
        transitions = []
        for mode in (_NO_MATCH, *np.flatnonzero(row).tolist()):
            bit = 0 if mode == _NO_MATCH else 1 << mode
            begin = [k for k, mode_number in enumerate(taken) if not mode_number & bit]
            end = [number.setdefault((taken[k] | bit) & mask, len(number)) for k in begin]
            weight = none_odds if mode == _NO_MATCH else float(row[mode])
            transitions.append((mode, weight, np.array(begin, np.intp), np.array(end, np.intp)))
        total = np.zeros(len(number))
        for _, weight, old, new in transitions:
            np.add.at(total, new, weight * weights[old])
        likely = np.sort(np.argsort(-total, kind="stable")[:_MAX_SETS])
        place = np.full(len(total), -1)
        place[likely] = np.arange(len(likely))
        surviving = [
            (m, w, b[place[e] >= 0], place[e][place[e] >= 0]) for m, w, b, e in transitions
        ]
        steps.append(_Step(weights, tuple(surviving), len(likely)))
        keys = list(number)
        taken, weights = [keys[k] for k in likely.tolist()], total[likely] / total[likely].sum()
    return steps


def best_matching(odds: Real) -> dict[int, int]:
    """Return the partial matching of the largest weight (Hungarian method, Kuhn 1955).

    Returns:
        Simulated mode of each measured one that has a match.
    """
    gain = np.log(np.maximum(odds, 1e-300))
    # Each measured mode has an additional column, which stands for no match, at odds of one.
    wide = np.hstack([gain, np.where(np.eye(len(odds), dtype=bool), 0.0, -1e6)])
    rows, columns = linear_sum_assignment(-wide)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {m: a for m, a in pairs if a < odds.shape[1]}
