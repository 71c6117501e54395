"""The whole of a match: shapes at channels, modes of impacts, odds, probabilities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching.assignment import best_matching, pair_probabilities
from identification.matching.likelihood import Beliefs, odds
from identification.matching.measured_modes import ImpactModes, impact_modes
from identification.modal import mac
from identification.shapes import How, Shapes, shapes_at
from identification.words import Dof, Layout, Real, UsageError


@dataclass(frozen=True, eq=False)
class Match:
    """Measured and simulated modes, paired.

    Args:
        measured: modes of the impacts.
        simulated_hz: (n_simulated,).
        at: simulated modes at the channels, signed; (n_simulated, n_channel).
        odds: of each pair against no match; (n_measured, n_simulated).
    """

    measured: ImpactModes
    simulated_hz: Real
    at: Real
    odds: Real

    @cached_property
    def probability(self) -> Real:
        """Of every pair, one to one; (n_measured, n_simulated)."""
        return pair_probabilities(self.odds)

    @cached_property
    def pairs(self) -> dict[int, int]:
        """Simulated mode of each measured one, by the likeliest matching of all."""
        return best_matching(self.odds)

    @cached_property
    def mac(self) -> Real:
        """Signed shapes at the channels; (n_measured, n_simulated)."""
        one, other = self.measured.shapes.T.astype(complex), self.at.T.astype(complex)
        return mac(one, other)

    def channels(self, mode: int, count: int = 3) -> tuple[int, ...]:
        """Those that tell a measured mode's best candidate from its second, the best first."""
        best = np.argsort(-self.odds[mode], kind="stable")[:2]
        if len(best) < 2:  # nothing to be told from
            return ()
        shape = self.measured.shapes[mode]
        away = [
            np.abs(shape - other * float(shape @ other) / max(float(other @ other), 1e-300))
            for other in self.at[best]
        ]
        return tuple(np.argsort(away[0] - away[1], kind="stable")[:count].tolist())


def at_channels(
    shapes: Shapes, layout: Layout, dofs: Sequence[Dof], how: How = "interpolated"
) -> Real:
    """Shapes along the channels' directions.

    Args:
        shapes: modes on a mesh, in the layout's axes.
        layout: where the channels' sites are, and how they are turned.
        dofs: the channels.
        how: as of ``shapes_at``.

    Returns:
        (n_mode, n_channel).

    Raises:
        UsageError: a channel at no site of the layout.
        InputError: a site off the mesh.
    """
    places, axes = channels_at(layout, dofs)
    vectors = shapes_at(shapes, places, [dof.point for dof in dofs], how=how)
    found: Real = np.einsum("mcx,cx->mc", vectors, axes)
    return found


def channels_at(layout: Layout, dofs: Sequence[Dof]) -> tuple[Real, Real]:
    """Where channels are [m], and along what they read; (n_channel, 3) each.

    Raises:
        UsageError: a channel at no site of the layout.
    """
    unknown = [dof.point for dof in dofs if dof.point not in layout.points]
    if unknown:
        raise UsageError(f"{unknown[0]} has no place. Give [site.{unknown[0]}] in the layout.")
    own = [layout.points.index(dof.point) for dof in dofs]
    axes = [layout.axes[k][:, dof.axis % 3] for k, dof in zip(own, dofs, strict=True)]
    return layout.positions[own], np.array(axes)


def match(
    shapes: Shapes,
    layout: Layout,
    spectra: ImpactSpectra,
    how: How = "interpolated",
    beliefs: Beliefs | None = None,
) -> Match:
    """Identify the modes of impacts and say which simulated mode each is.

    Args:
        shapes: modes on a mesh, without those at rest.
        layout: of the channels.
        spectra: of the impacts.
        how: as of ``shapes_at``.
        beliefs: before the test.
    """
    at = at_channels(shapes, layout, spectra.dofs, how)
    measured = impact_modes(spectra)
    band = (float(spectra.freq_hz[0]), float(spectra.freq_hz[-1]))
    table = odds(measured, at, shapes.frequencies, band, beliefs)
    return Match(measured, shapes.frequencies, at, table)
