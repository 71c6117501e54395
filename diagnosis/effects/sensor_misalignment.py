"""A sensor whose axes are turned beyond tolerance: true axes = rotation of the drawn axes."""

from collections.abc import Iterator

from diagnosis.hypothesis import Effect, Hypothesis, Scene, release_tolerance
from diagnosis.scene_points import list_sensors, list_varying_names, name_vector
from identification import FAULT_PHRASES


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each sensor whose angles have a tolerance."""
    varying = list_varying_names(scene)
    for site in list_sensors(scene):
        names = name_vector(f"{site}.rotation_")
        if varying.issuperset(names):
            yield release_tolerance(
                "sensor_misalignment", f"sensor:{site}", None, names, "rotation"
            )


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["sensor_misalignment"],
    means="the axes of {place} are turned beyond tolerance",
    confirm="glue {place} anew along the drawing's axes and repeat one hit",
    undoes=True,
)
