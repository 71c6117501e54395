"""A spring that is a control loop with a delay: k exp(-s tau) instead of k.

The first power of tau is a damper, which is tuned anyway, so that nothing tells a short delay from
it but its square. Delays are scanned, from half a radian at the highest line in even steps; what
is added is a k (exp(-s tau) - 1), whose size a and delay are fitted from there. Of a short delay
a tau^2 is all that shows, and sqrt(a) tau is what is stated: of a long one a is one.
"""

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from diagnosis.effects.laws import Law, Shape, Timed
from diagnosis.effects.points import jointed, springs_of
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value

_TURN, _SCANNED = 0.6, 8  # rad at the highest line; so many times that
_STEP = 0.1


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each spring of each joint and delay."""
    machine = scene.model.machine
    unit = _TURN / (2 * np.pi * float(scene.session.campaign.freq_hz[-1]))
    for stage in jointed(machine):
        for spring in springs_of(machine, stage):
            for number in range(1, _SCANNED + 1):
                law = Timed(number * unit, _STEP, _late, _by_time)
                name, place = f"{spring}.delayed{number}", f"joint:{stage}"
                loop = Law(scene, place, (spring,), name, law)

                def state(found: Mapping[str, float], one: Law = loop) -> dict[str, Value]:
                    return {"delay": one.tau(found) * float(np.sqrt(max(found[one.size], 0.0)))}

                yield from loop.hypotheses(
                    "feedback_delay", spring.removeprefix(f"{stage}_"), state
                )


@lru_cache(1024)  # those of all springs are one: their columns are formed together
def _late(tau: float) -> Shape:
    """Exp(-s tau) - 1."""
    return lambda laplace: np.asarray(np.expm1(-laplace * tau), complex)


def _by_time(tau: float) -> Shape:
    """-s tau exp(-s tau)."""
    return lambda laplace: np.asarray(-laplace * tau * np.exp(-laplace * tau), complex)


EFFECT = Effect(
    propose,
    noun="a control loop with a delay",
    means="the spring is a control loop that acts late",
    confirm="repeat with the loop open or its gain changed: the effect goes or changes with it",
)
