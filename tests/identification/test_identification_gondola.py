"""The virtual gondola: struck, read on clocks of its own, matched with the drawing's shapes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification import read_layout
from identification.impacts import impact_record, impact_spectra, synchronise
from identification.matching import match_modes, shapes_at_channels
from identification.shapes import read_shapes, rigid_modes
from identification.words import Dof, InputError, UsageError
from tests.helpers.virtual_gondola import Trial, _accelerated, read_structure, strike

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"


@pytest.fixture(scope="module")
def drawn():
    shapes = read_shapes(ASSETS / "shapes.vtu")
    return shapes.select(rigid_modes(shapes).supported), read_layout(ASSETS / "layout.toml")


def test_all_six_modes_of_another_structure_are_those_of_the_drawing(drawn):
    shapes, layout = drawn
    structure = read_structure(ASSETS / "truths.npz", 10)  # for development alone
    impacts = []
    for point in ("bow2", "bow3", "stern2"):
        record = impact_record(point, strike(structure, Trial(71_700, seconds=6.0), point))
        assert len(record.channels) == 21
        impacts.append(synchronise(record))
    result = match_modes(shapes, layout, impact_spectra(impacts, (15.0, 95.0)))
    # Modes of the inner frame are among them, which the panels hardly follow.
    seen = (structure.pairs >= 6) & (structure.frequencies < 95.0)
    assert (structure.pairs[6:12] < 0).any()
    own, pairs = structure.frequencies[seen], structure.pairs[seen] - 6
    off = np.abs(shapes.frequencies[pairs] / own - 1)
    assert ((off > 0.05) & (off < 0.15)).all()
    assert result.measured.frequencies == pytest.approx(own, rel=5e-3)
    assert result.pairs == dict(enumerate(pairs.tolist()))
    for mode, simulated in result.pairs.items():
        assert result.probability[mode, simulated] > 0.8
    # Two modes of it are alike, and exchanged against the drawing: frequencies alone mislead.
    assert result.pairs[2] == 3
    assert result.pairs[3] == 2
    assert result.mac[2, 3] > result.mac[2, 2]
    telling = result.telling_channels(2)
    assert len(set(telling)) == 3


def test_a_mode_answers_a_force_as_its_equation_does():
    omega, zeta, step = 2 * np.pi * 40.0, 0.03, 2e-5
    time = np.arange(0, 0.3, step)
    force = np.where(time < 4e-3, np.sin(np.pi * time / 4e-3), 0.0)
    found = _accelerated(force, omega, zeta, step)
    damped = omega * np.sqrt(1 - zeta**2)
    response = np.exp(-zeta * omega * time) * np.sin(damped * time) / damped
    position = np.convolve(force, response)[: len(time)] * step  # Duhamel
    expected = np.gradient(np.gradient(position, step), step)
    inside = slice(5, -5)
    assert np.abs(found - expected)[inside].max() < 0.01 * np.abs(expected).max()


def test_channels_without_a_place_and_sites_off_the_mesh_are_named(drawn):
    shapes, layout = drawn
    with pytest.raises(UsageError, match=r"acc99 has no place"):
        shapes_at_channels(shapes, layout, [Dof.parse("acc99:+tx")])
    far = read_layout_with(layout, 3, [9.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"acc4 at .* off the mesh"):
        shapes_at_channels(shapes, far, [Dof.parse("acc1:+tx"), Dof.parse("acc4:+tx")])


def read_layout_with(layout, place, position):
    """A layout with one site elsewhere."""
    positions = layout.positions.copy()
    positions[place] = position
    return replace(layout, positions=positions)
