"""Hits that lie elsewhere than drawn, beyond tolerance: of one direction, or of all at a point.

A force may be shifted along its own line without an effect: that component keeps its tolerance. The
offset of a point is stated per axis as the mean over the directions that show it.
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
        if varying.issuperset(_offset(dof)):
            points.setdefault(dof.point, []).append(dof)
    for point, directions in points.items():
        yield _hypothesis(scene, point, None, directions)
        if len(directions) > 1:
            for dof in directions:
                yield _hypothesis(scene, point, dof.direction[1:], [dof])


def _offset(dof: Dof) -> tuple[str, ...]:
    """Return the names of the offset of one direction's hits."""
    return name_vector(f"hammer({dof.point}:{dof.direction[1:]}).position_")


def _hypothesis(scene: Scene, point: str, dof: str | None, directions: list[Dof]) -> Hypothesis:
    """Return the hypothesis that releases the offset of these directions across each of them."""
    layout = scene.model.machine.layout
    axes = layout.axes[layout.points.index(point)]
    shown: list[list[str]] = [[], [], []]  # names by world axis
    for hit in directions:
        along = int(np.abs(axes[:, hit.axis]).argmax())
        for axis, name in enumerate(_offset(hit)):
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
