"""Dynamic stiffness of a unit mass on a spring with a damper, relative to what it hangs on.

With the natural frequency w0 and the damping ratio zeta,

    R(s) = s^2 S / (s^2 + S),   S = 2 zeta w0 s + w0^2,   dR/dS = s^4 / (s^2 + S)^2.
"""

from functools import lru_cache

import numpy as np

from diagnosis.effects.spring_laws import Shape
from identification.words import Complex


@lru_cache(1024)  # appendages of all bodies share it: their columns are formed together
def build_resonator(omega: float, zeta: float) -> Shape:
    """Return R(s).

    Args:
        omega: natural frequency [rad/s].
        zeta: damping ratio.
    """

    def shape(laplace: Complex) -> Complex:
        spring = 2 * zeta * omega * laplace + omega**2
        return np.asarray(laplace**2 * spring / (laplace**2 + spring), complex)

    return shape


def build_resonator_slope(omega: float, zeta: float, rate: tuple[float, float]) -> Shape:
    """Return the slope of R(s) by a parameter p of its spring.

    Args:
        omega [rad/s], zeta: as for ``build_resonator``.
        rate: dS/dp, as coefficients of s and of 1.
    """

    def shape(laplace: Complex) -> Complex:
        spring = 2 * zeta * omega * laplace + omega**2
        change = rate[0] * laplace + rate[1]
        return np.asarray(laplace**4 / (laplace**2 + spring) ** 2 * change, complex)

    return shape
