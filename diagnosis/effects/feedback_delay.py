r"""A spring that is a control loop with a delay: k exp(-s tau u) instead of k.

The Part adds

    k (exp(-s tau u) - 1)

to the dynamic stiffness of the spring. The delay tau is scanned, and u is fitted from 1.

To first order in the delay this is a damper -k tau u s, which is tuned anyway. Only the second
order shows the delay, so that the slope at u = 0, with dampers projected out, is zero. The score
test therefore uses the whole change from u = 0 to u = 1. A refit starts at u = 1, with the damping
c + k tau that makes up for the first order. The damping varies linearly there: by its logarithm,
the valley along which u and c vary is curved, and fits end far from its bottom.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from diagnosis.effects.spring_laws import Shape
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages
from diagnosis.stated_values import Value
from identification.words import Complex, Real
from mbmodel import AddedPart, Change, Parameter
from mbmodel.parts.spring_laws import LateForce

# Of the best score: scores hardly show how long a delay is, and fits do not return from one that is
# far too long. Of scores this close, that of the shortest delay comes first.
_DELAY_TIE_SHARE = 0.03


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each spring of each joint and each delay of the scan."""
    machine = scene.model.machine
    tuned = {parameter.name for parameter in scene.model.parameters}
    directions = {spring.name: spring.direction for spring in machine.springs}
    dofs = {axle.joint: axle.dof for axle in machine.axles}
    omega = 2 * np.pi * float(scene.session.campaign.freq_hz[-1])
    for stage in find_sprung_stages(machine):
        for spring in find_own_springs(machine, stage):
            if f"{spring}.stiffness" not in tuned:
                continue
            damping, most = f"{spring}.damping", _find_max_damping(scene, spring)
            k = float(scene.find_stiffness((spring,))[0])
            c = float(scene.find_damping((spring,))[0])
            for number, phase in enumerate(scene.settings.delay_phases_rad, start=1):
                tau = phase / omega
                if most is not None and c + k * tau > most:
                    break
                loop = _DelayedSpring(
                    f"{spring}.delayed{number}", directions[spring][:, None], tau, k
                )
                damper = {} if most is None else {damping: c + k * tau}
                yield Hypothesis(
                    "feedback_delay",
                    f"joint:{stage}",
                    dofs[spring],
                    parts=(loop.build_part(f"joint:{stage}"),),
                    begin={loop.size_name: 1.0} | damper,
                    scored=(loop.size_name,),
                    follow={loop.stiffness_name: f"{spring}.stiffness"},
                    linear=tuple(damper),
                    tie_share=_DELAY_TIE_SHARE,
                    signed=True,
                    state=loop.state,
                )


def _find_max_damping(scene: Scene, spring: str) -> float | None:
    """Return the upper bound of a spring's damping; None if the damping does not vary."""
    parametrisation = scene.session.parametrisation
    name = f"{spring}.damping"
    if name not in parametrisation.names:
        return None
    names = [parameter.name for parameter in parametrisation.parameters]
    return float(parametrisation.theta(parametrisation.upper)[names.index(name)])


@dataclass(frozen=True, eq=False)
class _DelayedSpring:
    """One spring that acts late; its parameters are u and the stiffness of the spring.

    Args:
        name: prefix of the parameters.
        frame: direction of the spring; (nv, 1).
        tau: delay of the scan [s].
        stiffness: fitted stiffness of the spring, where it starts.
    """

    name: str
    frame: Real
    tau: float
    stiffness: float

    @property
    def size_name(self) -> str:
        """Name of u."""
        return f"{self.name}.size"

    @property
    def stiffness_name(self) -> str:
        """Name of the stiffness that follows that of the spring."""
        return f"{self.name}.stiffness"

    def build_part(self, location: str) -> AddedPart:
        """Return the Part with the delay."""
        parameters = (
            Parameter(self.size_name, 0.0, f"{self.tau:g} s", positive=False),
            Parameter(self.stiffness_name, self.stiffness, "N/m or N m/rad"),
        )
        return AddedPart(location, parameters, self.compute_change, self.compute_slopes)

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change k (exp(-s tau u) - 1); none without a delay."""
        shape = LateForce(self.tau * float(theta[0]))
        return (self._build_change(np.array(theta[1]), shape),) if theta[0] else ()

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by u and k; at u = 0, the change up to u = 1 in place of that by u."""
        u, k = theta.tolist()
        shape = _delay_slope(self.tau, u) if u else LateForce(self.tau)
        changes = [self._build_change(np.array([k, 0.0]), shape)]
        if u:
            by_stiffness = LateForce(self.tau * u)
            changes.append(self._build_change(np.array([0.0, 1.0]), by_stiffness))
        return tuple(changes)

    def _build_change(self, core: Real, shape: Shape) -> Change:
        whole = np.zeros((*core.shape, 3, 1, 1))
        whole[..., 0, 0, 0] = core
        return Change("joint", self.frame, self.frame, whole, shape=shape)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the delay [s]."""
        return {"delay": self.tau * fitted[self.size_name]}


@lru_cache(1024)
def _delay_slope(tau: float, u: float) -> Shape:
    """Return -s tau exp(-s tau u)."""

    def shape(laplace: Complex) -> Complex:
        return np.asarray(-laplace * tau * np.exp(-laplace * tau * u), complex)

    return shape


EFFECT = Effect(
    propose,
    noun="a control loop with a delay",
    means="the spring of {place} {direction} is a control loop that acts late",
    confirm="open the loop of {place} {direction}, or change its gain, and repeat: the effect goes",
    undoes=True,
)
