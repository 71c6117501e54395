r"""A spring that is a control loop with a delay: k exp(-s tau) instead of k.

    Z += k (exp(-s tau u) - 1) on the spring, tau scanned, u fitted from 1

The first power of the delay is a damper, which is tuned anyway, so that nothing tells a short delay
from it but its square: at u = 0 there is no slope to be scored by. What is scored is the whole
change from u = 0 to 1, for delays from half a radian at the highest line in even steps. A refit
begins at u = 1, with a damper that makes up for the first power, c + k tau; it varies by itself: by
its logarithm the valley along which both vary is curved, and fits end in it far from its bottom.
"""

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from diagnosis.effects.points import find_own_springs, find_sprung_stages, list_varying_names
from diagnosis.effects.spring_laws import Shape
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Real
from mbmodel import AddedPart, Change, Parameter

_PHASE_STEP_RAD, _DELAYS = 0.6, 8  # rad at the highest line; so many times that
_ALIKE_SHARE = (
    0.03  # of the gain: nothing tells how long a delay is; from far too long no fit comes back
)
_MAX_DAMPING_RATIO = 90.0  # times the joint's drawn damping


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each spring of each joint and delay."""
    machine = scene.model.machine
    tuned = {parameter.name for parameter in scene.model.parameters}
    varies = list_varying_names(scene)
    directions = {spring.name: spring.direction for spring in machine.springs}
    called = {axle.joint: axle.dof for axle in machine.axles}
    drawn = {spring.name: spring.damping for spring in machine.springs}
    unit = _PHASE_STEP_RAD / (2 * np.pi * float(scene.session.campaign.freq_hz[-1]))
    for stage in find_sprung_stages(machine):
        for spring in find_own_springs(machine, stage):
            stiffness = f"{spring}.stiffness"
            if stiffness not in tuned:
                continue
            (k,), (c,) = (
                scene.find_stiffness((spring,)).tolist(),
                scene.find_damping((spring,)).tolist(),
            )
            for number in range(1, _DELAYS + 1):
                tau = number * unit
                damping = f"{spring}.damping"
                if damping in varies and c + k * tau > _MAX_DAMPING_RATIO * drawn[spring]:
                    break  # the damper that makes up for it is beyond its bound
                loop = _Loop(f"{spring}.delayed{number}", directions[spring][:, None], tau, k)
                yield Hypothesis(
                    "feedback_delay",
                    f"joint:{stage}",
                    called[spring],
                    parts=(loop.part(f"joint:{stage}"),),
                    begin={loop.size: 1.0} | ({damping: c + k * tau} if damping in varies else {}),
                    scored=(loop.size,),
                    follow={loop.follows: stiffness},
                    linear=(damping,) if damping in varies else (),
                    tie_share=_ALIKE_SHARE,
                    signed=True,
                    state=loop.state,
                )


class _Loop:
    """One spring that acts late; theta is u and the spring's stiffness."""

    def __init__(self, name: str, frame: Real, tau: float, stiffness: float) -> None:
        self._frame, self._tau, self._begin = frame, tau, stiffness
        self.size, self.follows = f"{name}.size", f"{name}.stiffness"

    def part(self, location: str) -> AddedPart:
        """As a Part."""
        parameters = (
            Parameter(self.size, 0.0, f"{self._tau:g} s", positive=False),
            Parameter(self.follows, self._begin, "N/m or N m/rad"),
        )
        return AddedPart(location, parameters, self.finite, self.derivatives)

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """The law ``k (exp(-s tau u) - 1)``; nothing without a delay."""
        late = _late(self._tau * float(theta[0]))
        return (self._change(np.array(theta[1]), late),) if theta[0] else ()

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By u and k; by u at zero the whole change up to one."""
        u, k = theta.tolist()
        shape = _turning(self._tau, u) if u else _late(self._tau)
        changes = [self._change(np.array([k, 0.0]), shape)]
        if u:
            changes.append(self._change(np.array([0.0, 1.0]), _late(self._tau * u)))
        return tuple(changes)

    def _change(self, core: Real, shape: Shape) -> Change:
        whole = np.zeros((*core.shape, 3, 1, 1))
        whole[..., 0, 0, 0] = core
        return Change("joint", self._frame, self._frame, whole, shape=shape)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """The delay [s]."""
        return {"delay": self._tau * fitted[self.size]}


@lru_cache(1024)  # those of all springs are one: their columns are formed together
def _late(tau: float) -> Shape:
    """Exp(-s tau) - 1."""
    return lambda laplace: np.asarray(np.expm1(-laplace * tau), complex)


@lru_cache(1024)
def _turning(tau: float, u: float) -> Shape:
    """-s tau exp(-s tau u)."""
    return lambda laplace: np.asarray(-laplace * tau * np.exp(-laplace * tau * u), complex)


EFFECT = Effect(
    propose,
    noun="a control loop with a delay",
    means="the spring of {place} {direction} is a control loop that acts late",
    confirm="open the loop of {place} {direction}, or change its gain, and repeat: the effect goes",
    undoes=True,
)
