"""What became of the hits of a hammer test: the FRFs, which hits made them, which did not, why."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.words._arrays import Real, frozen
from identification.words.dof import Dof
from identification.words.frf import FrfEstimate

Estimator = Literal["H1", "H2", "Hv"]


@dataclass(frozen=True)
class Hit:
    """One blow of the hammer.

    Args:
        record: in which it is, from 1.
        number: among all hits of its records, by time, from 1.
        time_s: of its first rise, from the start of its record [s].
        peak_n: largest force, signed [N].
    """

    record: int
    number: int
    time_s: float
    peak_n: float


@dataclass(frozen=True)
class Rejected:
    """A hit that was left out.

    Args:
        record: in which it is, from 1.
        hit: its number, from 1.
        time_s: of its first rise, from the start of its record [s].
        reason: in words.
    """

    record: int
    hit: int
    time_s: float
    reason: str

    def __str__(self) -> str:
        """Number, place and reason."""
        return f"hit {self.hit} (record {self.record}, {self.time_s:.3g} s): {self.reason}"


@dataclass(frozen=True, eq=False)
class Densities:
    """Amplitude spectral densities, one-sided.

    Args:
        freq_hz: [Hz]; (n_freq,).
        force: [N/sqrt(Hz)]; (n_freq,).
        motion: [unit of the records/sqrt(Hz)]; (n_freq, n_out).
    """

    freq_hz: Real
    force: Real
    motion: Real

    def __post_init__(self) -> None:
        """Validate and freeze."""
        freq = frozen(self.freq_hz, np.float64, (None,), "freq_hz")
        object.__setattr__(self, "freq_hz", freq)
        object.__setattr__(self, "force", frozen(self.force, np.float64, freq.shape, "force"))
        motion = frozen(self.motion, np.float64, (freq.size, None), "motion")
        object.__setattr__(self, "motion", motion)


@dataclass(frozen=True, eq=False)
class HitEstimate:
    """FRFs estimated from the hits of one reference, and how.

    Args:
        test: the file.
        reference: where and along what the hammer hit.
        estimate: FRFs on all lines from 0 to half the rate, coherence, variance, number of hits
            kept as averages, exponential window as window_tau.
        estimator: H1, H2 or Hv.
        kept: hits that were averaged.
        rejected: hits that were not.
        rate_hz: of the records [Hz].
        block_s: length of a hit's block [s].
        pretrigger_s: of it before the hit's first rise [s].
        force_window_s: longest part of a block in which the force was kept [s].
        left: share of the response that is left where the blocks end, of its largest, without
            the exponential window, in the channel that rings longest.
        densities: of the kept blocks, before the exponential window.
        noise: before the hits, or None where the records start with them.
        remarks: sentences that a reader of the result must know.
    """

    test: str
    reference: Dof
    estimate: FrfEstimate
    estimator: Estimator
    kept: tuple[Hit, ...]
    rejected: tuple[Rejected, ...]
    rate_hz: float
    block_s: float
    pretrigger_s: float
    force_window_s: float
    left: float
    densities: Densities
    noise: Densities | None = None
    remarks: tuple[str, ...] = ()

    @property
    def highest_hz(self) -> float:
        """0.8 of half the rate [Hz]: above it anti-aliasing filters reach."""
        return 0.4 * self.rate_hz
