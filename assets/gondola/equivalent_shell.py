r"""Thickness of the homogeneous shell that bends like bonded honeycomb sandwich panels.

A plate of one material per layer has the bending stiffness per width

    D = integral E z^2 / (1 - nu^2) dz,   z from the neutral plane.

Of a sandwich panel the face sheets alone carry bending (the seed document on the gondola, after
Hexcel 2000). A sheet of thickness t_f whose middle lies at z_k has integral z^2 dz = t_f z_k^2 +
t_f^3 / 12. The homogeneous shell of the same material has D = E t^3 / (12 (1 - nu^2)), so that E
and nu cancel:

    t = (12 sum_k (t_f z_k^2 + t_f^3 / 12))^(1/3)

One panel has its sheets at z = -+ h / 2. Two bonded panels have the bond as neutral plane, two
sheets beside it at -+ t_f / 2 and two outer ones at -+ (t_f / 2 + h): about four times the bending
stiffness of one panel, where twice the thickness would have eight times. The shell keeps the mass
of the panels by its density. Bonded means that the layers do not slide.

``python assets/gondola/equivalent_shell.py`` prints thickness, stiffness and density.
"""

import sys

import numpy as np

SHEET = 0.5e-3  # m: thickness of a face sheet
SPACING = 24.9e-3  # m: between the middles of a panel's two face sheets
MODULUS, POISSON = 69e9, 0.33  # Pa, 1: of the face sheets, AL3003-H18
PANEL = 0.0124  # m: the document's shell for one panel, which its sheets give as 12.30 mm
DENSITY = 523.0  # kg/m3: of that shell, as heavy as the panel


def sheet_middles(panels: int) -> np.ndarray:
    """Return the distances of all face sheets' middles from the neutral plane [m].

    Args:
        panels: number of equal panels bonded face to face.
    """
    first = np.arange(panels) * (SPACING + SHEET)
    middles = np.concatenate([first, first + SPACING])
    return np.sort(middles) - middles.mean()


def equal_bending_thickness(panels: int) -> float:
    """Return the thickness of the shell that bends like so many bonded panels [m].

    Args:
        panels: number of equal panels bonded face to face.
    """
    moment = (SHEET * sheet_middles(panels) ** 2 + SHEET**3 / 12).sum()
    return float(np.cbrt(12 * moment))


def bending_stiffness(thickness: float) -> float:
    """Return D = E t^3 / (12 (1 - nu^2)) of a homogeneous shell of the sheets' material [N m].

    Args:
        thickness: of the shell [m].
    """
    return MODULUS * thickness**3 / (12 * (1 - POISSON**2))


def main() -> None:
    """Print the equivalent shells of one panel and of two bonded ones."""
    sys.stdout.write(
        "panels  shell/mm  bending stiffness D/(kN m)  over one panel  density/(kg/m3)\n"
    )
    single = bending_stiffness(equal_bending_thickness(1))
    for panels in (1, 2):
        thickness = equal_bending_thickness(panels)
        stiffness = bending_stiffness(thickness)
        density = panels * PANEL * DENSITY / thickness
        sys.stdout.write(
            f"{panels:6}  {1e3 * thickness:8.2f}  {1e-3 * stiffness:26.2f}  "
            f"{stiffness / single:14.2f}  {density:15.0f}\n"
        )
    ratio = bending_stiffness(2 * PANEL) / bending_stiffness(equal_bending_thickness(2))
    sys.stdout.write(f"a shell of {2e3 * PANEL:.1f} mm would bend {ratio:.2f} times as stiffly\n")


if __name__ == "__main__":
    main()
