"""The gondola's panels: equivalent shells against the plate formula, and what the asset weighs."""

import sys
from pathlib import Path

import numpy as np
import pytest

from identification.shapes import read_shapes, rigid_modes

ASSETS = Path(__file__).parents[2] / "assets" / "gondola"
MODULUS, POISSON = 69e9, 0.33
SHEET, SPACING = 0.5e-3, 24.9e-3  # m: the document's face sheets
TOTAL = 25.4e-3  # m: a panel, 1 inch


@pytest.fixture(scope="module")
def asset():
    """The asset's modules, which stand outside of every package."""
    names = ("equivalent_shell", "panels")
    sys.path.insert(0, str(ASSETS))
    try:
        yield {name: __import__(name) for name in names}
    finally:
        sys.path.remove(str(ASSETS))
        for name in names:
            sys.modules.pop(name, None)


def layered_stiffness(panels):
    """D of bonded panels [N m], by summing E z^2 / (1 - nu^2) through the thickness."""
    step = 1e-7
    z = np.arange(step / 2, panels * TOTAL, step)
    depth = np.mod(z, TOTAL)
    is_sheet = (depth < SHEET) | (depth > TOTAL - SHEET)
    z = z - panels * TOTAL / 2  # the stack is symmetric about its middle
    return MODULUS / (1 - POISSON**2) * float((z[is_sheet] ** 2).sum()) * step


@pytest.mark.parametrize(("panels", "millimetres"), [(1, 12.30), (2, 19.65)])
def test_the_equivalent_shell_bends_like_bonded_panels(asset, panels, millimetres):
    thickness = asset["equivalent_shell"].equal_bending_thickness(panels)
    assert 1e3 * thickness == pytest.approx(millimetres, abs=5e-3)
    shell = MODULUS * thickness**3 / (12 * (1 - POISSON**2))
    assert shell == pytest.approx(layered_stiffness(panels), rel=1e-3)
    assert asset["equivalent_shell"].bending_stiffness(thickness) == pytest.approx(shell)


def test_two_shells_on_each_other_would_bend_twice_as_stiffly_as_two_bonded_panels():
    twice = MODULUS * (2 * 12.4e-3) ** 3 / (12 * (1 - POISSON**2))
    assert twice / layered_stiffness(2) == pytest.approx(2.01, abs=0.01)
    assert layered_stiffness(2) / layered_stiffness(1) == pytest.approx(4.08, abs=0.01)


def test_the_bottom_has_that_thickness_and_the_mass_of_two_panels(asset):
    module = asset["panels"]
    panels = module.panels_of(module.Build())
    is_bottom = panels.names == "bottom"
    plain = is_bottom & (panels.thickness < module.PLATE)
    assert np.unique(1e3 * panels.thickness[plain]) == pytest.approx([19.65], abs=5e-3)
    # Far from edges, batteries and wheel an element weighs two panels of 12.4 mm at 523 kg/m3.
    areal = (panels.thickness * panels.density)[plain]
    assert areal.min() == pytest.approx(2 * 12.4e-3 * 523, rel=1e-9)
    rigid = rigid_modes(read_shapes(ASSETS / "shapes.vtu"))
    assert panels.mass == pytest.approx(264.09, abs=0.01)
    assert rigid.mass == pytest.approx(panels.mass, rel=1e-3)
