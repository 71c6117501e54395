"""The six stages of the micro-station as closed shells that touch and do not overlap.

World axes, metres: origin at the point of interest, z up. The dimensions written here are CHOSEN
around what is known: sensors sit on faces (SEEN heights and places), the hexapod's radii and joint
circles are SEEN. Each stage leaves some dimensions free, which ``make_station.py`` solves for so
that mass and centre of mass come out as they should.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapes import (
    Shell,
    between,
    bevelled,
    box,
    lying,
    prism,
    ring,
    round_outline,
    turned,
)

GRANITE, STEEL = 2800.0, 7800.0
SIDES = 48  # of whatever is round

# Faces that carry sensors: SEEN, but the hexapod's and the tilt stage's, which are RECALLED.
BED_TOP, PLATE_TOP, TY_TOP, TILT_TOP, LEDGE, PLATFORM_TOP = (
    *(-0.9506, -0.7856, -0.4273, -0.4168, -0.594, -0.27),
)
HEXAPOD_BOTTOM = -0.437
BASE_RADIUS, TOP_RADIUS = 0.2075, 0.15  # SEEN
CRADLE_RADIUS = 0.76
# Joint circles: radius [m] and half the angle between two neighbours [degrees]: SEEN.
BASE_JOINTS, TOP_JOINTS = (0.1755, 9.5), (0.118, 12.1)


@dataclass(frozen=True)
class Target:
    """What a stage is to weigh.

    Args:
        mass: [kg].
        centre: of mass [m].
        density: [kg/m^3].
        free: first guess of the free dimensions, by name [m].
        shells: the stage's shells from its free dimensions.
        axes: components of the centre that the free dimensions steer; the rest is so by symmetry.
    """

    mass: float
    centre: tuple[float, float, float]
    density: float
    free: dict[str, float]
    shells: Callable[..., list[Shell]]
    axes: tuple[int, ...] = (0, 1, 2)


def granite_bottom(bottom: float, well: float, well_x: float, well_y: float) -> list[Shell]:
    """A machine bed: a frame about a well that the top granite bridges."""
    outer = bevelled((-0.80, 0.94), (-0.59, 0.88), 0.05)
    inner = bevelled((well_x - well, well_x + well), (well_y - 0.575, well_y + 0.575), 0.05)
    return [ring(outer, inner, (bottom, BED_TOP))]


def granite_top(under: float, cheek: float, right: float, rear: float) -> list[Shell]:
    """A plate on two beams, with rails for ty, a cheek on each side and a tall block behind."""
    plate = ring(
        bevelled((-0.66, 0.76), (-0.58, 0.87), 0.04),
        bevelled((-0.25, 0.25), (-0.25, 0.25), 0.08),
        (under, PLATE_TOP),
    )
    beams = [box((-0.63, 0.73), y, (BED_TOP, under)) for y in ((-0.57, -0.44), (0.73, 0.86))]
    rails = [
        prism(bevelled(x, (-0.42, 0.50), 0.01), (PLATE_TOP, -0.73))
        for x in ((-0.50, -0.40), (0.40, 0.50))
    ]
    cheeks = [
        prism(bevelled(x, (-0.42, 0.50), 0.02), (PLATE_TOP, cheek))
        for x in ((-0.65, -0.56), (0.57, right))
    ]
    block = prism(bevelled((-0.46, 0.56), (0.61, 0.86), 0.03), (PLATE_TOP, rear))
    return [plate, *beams, *rails, *cheeks, block]


def ty(bottom: float, wall: float, back: float) -> list[Shell]:
    """A carriage: a frame on four runner blocks, with a wall on each side."""
    deck = -0.62
    frame = ring(
        bevelled((-0.515, 0.515), (-0.45, back), 0.015),
        bevelled((-0.40, 0.40), (-0.345, 0.335), 0.003),
        (bottom, deck),
    )
    walls = [
        prism(bevelled(x, (-0.45 + 0.015, back - 0.015), 0.012), (deck, TY_TOP))
        for x in ((-0.445 - wall, -0.445), (0.445, 0.445 + wall))
    ]
    runners = [
        box(x, y, (-0.73, bottom))
        for x in ((-0.505, -0.395), (0.395, 0.505))
        for y in ((-0.39, -0.22), (0.23, 0.40))
    ]
    return [frame, *walls, *runners]


def tilt(floor: float, inside: float, back: float) -> list[Shell]:
    """A cradle whose underside is an arc about the y axis through the point of interest.

    Its floor has an opening for the spindle, under a cover; sensors sit on the lips of its arms.
    """
    front, hole, side, lip = -0.335, 0.205, 0.395, 0.43
    cuts = ((-inside, inside, (front, -hole)), (-inside, inside, (hole, back)),
            (-inside, -hole, (-hole, hole)), (hole, inside, (-hole, hole)))  # fmt: skip
    shells = [
        lying([*_cradle_arc(start, end), (end, floor), (start, floor)], y) for start, end, y in cuts
    ]
    for start, end in ((-side, -inside), (inside, side)):
        arm = [*_cradle_arc(start, end), (end, TILT_TOP), (start, TILT_TOP)]
        shells.append(lying(arm, (front, back)))
    for x in ((-lip, -side), (side, lip)):
        shells.append(box(x, (front, back), (TILT_TOP - 0.03, TILT_TOP)))
    opening = round_outline(0.207, SIDES)
    square = 0.25 * opening / np.abs(opening).max(axis=1, keepdims=True)
    return [*shells, ring(square, opening, (floor, floor + 0.012))]


def _cradle_arc(start: float, end: float) -> list[tuple[float, float]]:
    x = np.linspace(start, end, 13)
    return list(zip(x.tolist(), (-np.sqrt(CRADLE_RADIUS**2 - x**2)).tolist(), strict=True))


def spindle(bottom: float, flange: float) -> list[Shell]:
    """A stepped cylinder: motor, housing with the sensors' ledge, shaft, flange of the hexapod."""
    profile = [
        *((0, bottom - 0.02), (0.11, bottom - 0.02), (0.11, bottom), (0.19, bottom)),
        *((0.2, bottom + 0.01), (0.2, LEDGE - 0.004), (0.196, LEDGE), (0.164, LEDGE)),
        *((0.164, flange - 0.015), (0.225, flange), (0.235, flange + 0.01)),
        *((0.235, HEXAPOD_BOTTOM - 0.004), (0.231, HEXAPOD_BOTTOM), (0, HEXAPOD_BOTTOM)),
    ]
    return [turned(profile, SIDES)]


def hexapod(base: float, top: float, box_x: float, box_y: float) -> list[Shell]:
    """Two round plates, the upper with a stub, and six legs.

    A box for plugs on the base plate moves the centre of mass off the axis.
    """
    base_top, top_under = HEXAPOD_BOTTOM + base, PLATFORM_TOP - top
    plates = [
        ring(
            round_outline(BASE_RADIUS, SIDES), round_outline(0.15, SIDES),
            (HEXAPOD_BOTTOM, base_top),
        ),
        turned(
            [(0, top_under), (TOP_RADIUS - 0.006, top_under), (TOP_RADIUS, top_under + 0.006),
             (TOP_RADIUS, PLATFORM_TOP - 0.003), (TOP_RADIUS - 0.003, PLATFORM_TOP),
             (0.056, PLATFORM_TOP), (0.05, PLATFORM_TOP + 0.006), (0.05, -0.222), (0, -0.222)],
            SIDES,
        ),
    ]  # fmt: skip
    shells = [*plates, box(
        (box_x - 0.03, box_x + 0.03), (box_y - 0.03, box_y + 0.03), (base_top, base_top + 0.05)
    )]  # fmt: skip
    for low, high in leg_ends():
        middle = low + 0.55 * (high - low)
        waist = base_top + 0.55 * (top_under - base_top)
        # The leg's actuator below, its rod above; both sheared so that they end on the plates.
        for radius, (start, end), z in (
            (0.016, (low, middle), (base_top, waist)),
            (0.009, (middle, high), (waist, top_under)),
        ):
            outlines = (round_outline(radius, 8, start), round_outline(radius, 8, end))
            shells.append(between(*outlines, z))
    return shells


def leg_ends() -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Base and top joint of each leg, in x and y [m].

    The base's pairs of joints stand at 0, 120 and 240 degrees, the top's at 60, 180 and 300. Each
    leg leans from its corner of the base to the neighbouring corner of the top: legs that crossed
    to neither side would leave the turn about z free.
    """

    def joint(circle: tuple[float, float], corner: float, side: int) -> NDArray[np.float64]:
        radius, half = circle
        angle = np.deg2rad(corner + side * half)
        return radius * np.array([np.cos(angle), np.sin(angle)])

    return [
        (joint(BASE_JOINTS, corner, side), joint(TOP_JOINTS, corner + 60 * side, -side))
        for corner in (0, 120, 240)
        for side in (-1, 1)
    ]


TARGETS = {
    "granite_bottom": Target(
        1700.0, (0.045, 0.144, -1.251), GRANITE,
        {"bottom": -1.5514, "well": 0.67, "well_x": 0.086, "well_y": 0.145}, granite_bottom,
    ),
    "granite_top": Target(
        800.0, (0.052, 0.258, -0.778), GRANITE,
        {"under": -0.8556, "cheek": -0.655, "right": 0.78, "rear": -0.579}, granite_top,
    ),
    "ty": Target(
        550.0, (0.0, 0.014, -0.6), STEEL,
        {"bottom": -0.7, "wall": 0.07, "back": 0.46}, ty, axes=(1, 2),
    ),
    "tilt": Target(
        360.0, (0.0, -0.005, -0.628), STEEL,
        {"floor": -0.62, "inside": 0.36, "back": 0.32}, tilt, axes=(1, 2),
    ),
    "spindle": Target(
        290.0, (0.0, 0.0, -0.58), STEEL,
        {"bottom": -0.74, "flange": -0.5}, spindle, axes=(2,),
    ),
    "hexapod": Target(
        35.0, (-0.004, 0.006, -0.319), STEEL,
        {"base": 0.009, "top": 0.045, "box_x": -0.09, "box_y": 0.14}, hexapod,
    ),
}  # fmt: skip
