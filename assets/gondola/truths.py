"""Structures that differ from the drawing: what a test is made of, and nobody is told.

Panels bend less than their face sheets alone, weigh more, edges differ; the inner frames, which the
drawing leaves out, drag on their pins. The drawing's first six elastic frequencies are 5 to 15 %
off the structure's, all of them: structures are drawn until they are. Of every one are kept:
frequencies, shapes at sensors and struck points, and which mode of the drawing each of its modes
is, by the whole mesh.
"""

import numpy as np
from panels import PANEL, WIDTH, Build, Panels, Real, panels_of
from places import Place
from scipy.optimize import linear_sum_assignment
from solver import Modes, modes_of

COUNT = 24
_SAME = 0.5  # MAC on the whole mesh, below which two modes are not the same
_OFF = 0.05, 0.15  # the drawing's frequencies
_RIGID, _ELASTIC = 6, 6  # modes
_DRAWS = 200


def build(seed: int, number: int) -> Build:
    """A structure of its own: the so manyth that a seed gives."""
    random = np.random.default_rng([seed, number, 20150918])
    names = ("bottom", "top", "stern", "side", "corner")
    pins = [(random.uniform(0.2, 1.2), (0.7, side * WIDTH / 2, 1.3)) for side in (-1.0, 1.0)]
    boxes = [
        (
            random.uniform(0.2, 1.2),
            (random.uniform(0.1, 1.3), random.uniform(-0.7, 0.7), random.choice([0.0, 2.4])),
        )
        for _ in range(3)
    ]
    return Build(
        bending=random.uniform(0.86, 0.97),
        density=random.uniform(1.0, 1.1),
        edges=random.uniform(0.5, 1.8),
        bottom=random.uniform(1.7, 2.1),
        thickness={name: random.uniform(0.9, 1.1) for name in names},
        lumps=(*pins, *((float(m), tuple(map(float, at))) for m, at in boxes)),
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
        found = modes_of(panels, own.bending, COUNT)
        pairs = _pairs(drawn, modes, found)
        if _is_off(modes, found, pairs):
            shapes = found.shapes[:, [place.node for place in places]]
            return {
                "frequencies": found.frequencies,
                "shapes": shapes.astype(np.float32),
                "pairs": pairs,
                "mass": np.array(panels.mass),
            }
    raise ValueError(f"seed {seed}: none of {_DRAWS} structures is {_OFF} off")


def _is_off(modes: Modes, found: Modes, pairs: Real) -> bool:
    """Whether the drawing's first elastic modes are all there, and as far off as is wanted."""
    own = np.flatnonzero((pairs >= _RIGID) & (pairs < _RIGID + _ELASTIC))
    if not np.array_equal(own, np.arange(_RIGID, _RIGID + _ELASTIC)):
        return False
    off = np.abs(modes.frequencies[pairs[own].astype(int)] / found.frequencies[own] - 1)
    return bool((off > _OFF[0]).all() and (off < _OFF[1]).all())


def _pairs(drawn: Panels, modes: Modes, found: Modes) -> Real:
    """Mode of the drawing that each mode is, -1 for none, by MAC on all nodes, weighed by area."""
    weight = np.zeros(len(drawn.points))
    np.add.at(weight, drawn.elements.ravel(), np.repeat(drawn.area * PANEL, 8) / 8)
    one, other = (
        (one.shapes * np.sqrt(weight)[:, None]).reshape(len(one.shapes), -1)
        for one in (found, modes)
    )
    sizes = np.outer((one**2).sum(axis=1), (other**2).sum(axis=1))
    mac = (one @ other.T) ** 2 / sizes
    rows, columns = linear_sum_assignment(-mac)
    partner = np.full(len(one), -1)
    partner[rows] = np.where(mac[rows, columns] > _SAME, columns, -1)
    return partner
