"""Hits of a hammer test: those averaged, those rejected, and the FRFs estimated from them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.words._arrays import Complex, Real, frozen_array
from identification.words.frf import FrfEstimate
from identification.words.ports import Input

Estimator = Literal["H1", "H2", "Hv"]


@dataclass(frozen=True)
class Hit:
    """Hammer hit that was averaged.

    Args:
        record: number of the record that holds the hit, from 1.
        number: number of the hit among all hits of the test, by time, from 1.
        time_s: time of the first rise of the force, from the start of the record [s].
        peak_n: largest force, signed [N].
        momentum: integral of the force over its window, signed [N s].
    """

    record: int
    number: int
    time_s: float
    peak_n: float
    momentum: float


@dataclass(frozen=True)
class HitRejection:
    """Hit that was not averaged, and the reason.

    Args:
        record: number of the record that holds the hit, from 1.
        hit: number of the hit among all hits of the test, from 1.
        time_s: time of the first rise of the force, from the start of the record [s].
        reason: reason as part of a sentence.
    """

    record: int
    hit: int
    time_s: float
    reason: str

    def __str__(self) -> str:
        """Return the number, the time and the reason."""
        return f"hit {self.hit} (record {self.record}, {self.time_s:.3g} s): {self.reason}"


@dataclass(frozen=True, eq=False)
class SpectralDensities:
    """One-sided amplitude spectral densities of force and motion.

    Args:
        freq_hz: frequencies [Hz]; (n_freq,).
        force: density of the force [N/sqrt(Hz)]; (n_freq,).
        motion: density of the motion [unit of the records/sqrt(Hz)]; (n_freq, n_out).
    """

    freq_hz: Real
    force: Real
    motion: Real

    def __post_init__(self) -> None:
        """Validate and freeze."""
        freq = frozen_array(self.freq_hz, np.float64, (None,), "freq_hz")
        object.__setattr__(self, "freq_hz", freq)
        object.__setattr__(self, "force", frozen_array(self.force, np.float64, freq.shape, "force"))
        motion = frozen_array(self.motion, np.float64, (freq.size, None), "motion")
        object.__setattr__(self, "motion", motion)


@dataclass(frozen=True, eq=False)
class SignalTraces:
    """Force and motion in time, for pictures: signals with many samples are envelopes.

    Args:
        record: number of the record, from 1.
        time_s: time from the start of the record [s]; (n_point,).
        force: force as recorded [N]; (n_point,).
        motion: motion as recorded [unit of the records]; (n_point, n_out).
    """

    record: int
    time_s: Real
    force: Real
    motion: Real

    def __post_init__(self) -> None:
        """Validate and freeze."""
        time = frozen_array(self.time_s, np.float64, (None,), "time_s")
        object.__setattr__(self, "time_s", time)
        object.__setattr__(self, "force", frozen_array(self.force, np.float64, time.shape, "force"))
        motion = frozen_array(self.motion, np.float64, (time.size, None), "motion")
        object.__setattr__(self, "motion", motion)


@dataclass(frozen=True, eq=False)
class PeakSlope:
    """Derivative of the FRFs of one reference by the logarithm of the hits' peak.

    Args:
        values: on all lines of the FRFs; (n_freq, n_out).
        variance: E|error|^2; (n_freq, n_out).
        spread: standard deviation of the logarithm of the peaks.
    """

    values: Complex
    variance: Real
    spread: float

    def __post_init__(self) -> None:
        """Validate and freeze."""
        values = frozen_array(self.values, np.complex128, (None, None), "values")
        object.__setattr__(self, "values", values)
        variance = frozen_array(self.variance, np.float64, values.shape, "variance")
        object.__setattr__(self, "variance", variance)


@dataclass(frozen=True, eq=False)
class HitEstimate:
    """FRFs estimated from the hits of one reference, with the settings that were used.

    Args:
        test: name of the file.
        reference: degree of freedom at which the hammer hit.
        estimate: FRFs on all lines from 0 Hz to half the sampling rate, with coherence and
            variance; ``averages`` counts the kept hits.
        estimator: H1, H2 or Hv.
        kept: hits that were averaged.
        rejected: hits that were not averaged, with their reasons.
        rate_hz: sampling rate of the records [Hz].
        block_s: length of the block of a hit [s].
        pretrigger_s: part of the block before the first rise of the force [s].
        force_window_s: longest part of a block in which the force was kept [s].
        residual_response: amplitude of the response at the end of the blocks over its largest
            amplitude, before the exponential window, in the channel that rings longest.
        whole_record: signals of the record that holds the first kept hit.
        first_block: signals of the block of that hit.
        densities: spectral densities of the kept blocks, before the exponential window.
        noise: spectral densities before the hits, or None if the records start with a hit.
        peak_slope: derivative of the FRFs by the peak of the hits; None for few or equal hits.
        tau_s: time constant of the exponential window that was applied to the records; 0 for none
            [s].
        remarks: sentences that a reader of the result must know.
    """

    test: str
    reference: Input
    estimate: FrfEstimate
    estimator: Estimator
    kept: tuple[Hit, ...]
    rejected: tuple[HitRejection, ...]
    rate_hz: float
    block_s: float
    pretrigger_s: float
    force_window_s: float
    residual_response: float
    whole_record: SignalTraces
    first_block: SignalTraces
    densities: SpectralDensities
    noise: SpectralDensities | None = None
    peak_slope: PeakSlope | None = None
    tau_s: float = 0.0
    remarks: tuple[str, ...] = ()

    @property
    def usable_limit_hz(self) -> float:
        """Upper limit of usable frequencies [Hz]: 0.8 of half the sampling rate.

        Anti-aliasing filters distort the response above it.
        """
        return 0.4 * self.rate_hz
