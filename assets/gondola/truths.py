"""Structures that differ from the drawing: what a test is made of, and nobody is told.

Panels bend less than their face sheets alone, weigh more, edges differ; an inner frame, which the
drawing leaves out, yields on its pins, so that there are modes that no mode of the drawing is. The
drawing's first six elastic frequencies are 5 to 15 % off the structure's, all of them: structures
are drawn until they are, until a mode of the frame lies in the band, and until it is clear of each
mode whether it is one of the drawing's. Of every one are kept: frequencies, shapes at sensors and
struck points, and which mode of the drawing each of its modes is, by the whole mesh.
"""

import numpy as np
from equivalent_shell import PANEL
from panels import WIDTH, Build, Frame, Panels, Real, panels_of
from places import Place
from scipy.optimize import linear_sum_assignment
from solver import Modes, hung, modes_of

COUNT = 24
_SAME = 0.5  # MAC on the whole mesh, below which two modes are not the same
_OTHER = 0.4  # above which they are not quite others either
_BAND = 15.0, 95.0  # Hz, that is tested
_OFF = 0.05, 0.15  # the drawing's frequencies
_RIGID, _ELASTIC = 6, 6  # modes
_DRAWS = 500


def build(seed: int, number: int) -> Build:
    """A structure of its own: the so manyth that a seed gives."""
    random = np.random.default_rng([seed, number, 20150918])
    names = ("bottom", "top", "stern", "side", "corner")
    # Across, where it braces the sides, it is stiff.
    along, across, up = (float(random.uniform(*f)) for f in ((30, 44), (100, 120), (30, 90)))
    pins = (0.7, -WIDTH / 2, 1.3), (0.7, WIDTH / 2, 1.3)
    frame = Frame(float(random.uniform(0.3, 0.8)), pins, (along, across, up))
    boxes = [
        (
            random.uniform(0.2, 1.2),
            (random.uniform(0.1, 1.3), random.uniform(-0.7, 0.7), random.choice([0.0, 2.4])),
        )
        for _ in range(3)
    ]
    return Build(
        bending=random.uniform(0.84, 0.9),
        density=random.uniform(1.0, 1.1),
        edges=random.uniform(0.8, 1.5),
        bottom=random.uniform(0.85, 1.05),
        thickness={name: random.uniform(0.94, 1.06) for name in names},
        lumps=tuple((float(m), tuple(map(float, at))) for m, at in boxes),
        frames=(frame,),
    )


def truth(seed: int, drawn: Panels, modes: Modes, places: list[Place]) -> dict[str, Real]:
    """What is kept of a structure.

    Args:
        seed: of the structure.
        drawn: the drawing's mesh, whose nodes are the same.
        modes: the drawing's.
        places: sensors and struck points.

    Raises:
        ValueError: no draw is as far off as is wanted.
    """
    for number in range(_DRAWS):
        own = build(seed, number)
        panels = panels_of(own)
        found = modes_of(panels, own.bending, COUNT, hung(panels, own.frames))
        mac = alike(drawn, modes, found)
        pairs = pairs_by(mac)
        if _is_off(modes, found, pairs) and _is_clear(found, pairs, mac):
            shapes = found.shapes[:, [place.node for place in places]]
            return {
                "frequencies": found.frequencies,
                "shapes": shapes.astype(np.float32),
                "pairs": pairs,
                "mass": np.array(panels.mass + sum(frame.mass for frame in own.frames)),
            }
    raise ValueError(f"seed {seed}: none of {_DRAWS} structures is {_OFF} off")


def _is_off(modes: Modes, found: Modes, pairs: Real) -> bool:
    """Whether the drawing's first elastic modes are all there, and as far off as is wanted."""
    own = np.flatnonzero((pairs >= _RIGID) & (pairs < _RIGID + _ELASTIC))
    if len(own) < _ELASTIC:
        return False
    off = np.abs(modes.frequencies[pairs[own].astype(int)] / found.frequencies[own] - 1)
    return bool((off > _OFF[0]).all() and (off < _OFF[1]).all())


def _is_clear(found: Modes, pairs: Real, mac: Real) -> bool:
    """Whether some modes in the band are none of the drawing's, and all of these clearly."""
    inside = (found.frequencies > _BAND[0]) & (found.frequencies < _BAND[1])
    others = inside & (pairs < 0)
    return bool(others.any() and (mac[others, _RIGID:] < _OTHER).all())


def alike(drawn: Panels, modes: Modes, found: Modes) -> Real:
    """MAC on all nodes, weighed by area; (n_found, n_drawn)."""
    weight = np.zeros(len(drawn.points))
    np.add.at(weight, drawn.elements.ravel(), np.repeat(drawn.area * PANEL, 8) / 8)
    one, other = (
        (one.shapes * np.sqrt(weight)[:, None]).reshape(len(one.shapes), -1)
        for one in (found, modes)
    )
    sizes = np.outer((one**2).sum(axis=1), (other**2).sum(axis=1))
    mac: Real = (one @ other.T) ** 2 / sizes
    return mac


def pairs_by(mac: Real) -> Real:
    """Mode of the drawing that each mode is, -1 for none; rigid ones are paired with rigid ones."""
    partner = np.full(len(mac), -1)
    partner[:_RIGID] = np.arange(_RIGID)
    rows, columns = linear_sum_assignment(-mac[_RIGID:, _RIGID:])
    same = mac[_RIGID:, _RIGID:][rows, columns] > _SAME
    partner[_RIGID + rows] = np.where(same, _RIGID + columns, -1)
    return partner
