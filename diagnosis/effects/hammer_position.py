"""Hits at another place than drawn, beyond tolerance: in one direction, or in all at a point.

A shift of a force along its line changes nothing, so that this component keeps its tolerance. The
verdict states the offset per axis as the mean over the directions that show it.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.effects.points import hits, list_varying_names, name_vector
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Dof


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each point, and one for each of its directions if it has several."""
    varying = list_varying_names(scene)
    points: dict[str, list[Dof]] = {}
    for dof in hits(scene):
        if varying.issuperset(_name_offset(dof)):
            points.setdefault(dof.point, []).append(dof)
    for point, directions in points.items():
        yield _release_offset(scene, point, None, directions)
        if len(directions) > 1:
            for dof in directions:
                yield _release_offset(scene, point, dof.direction[1:], [dof])


def _name_offset(dof: Dof) -> tuple[str, ...]:
    """Return the names of the offset of one direction's hits."""
    return name_vector(f"hammer({dof.point}:{dof.direction[1:]}).position_")


def _release_offset(scene: Scene, point: str, dof: str | None, directions: list[Dof]) -> Hypothesis:
    """Return the hypothesis that releases the offset of these directions across each of them."""
    layout = scene.model.machine.layout
    axes = layout.axes[layout.points.index(point)]
    shown: list[list[str]] = [[], [], []]  # names by world axis
    for hit in directions:
        along = int(np.abs(axes[:, hit.axis]).argmax())
        for axis, name in enumerate(_name_offset(hit)):
            if axis != along:
                shown[axis].append(name)

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        return {
            "offset": tuple(
                float(np.mean([fitted[name] for name in names])) if names else 0.0
                for names in shown
            )
        }

    release = tuple(name for names in shown for name in names)
    return Hypothesis("hammer_position", f"hammer:{point}", dof, release=release, state=state)


EFFECT = Effect(
    propose,
    noun="hits at another place than drawn",
    means="the hits at {place} lie elsewhere than drawn",
    confirm="measure where the hammer hits at {place}, correct the model, and hit it again there",
    undoes=True,
)
