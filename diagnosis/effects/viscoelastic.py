"""A Maxwell branch beside a joint's springs: stiffness rises with frequency.

K += ratio k s tau / (1 + s tau) on all springs of the joint, k the static stiffness. The time
constant is scanned, and fitted from there: from tau = 1 / w of the highest line, above which the
branch is a damper, to twice that of the lowest, below which it is a spring.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from diagnosis.effects.points import along, jointed, springs_of
from diagnosis.hypothesis import Hypothesis, Scene, Value
from identification.words import Complex, Real
from mbmodel import AddedPart, Change, Parameter

_SCANNED = 6
_STEP = 0.3  # of the logarithm of tau per unit of its parameter


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint and time constant."""
    machine = scene.model.machine
    omega = 2 * np.pi * scene.session.campaign.freq_hz
    lowest = float(omega[omega > 0].min())
    for stage in jointed(machine):
        springs = springs_of(machine, stage)
        slope = along(machine, springs, scene.stiffness(springs))
        for number, tau in enumerate(np.geomspace(1 / float(omega[-1]), 2 / lowest, _SCANNED)):
            branch = _Branch(f"{stage}.maxwell{number}", slope, float(tau))
            yield Hypothesis(
                "viscoelastic",
                f"joint:{stage}",
                parts=(branch.part(f"joint:{stage}"),),
                scored=(branch.ratio,),
                springs=springs,
                signed=True,
                state=branch.state,
            )


class _Branch:
    """A Maxwell branch in parallel to all springs of a joint."""

    def __init__(self, name: str, slope: Change, tau: float) -> None:
        self.ratio, self.time = f"{name}.ratio", f"{name}.tau"
        self.slope, self.tau = slope, tau

    def part(self, location: str) -> AddedPart:
        """As a Part."""
        units = ((self.ratio, "1"), (self.time, "30 %"))
        parameters = tuple(Parameter(name, 0.0, unit, positive=False) for name, unit in units)
        return AddedPart(location, parameters, self.finite, self.derivatives)

    def _at(self, step: float) -> float:
        return self.tau * float(np.exp(_STEP * step))

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """The branch."""
        shape = _maxwell(self._at(theta[1]))
        return (replace(self.slope, core=theta[0] * self.slope.core[0], shape=shape),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By the ratio, then by the time constant."""
        zero, core = np.zeros_like(self.slope.core), self.slope.core
        tau = self._at(theta[1])
        return (
            replace(self.slope, core=np.concatenate([core, zero]), shape=_maxwell(tau)),
            replace(self.slope, core=np.concatenate([zero, theta[0] * core]), shape=_by_time(tau)),
        )

    def state(self, found: Mapping[str, float]) -> dict[str, Value]:
        """What the verdict calls them."""
        return {"ratio": found[self.ratio], "tau": self._at(found[self.time])}


def _maxwell(tau: float) -> Callable[[Complex], Complex]:
    """S tau / (1 + s tau)."""
    return lambda laplace: np.asarray(laplace * tau / (1 + laplace * tau), complex)


def _by_time(tau: float) -> Callable[[Complex], Complex]:
    """Its derivative per unit of the time constant's parameter, s tau / (1 + s tau)^2 by ln tau."""
    return lambda laplace: np.asarray(_STEP * laplace * tau / (1 + laplace * tau) ** 2, complex)
