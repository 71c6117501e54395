"""A Maxwell branch beside a joint's springs: stiffness rises with frequency.

K += ratio k s tau / (1 + s tau) on all springs of the joint, k the static stiffness. The time
constant is scanned, and fitted from there: from tau = 1 / w of the highest line, above which the
branch is a damper, to twice that of the lowest, below which it is a spring.
"""

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from diagnosis.effects.points import find_own_springs, find_sprung_stages
from diagnosis.effects.spring_laws import Law, Shape, Timed
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value

_TIME_CONSTANTS = 6
_LOG_TAU_UNIT = 0.3


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint and time constant."""
    machine = scene.model.machine
    omega = 2 * np.pi * scene.session.campaign.freq_hz
    lowest = float(omega[omega > 0].min())
    for stage in find_sprung_stages(machine):
        springs, place = find_own_springs(machine, stage), f"joint:{stage}"
        for number, tau in enumerate(
            np.geomspace(1 / float(omega[-1]), 2 / lowest, _TIME_CONSTANTS)
        ):
            law = Timed(float(tau), _LOG_TAU_UNIT, _maxwell, _by_time)
            branch = Law.for_springs(scene, place, springs, f"{stage}.maxwell{number}", law)

            def state(fitted: Mapping[str, float], spring_law: Law = branch) -> dict[str, Value]:
                return {"ratio": fitted[spring_law.size], "tau": spring_law.tau(fitted)}

            yield from branch.propose("viscoelastic", None, state, otherwise=(1.0,))


@lru_cache(1024)  # those of all joints are one: their columns are formed together
def _maxwell(tau: float) -> Shape:
    """The law ``s tau / (1 + s tau)``."""
    return lambda laplace: np.asarray(laplace * tau / (1 + laplace * tau), complex)


def _by_time(tau: float) -> Shape:
    """Its slope by log tau, ``s tau / (1 + s tau)^2``."""
    return lambda laplace: np.asarray(laplace * tau / (1 + laplace * tau) ** 2, complex)


EFFECT = Effect(
    propose,
    noun="a stiffness that rises with frequency",
    means="the joint of {place} stiffens with frequency: rubber, a hydraulic or air damper",
    confirm="repeat with {place} at another temperature: the time constant moves",
)
