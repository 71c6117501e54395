"""A channel whose gain is beyond its tolerance: a wrong calibration value."""

from collections.abc import Iterator, Mapping

from diagnosis.effects.points import names_of, sensors
from diagnosis.hypothesis import Hypothesis, Scene, Value


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each channel whose gain has a tolerance."""
    known = names_of(scene)
    for site in sensors(scene):
        for axis in "xyz":
            name = f"{site}.gain_{axis}"
            if name not in known:
                continue

            def state(found: Mapping[str, float], gain: str = name) -> dict[str, Value]:
                return {"gain": found[gain]}

            yield Hypothesis(
                "sensor_gain", f"sensor:{site}", f"t{axis}", release=(name,), state=state
            )
