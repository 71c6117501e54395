"""Natural frequencies and damping ratios of objects that have poles."""

import numpy as np

from identification.words._arrays import Complex, Real


class HasPoles:
    """Base class that derives natural frequencies and damping ratios from poles.

    A pole is s_r = w_r (-zeta_r + i sqrt(1 - zeta_r^2)) (seed, eq. 3.4).

    Attributes:
        poles: s_r [rad/s]; (n_mode,).
    """

    poles: Complex

    @property
    def freq_hz(self) -> Real:
        """Natural frequencies |s_r| / 2 pi [Hz]; (n_mode,)."""
        frequency: Real = np.abs(self.poles) / (2 * np.pi)
        return frequency

    @property
    def damping(self) -> Real:
        """Damping ratios zeta_r = -Re s_r / |s_r|, 0 for a pole at rest; (n_mode,)."""
        size = np.abs(self.poles)
        ratio: Real = np.where(size > 0, -self.poles.real / np.where(size > 0, size, 1.0), 0.0)
        return ratio
