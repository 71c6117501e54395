"""A Maxwell branch in parallel with the springs of a joint: stiffness rises with frequency.

With the static stiffness k, all springs of the joint get

    K += ratio k s tau / (1 + s tau).

The time constant is scanned and fitted. The scan goes from 1 / w of the highest line, above which
the branch is a damper, to twice that of the lowest line, below which it is a spring. Its steps are
at most a factor of e, less than a relaxation is wide.
"""

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from diagnosis.effects.spring_laws import Law, Shape, TimedLaw
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages
from diagnosis.stated_values import Value
from identification.words import Complex
from mbmodel.parts.spring_laws import Relaxation


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint and time constant of the scan."""
    machine = scene.model.machine
    omega = 2 * np.pi * scene.session.campaign.freq_hz
    shortest, longest = 1 / float(omega[-1]), 2 / float(omega[omega > 0].min())
    times = np.geomspace(shortest, longest, 1 + int(np.ceil(np.log(longest / shortest))))
    for stage in find_sprung_stages(machine):
        springs, place = find_own_springs(machine, stage), f"joint:{stage}"
        for number, tau in enumerate(times.tolist()):
            law = TimedLaw(tau, Relaxation, _maxwell_slope)
            branch = Law.for_springs(scene, place, springs, f"{stage}.maxwell{number}", law)

            def state(fitted: Mapping[str, float], spring_law: Law = branch) -> dict[str, Value]:
                ratio = fitted[spring_law.size_name]
                return {"ratio": ratio, "tau": spring_law.read_time(fitted)}

            yield from branch.propose("viscoelastic", None, state, otherwise=(1.0,))


@lru_cache(1024)  # all joints share it: their columns are formed together
def _maxwell_slope(tau: float) -> Shape:
    """Return the slope by ln tau, s tau / (1 + s tau)^2."""

    def shape(laplace: Complex) -> Complex:
        return np.asarray(laplace * tau / (1 + laplace * tau) ** 2, complex)

    return shape


EFFECT = Effect(
    propose,
    noun="a stiffness that rises with frequency",
    means="the joint of {place} stiffens with frequency: rubber, a hydraulic or air damper",
    confirm="repeat with {place} at another temperature: the time constant moves",
)
