"""A sensor at another place than drawn: offset = true place - drawn place, beyond tolerance."""

from collections.abc import Iterator

from diagnosis.effects.points import list_sensors, list_varying_names, name_vector
from diagnosis.hypothesis import Effect, Hypothesis, Scene, release_tolerance
from identification import FAULT_PHRASES


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each sensor whose place has a tolerance."""
    varying = list_varying_names(scene)
    # A rotation of a solid body reads the same everywhere on it.
    moving = {dof.point for dof in scene.session.campaign.outputs if not dof.is_rotation}
    for site in (site for site in list_sensors(scene) if site in moving):
        names = name_vector(f"{site}.position_")
        if varying.issuperset(names):
            yield release_tolerance("sensor_position", f"sensor:{site}", None, names, "offset")


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_position"],
    means="{place} sits elsewhere than drawn",
    confirm="measure where {place} sits, or glue it anew and repeat one hit",
    undoes=True,
)
