"""Match of measured to simulated modes: shapes at channels, odds and probabilities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.impacts import ImpactSpectra
from identification.matching.assignment import best_matching, pair_probabilities
from identification.matching.likelihood import MatchingPriors, pairing_odds
from identification.matching.measured_modes import ImpactModes, impact_modes
from identification.modal import mac
from identification.shapes import Shapes, ShapeSampling, shapes_at
from identification.words import Dof, Layout, Real, UsageError


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
        dofs: the channels.
        sampling: as for ``shapes_at``.

    Returns:
        (n_mode, n_channel).

    Raises:
        UsageError: a channel at no site of the layout.
        InputError: a site off the mesh.
    """
    places, axes = channel_geometry(layout, dofs)
    vectors = shapes_at(shapes, places, [dof.point for dof in dofs], sampling=sampling)
    displacements: Real = np.einsum("mcx,cx->mc", vectors, axes)
    return displacements


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
        spectra: spectra of the impacts.
        sampling: as for ``shapes_at``.
        priors: prior assumptions of the match.
    """
    simulated = shapes_at_channels(shapes, layout, spectra.dofs, sampling)
    measured = impact_modes(spectra)
    band = (float(spectra.freq_hz[0]), float(spectra.freq_hz[-1]))
    table = pairing_odds(measured, simulated, shapes.frequencies, band, priors)
    return ModeMatch(measured, shapes.frequencies, simulated, table)
