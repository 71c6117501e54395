"""Structures that differ from the drawing: what a test is made of, and nobody is told.

Panels bend less than their face sheets alone, weigh more, edges differ; the inner frames, which the
drawing leaves out, drag on their pins. Of every structure are kept: frequencies, shapes at sensors
and struck points, and which mode of the drawing each of its modes is, by the whole mesh.
"""

import numpy as np
from panels import PANEL, WIDTH, Build, Panels, Real, panels_of
from places import Place
from scipy.optimize import linear_sum_assignment
from solver import Modes, modes_of

COUNT = 24
_SAME = 0.5  # MAC on the whole mesh, below which two modes are not the same


def build(seed: int) -> Build:
    """A structure of its own."""
    random = np.random.default_rng([seed, 20150918])
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
        bending=random.uniform(0.84, 0.98),
        density=random.uniform(1.0, 1.08),
        edges=random.uniform(0.5, 1.8),
        bottom=random.uniform(1.7, 2.1),
        thickness={name: random.uniform(0.95, 1.05) for name in names},
        lumps=(*pins, *((float(m), tuple(map(float, at))) for m, at in boxes)),
    )


def truth(seed: int, drawn: Panels, modes: Modes, places: list[Place]) -> dict[str, Real]:
    """What is kept of a structure.

    Args:
        seed: of the structure.
        drawn: the drawing's mesh, whose nodes are the same.
        modes: the drawing's.
        places: sensors and struck points.
    """
    own = build(seed)
    panels = panels_of(own)
    found = modes_of(panels, own.bending, COUNT)
    shapes = found.shapes[:, [place.node for place in places]]
    pairs = _pairs(drawn, modes, found)
    return {
        "frequencies": found.frequencies,
        "shapes": shapes.astype(np.float32),
        "pairs": pairs,
        "mass": np.array(panels.mass),
    }


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
