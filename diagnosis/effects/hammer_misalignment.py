"""Hits of one direction that went another way than drawn, beyond tolerance.

A rotation of a hit about its direction changes nothing, so that this component keeps its tolerance.
The verdict states the shortest rotation from the drawn direction a to the fitted one b,

    r = (a x b) / |a x b| times the angle between them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene, release_tolerance
from diagnosis.scene_points import hits, list_varying_names, name_vector
from diagnosis.stated_values import Value
from identification.words import Real
from mbmodel import rotation_matrix


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each direction of each point that was hit."""
    varying, layout = list_varying_names(scene), scene.model.machine.layout
    for dof in hits(scene):
        direction = dof.direction[1:]
        names = name_vector(f"hammer({dof.point}:{direction}).rotation_")
        if varying.issuperset(names):
            place = f"hammer:{dof.point}"
            whole = release_tolerance("hammer_misalignment", place, direction, names, "rotation")
            across = tuple(name for name in names if name[-1] != direction[-1])
            drawn = layout.axes[layout.points.index(dof.point)][:, dof.axis]

            def state(
                fitted: Mapping[str, float],
                components: tuple[str, ...] = names,
                drawn: Real = drawn,
            ) -> dict[str, Value]:
                turn = rotation_matrix(np.array([fitted[name] for name in components]))
                return {"rotation": tuple(_find_rotation(drawn, turn @ drawn).tolist())}

            yield replace(whole, release=across, state=state)


def _find_rotation(start: Real, end: Real) -> Real:
    """Return the shortest rotation vector from one unit vector to another; (3,)."""
    axis = np.cross(start, end)
    sine, cosine = float(np.linalg.norm(axis)), float(start @ end)
    return axis * (np.arctan2(sine, cosine) / sine if sine > 0 else 1.0)


EFFECT = Effect(
    propose,
    noun="hits along another direction than stated",
    means="the hits at {place} {direction} went another way than drawn",
    confirm="hit {place} {direction} again, guided or from the other side: cross-talk changes",
    undoes=True,
)
