"""Hits at another place than drawn, beyond tolerance: in one direction, or in all at a point.

A shift of a force along its line changes nothing, nor does one whose moment turns nothing: this
component keeps its tolerance, and is not stated. The verdict states the offset per axis as the mean
over the directions that show it. The hits stay in the box of their body (``body_box``).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from diagnosis.effects.body_box import bound_place, find_jacobian, find_shown_offsets
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import hits, list_varying_names, name_vector
from diagnosis.stated_values import Value
from identification.words import Dof, group_by_key


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each point, and one for each of its directions if it has several."""
    varying = list_varying_names(scene)
    points = group_by_key(
        (dof.point, dof) for dof in hits(scene) if varying.issuperset(_name_offset(dof))
    )
    for point, directions in points.items():
        released = [_release_offset(scene, point, None, directions)]
        if len(directions) > 1:
            released += [
                _release_offset(scene, point, dof.direction[1:], [dof]) for dof in directions
            ]
        yield from (hypothesis for hypothesis in released if hypothesis is not None)


def _name_offset(dof: Dof) -> tuple[str, ...]:
    """Return the names of the offset of one direction's hits."""
    return name_vector(f"hammer({dof.point}:{dof.direction[1:]}).position_")


def _release_offset(
    scene: Scene, point: str, dof: str | None, directions: list[Dof]
) -> Hypothesis | None:
    """Return the release of the offset of these directions across each of them; None if unseen."""
    machine = scene.model.machine
    layout, at = machine.layout, machine.layout.points.index(point)
    body, bounds = int(layout.body_of[at]), {}
    ends = bound_place(machine, [body], layout.positions[at])
    shown: list[list[str]] = [[], [], []]  # names by world axis
    for hit in directions:
        force = layout.axes[at][:, hit.axis]
        is_shown = find_shown_offsets(find_jacobian(scene), body, force[:, None])
        is_shown[np.abs(force).argmax()] = False
        for axis in np.flatnonzero(is_shown).tolist():
            name = _name_offset(hit)[axis]
            shown[axis].append(name)
            bounds[name] = ends[axis]

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        return {
            "offset": tuple(
                float(np.mean([fitted[name] for name in names])) if names else None
                for names in shown
            )
        }

    release = tuple(name for names in shown for name in names)
    if not release:
        return None
    return Hypothesis(
        "hammer_position", f"hammer:{point}", dof, release=release, bounds=bounds, state=state
    )


EFFECT = Effect(
    propose,
    noun="hits at another place than drawn",
    means="the hits at {place} lie elsewhere than drawn",
    confirm="measure where the hammer hits at {place}, correct the model, and hit it again there",
    undoes=True,
)
