"""Stability margins of one loop, and of all loops at once."""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real


@dataclass(frozen=True)
class Margin:
    """A margin and its frequency.

    Args:
        value: infinite (or 0, of a gain reduction) where no change of this kind is critical; of
            gains up to a factor of 1000.
        freq_hz: at which it is taken [Hz]; not a number without one.
    """

    value: float
    freq_hz: float = float("nan")

    @property
    def is_finite(self) -> bool:
        """Whether a change of this kind is critical."""
        return bool(np.isfinite(self.value) and np.isfinite(self.freq_hz))


@dataclass(frozen=True, eq=False)
class LoopMargins:
    """Margins of one loop, all others closed.

    Args:
        crossover: frequency above which |L| stays below one [Hz]; its value is the frequency.
        bandwidth: lowest frequency at which |S| rises above 1 / sqrt(2) [Hz], likewise.
        gain: factor above one by which the gain may rise.
        reduction: factor below one to which it may fall; 0 if it may vanish.
        phase: [deg]; negative where phase lead is critical.
        delay: that may be added [s].
        modulus: smallest distance of L from -1.
        gain_crossovers: frequencies with |L| = 1 [Hz], and phase margins there [deg]; (n, 2).
        phase_crossovers: frequencies with L real and negative [Hz], and 1 / |L| there; (n, 2).
    """

    crossover: Margin
    bandwidth: Margin
    gain: Margin
    reduction: Margin
    phase: Margin
    delay: Margin
    modulus: Margin
    gain_crossovers: Real
    phase_crossovers: Real

    def __repr__(self) -> str:
        """Return the margins in one line."""
        crossover = self.crossover
        at = f"crossover {crossover.value:.4g} Hz" if crossover.is_finite else "no crossover"
        return (
            f"gain {self.gain.value:.3g}, phase {self.phase.value:.3g} deg, delay "
            f"{self.delay.value:.3g} s, modulus {self.modulus.value:.3g} (|S| at most "
            f"{1 / self.modulus.value:.3g}), {at}"
        )


@dataclass(frozen=True, eq=False)
class AllMargins:
    """Margins of each loop, and of all at once.

    Args:
        loops: of each loop; n_loop.
        modulus: of all loops at once, their units scaled out.
        singular: 1 / max sigma(S) in SI units of the signals.
        freq_hz: lines that follow the loop gains [Hz]; (n_freq,).
        gains: GK there; (n_freq, n_loop, n_loop).
    """

    loops: tuple[LoopMargins, ...]
    modulus: Margin
    singular: Margin
    freq_hz: Real
    gains: Complex
