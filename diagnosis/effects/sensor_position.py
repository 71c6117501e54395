"""A sensor at another place than drawn: offset = true place - drawn place, beyond tolerance.

It stays in the box of its body (``body_box``). A component that changes no reading, since the body
does not turn that way, keeps its tolerance and is not stated.
"""

from collections.abc import Iterator, Mapping

from diagnosis.effects.body_box import (
    bound_place,
    find_jacobian,
    find_shown_offsets,
    select_names,
)
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_sensors, list_varying_names, name_vector
from diagnosis.stated_values import Value, state_shown
from identification import FAULT_PHRASES
from identification.words import Mask, group_by_key


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each sensor whose place has a tolerance."""
    varying = list_varying_names(scene)
    # A rotation of a solid body reads the same everywhere on it.
    outputs = scene.session.campaign.outputs
    read = group_by_key((dof.point, dof.axis) for dof in outputs if not dof.is_rotation)
    machine, jacobian = scene.model.machine, find_jacobian(scene)
    layout = machine.layout
    for site in (site for site in list_sensors(scene) if site in read):
        names = name_vector(f"{site}.position_")
        if not varying.issuperset(names):
            continue
        at = layout.points.index(site)
        body = int(layout.body_of[at])
        shown = find_shown_offsets(jacobian, body, layout.axes[at][:, read[site]])
        if shown.any():
            yield _release(names, site, shown, bound_place(machine, [body], layout.positions[at]))


def _release(
    names: tuple[str, ...], site: str, shown: Mask, ends: tuple[tuple[float, float], ...]
) -> Hypothesis:
    """Return the release of the components of a place that show."""

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        return {"offset": state_shown([fitted[name] for name in names], shown.tolist())}

    release = select_names(names, shown)
    bounds = {name: end for name, end in zip(names, ends, strict=True) if name in release}
    return Hypothesis(
        "sensor_position", f"sensor:{site}", release=release, bounds=bounds, state=state
    )


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_position"],
    means="{place} sits elsewhere than drawn",
    confirm="measure where {place} sits, or glue it anew and repeat one hit",
    undoes=True,
)
