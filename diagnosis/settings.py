"""Settings of the diagnosis: every threshold of the algorithm, with its unit and its reason.

Units and scans of the effects stand with them, in ``effects/``.
``make bench ONLY=ablation`` turns each off in turn; ``docs/benchmarks.md`` has the table.
Constants that virtual campaigns calibrate stand in ``inference/calibration.json``.

Shares of a whole that count as nothing.
"""

from dataclasses import dataclass, field

import numpy as np

from tuning import FloorSchedule


@dataclass(frozen=True)
class DiagnosisSettings:
    """Thresholds and sizes of the search.

    Args:
        schedule: fits in turn with their floor, of the null model and of each refit.
        score_stride: frequency lines of score tests and free forces: every ``score_stride``-th.
        max_refits: hypotheses of each round that are refitted, one for each effect and place;
            causes of the place where the gap lies, variants and laws come on top.
        max_variants: refits of the best hypothesis of a round from distant starts, where a strong
            effect may be found that the null model hides in stiff springs; and as many of its
            further directions and shapes. Also the causes that replace an earlier one at most, and
            the sets that begin anew from the drawing.
        bending_start_ratios: starts of the frequency of a body's mode, relative to that of its
            highest peak: free bodies resonate higher than those that carry others.
        min_proven_probability: probability from which the data checks prove a fault.
        max_bending_bodies: bodies that are candidates for bending: each takes several refits. If
            more of them bend, the data checks prove no small faults of sensors.
        max_causes: number of causes of the largest set.
        min_closed: part of the gap that an established cause closes.
        min_probability: probability of an established cause.
        force_floor_ratio: part of the model-error floor that counts for free forces: with a force
            that explains the gap the floor falls.
        min_local_share: part of the rest that a force of any spectrum at one place explains where
            the rest is local: a single effect mostly acts in several directions of its place.
        outlier_sigma: standard deviations up to which a tolerance is no effect: among 300
            tolerances four lie beyond 2.5, none beyond 4.5 (probability 0.002).
        min_twin_cosine: cosine of two signatures from which causes are confounded.
        twin_nats: difference in log probability below which causes are confounded.
        min_place_cosine: cosine of what two refits take off the gap, from which one effect at
            either place is one cause.
        min_row_probability: probability of a cause or place that the verdict lists.
        appendage_ends: ends of the frequencies of appendages that are scanned, relative to the
            highest line. Below, an appendage acts as a free mass; above, as a part of the body.
        serial_lags: distances of neighbouring lines that show a gap by their product [lines]: a
            variance from third differences is correlated over three lines, a mode spans several.
        max_added_mass_share: mass that an effect adds at most, as a share of that of its body: a
            heavier one belongs to another body.
        delay_phases_rad: phases at the highest line of the delays that are scanned [rad].
        max_force_values: values of the normal equations of free forces in memory at once.
        force_powers: mean power of a free force relative to the noise, at the median line; the best
            of these counts.
        interval_points: random points of the ellipsoid of confidence on which intervals of
            nonlinear parameters are found.
        added_mass_share: known mass of a next experiment, as a share of the body's mass.
        predicted_share: part of all tests in which a predicted size is found.
        predicted_shapes: shapes of an effect at a place that a prediction compares.
        predicted_directions: directions of each: of 24 the ninth tenth is known to a few per cent.
        predicted_size_steps: doublings of a predicted size at most, from the deviation of the one
            that a fit finds, and halvings of the last: to two per cent.
        slope_tolerance: relative difference of the slopes of a plug-in from central differences.
    """

    schedule: FloorSchedule = field(default_factory=FloorSchedule)
    score_stride: int = 12
    max_refits: int = 8
    max_variants: int = 2
    bending_start_ratios: tuple[float, ...] = (1.0, 1.5, 2.2)
    min_proven_probability: float = 0.9
    max_bending_bodies: int = 2
    max_causes: int = 5
    min_closed: float = 0.2
    min_probability: float = 0.5
    force_floor_ratio: float = 0.1
    min_local_share: float = 0.4
    outlier_sigma: float = 4.5
    min_twin_cosine: float = 0.9
    twin_nats: float = 3.0
    min_place_cosine: float = 0.95
    min_row_probability: float = 0.01
    serial_lags: tuple[int, ...] = (3, 4, 5, 6)
    appendage_ends: tuple[float, float] = (1 / 40, 1.2)
    max_added_mass_share: float = 3.0
    delay_phases_rad: tuple[float, ...] = (0.6, 1.2, 1.8, 2.4, 3.0, 3.6, 4.2, 4.8)
    max_force_values: int = 2**24
    force_powers: tuple[float, ...] = (1.0, 10.0, 100.0, 1e3, 1e4)
    interval_points: int = 100
    added_mass_share: float = 0.1
    predicted_share: float = 0.9
    predicted_shapes: int = 6
    predicted_directions: int = 24
    predicted_size_steps: tuple[int, int] = (12, 5)
    slope_tolerance: float = 0.01


SETTINGS = DiagnosisSettings()


# Rounding errors of a calculation, and what keeps a factor positive: half of the digits.
HALF_PRECISION = float(np.sqrt(np.finfo(float).eps))
NEGLIGIBLE_SHARE = 1e-6  # a curvature, slope, mass or probability that is none
