r"""Restoring laws of a joint direction: force g against the stretch q, with an inner state.

One step of the time integration (``joint_transient``) leaves one equation for the stretch at its
end,

    q = q_free - a g(q),

q_free the stretch without the force of that instant and a > 0 the compliance of one step. Every
law here solves it in closed form or by Newton steps; g is the force beside the linear spring that
the linear machine contains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Protocol

import numpy as np

from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Real


class RestoringLaw(Protocol):
    """A force against a stretch; arrays hold one entry for each hit."""

    def start(self, count: int) -> Real:
        """Return the state at rest; (count,)."""

    def solve(self, free: Real, compliance: Real, state: Real) -> tuple[Real, Real]:
        """Return force and state at the end of a step; (count,) each."""


@dataclass(frozen=True)
class SlidingLaw:
    """Jenkins element without its stuck spring: g = -k y, y the slip (Jenkins 1962).

    The element's force k (q - y) is bounded by the limit; beyond, y follows. The stuck spring k is
    in the linear machine. The state is y.

    Args:
        stiffness: k [N/m or N m/rad].
        limit: [N or N m].
    """

    stiffness: Real | float
    limit: Real | float

    def start(self, count: int) -> Real:
        """Return no slip."""
        return np.zeros(count)

    def solve(self, free: Real, compliance: Real, state: Real) -> tuple[Real, Real]:
        """Stick if the element bears it, else slide at the limit."""
        stuck_force = self.stiffness * (free + compliance * self.stiffness * state - state)
        bounded = np.maximum(np.minimum(stuck_force, self.limit), -self.limit)
        # Sliding: k (q - y) = bounded and q = free + a k y.
        sliding = (free - bounded / self.stiffness) / (1 - compliance * self.stiffness)
        slip = np.where(np.abs(stuck_force) > self.limit, sliding, state)
        return -self.stiffness * slip, slip


@dataclass(frozen=True)
class CubicLaw:
    """g = k3 q^3 (Duffing 1918); softening if k3 is negative. The state is q.

    Args:
        cubic: k3 [N/m^3 or N m/rad^3].
    """

    cubic: Real | float

    def start(self, count: int) -> Real:
        """Return no stretch."""
        return np.zeros(count)

    def solve(self, free: Real, compliance: Real, state: Real) -> tuple[Real, Real]:
        """Solve q + a k3 q^3 = q_free by Newton steps from the stretch before."""
        scaled, stretch = compliance * self.cubic, state
        for _ in range(LEVEL_SETTINGS.newton_steps):
            slope = 1 + 3 * scaled * stretch**2
            stretch = stretch - (stretch + scaled * stretch**3 - free) / slope
        return self.cubic * stretch**3, stretch


@dataclass(frozen=True)
class GapLaw:
    """Dead zone of a spring k: g = -k [clip(q - c, -b, b) + clip(c, -b, b)].

    The spring is in the linear machine; g takes away what it lacks within the gap, and keeps the
    joint at rest at q = 0. The gap spans c - b to c + b. For |c| > b the joint rests against one
    side, with the preload k (|c| - b).

    Args:
        stiffness: k [N/m or N m/rad].
        gap: b, to either side [m or rad].
        centre: c [m or rad].
    """

    stiffness: Real | float
    gap: Real | float
    centre: Real | float = 0.0

    def start(self, count: int) -> Real:
        """Return zeros: nothing is remembered."""
        return np.zeros(count)

    def solve(self, free: Real, compliance: Real, state: Real) -> tuple[Real, Real]:
        """Solve q = q_free - a g(q), which is linear on each of three spans."""
        # Within the gap q - c = (q_free - c + a k rest) / (1 - a k); outside the clip is constant.
        softened = compliance * self.stiffness
        within = (free + (softened * self._at_rest - self.centre)) / (1 - softened)
        missing = np.maximum(np.minimum(within, self.gap), -self.gap) + self._at_rest
        return -self.stiffness * missing, state

    @cached_property
    def _at_rest(self) -> Real:
        """clip(c, -b, b) [m or rad]."""
        return np.maximum(np.minimum(self.centre, self.gap), -np.asarray(self.gap))


def stack_laws(laws: Sequence[RestoringLaw], count: int) -> RestoringLaw:
    """Return laws of one kind side by side, each for some hits.

    Args:
        laws: laws with one value of each parameter.
        count: number of hits of each.
    """
    kind = type(laws[0])
    values = (
        np.repeat(np.array([getattr(law, parameter.name) for law in laws], float), count)
        for parameter in fields(laws[0])  # type: ignore[arg-type]
    )
    return kind(*values)
