"""A sensor that sits elsewhere than drawn: true place - drawn place, beyond tolerance."""

from collections.abc import Iterator, Mapping

from diagnosis.effects.points import names_of, sensors, three
from diagnosis.hypothesis import Hypothesis, Scene, Value


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each sensor whose place has a tolerance."""
    known = names_of(scene)
    for site in sensors(scene):
        names = three(f"{site}.position_")
        if known.issuperset(names):

            def state(
                found: Mapping[str, float], offsets: tuple[str, ...] = names
            ) -> dict[str, Value]:
                return {"offset": tuple(found[name] for name in offsets)}

            yield Hypothesis("sensor_position", f"sensor:{site}", release=names, state=state)
