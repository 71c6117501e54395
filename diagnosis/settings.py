"""Settings of the diagnosis: every threshold of the algorithm, with its unit and its reason.

Units and scans of the effects stand with them, in ``effects/``.
``make bench ONLY=ablation`` turns each off in turn; ``docs/benchmarks.md`` has the table.
Constants that virtual campaigns calibrate stand in ``inference/calibration.json``.
"""

from dataclasses import dataclass, field

from tuning import MIN_VISIBLE_EXCESS, FloorSchedule


@dataclass(frozen=True)
class DiagnosisSettings:
    """Thresholds and sizes of the search.

    Args:
        min_lines: number of frequency lines; any shape along frequency fits fewer.
        schedule: fits in turn with their floor, for each refit.
        null_schedule: for the null model, from which all others start and which costs most.
        enough_values: FRF values that a fit needs: 3 directions, 69 channels and 850 lines. A
            campaign with more is fitted to every second or third of the usual lines.
        few_frfs: below this number of FRFs several machines fit, and the null model starts
            ``few_frfs`` / (number of FRFs) times, at most ``max_starts`` times.
        max_starts: see ``few_frfs``.
        score_stride: frequency lines of the score tests: every ``score_stride``-th.
        max_refits: hypotheses of each round that are refitted, one for each effect and place.
        max_other_shapes: further shapes or directions of the best refit that are refitted.
        max_distant: refits of the best hypothesis from distant starts: a strong effect may be found
            there that the null model hides in stiff springs.
        bending_start_ratios: starts of the frequency of a body's mode, relative to that of its
            highest peak: free bodies resonate higher than those that carry others.
        min_proven_probability: probability from which the data checks prove a fault.
        max_bending_bodies: bodies that are candidates for bending: each takes several refits. If
            more of them bend, the data checks prove no small faults of sensors.
        max_improbable: rounds that go on from an improbable set while no cause is selected: where
            several effects are present, one alone may explain too little.
        max_causes: number of causes of the largest set.
        min_closed: part of the gap that an established cause closes (FORMATS).
        min_probability: probability of an established cause (FORMATS).
        min_visible_excess: excess over the noise below which a rest is next to nothing (FORMATS).
        force_floor_ratio: part of the model-error floor that counts for free forces: with a force
            that explains the gap the floor falls.
        min_local_share: part of the rest that a force of any spectrum at one place explains where
            the rest is local: a single effect mostly acts in several directions of its place.
        outlier_sigma: standard deviations up to which a tolerance is no effect: among 300
            tolerances four lie beyond 2.5, none beyond 4.5 (probability 0.002).
        min_twin_cosine: cosine of two signatures from which causes are confounded (FORMATS).
        twin_nats: difference in log probability below which causes are confounded (FORMATS).
        min_row_probability: probability of a cause or place that the verdict lists (FORMATS).
        appendage_ends: ends of the frequencies of appendages that are scanned, relative to the
            highest line. Below, an appendage acts as a free mass; above, as a part of the body.
        min_fitted_lines: lines that a fit counts at least, of a campaign that has them: 800 lines
            at a stride of 8.
        serial_lags: distances of neighbouring lines that show a gap by their product [lines]: a
            variance from third differences is correlated over three lines, a mode spans several.
        max_distant_steps: Gauss-Newton steps of the second stage of refits from distant starts.
        appendage_frequencies: number of these frequencies, in steps of 5 % at most.
        max_lost_mass_share: mass that an effect takes from a body at most, as a share of its mass.
        max_added_mass_share: mass that an effect adds at most, and its distance in gyration radii:
            a heavier or farther one belongs to another body.
        delay_phases_rad: phases at the highest line of the delays that are scanned [rad].
        max_force_values: values of the normal equations of free forces in memory at once.
        force_stride: frequency lines of free forces: every ``force_stride``-th.
        force_powers: mean power of a free force relative to the noise, at the median line; the best
            of these counts.
        final_tolerance: relative tolerance of the fit whose parameters are stated, if it is exact:
            0.03 nats for 100 000 values, a quarter of a standard deviation.
        min_fold_gain_nats: predicted gain of the smallest step of a fit without one fold [nats].
        exact_noise_share: share of the noise in the variance of the residual from which the stated
            parameters are fitted without a model error.
        interval_points: random points of the ellipsoid of confidence on which intervals of
            nonlinear parameters are found.
        decisive_nats: expected gain of a next experiment that is enough: less effort then decides.
        added_mass_share: known mass of a next experiment, as a share of the body's mass.
        slope_tolerance: relative difference of the slopes of a plug-in from central differences.
    """

    min_lines: int = 8
    schedule: FloorSchedule = field(default_factory=lambda: FloorSchedule(max_turns=4))
    null_schedule: FloorSchedule = field(default_factory=FloorSchedule)
    enough_values: int = 180_000
    few_frfs: int = 48
    max_starts: int = 16
    score_stride: int = 12
    max_refits: int = 8
    max_other_shapes: int = 2
    max_distant: int = 2
    bending_start_ratios: tuple[float, ...] = (1.0, 1.5, 2.2)
    min_proven_probability: float = 0.9
    max_bending_bodies: int = 2
    max_improbable: int = 2
    max_causes: int = 5
    min_closed: float = 0.2
    min_probability: float = 0.5
    min_visible_excess: float = MIN_VISIBLE_EXCESS
    force_floor_ratio: float = 0.1
    min_local_share: float = 0.4
    outlier_sigma: float = 4.5
    min_twin_cosine: float = 0.9
    twin_nats: float = 3.0
    min_row_probability: float = 0.01
    min_fitted_lines: int = 96
    serial_lags: tuple[int, ...] = (3, 4, 5, 6)
    max_distant_steps: int = 15
    appendage_ends: tuple[float, float] = (1 / 40, 1.2)
    appendage_frequencies: int = 80
    max_lost_mass_share: float = 0.9
    max_added_mass_share: float = 3.0
    delay_phases_rad: tuple[float, ...] = (0.6, 1.2, 1.8, 2.4, 3.0, 3.6, 4.2, 4.8)
    max_force_values: int = 2**24
    force_stride: int = 16
    force_powers: tuple[float, ...] = (1.0, 10.0, 100.0, 1e3, 1e4)
    final_tolerance: float = 3e-7
    min_fold_gain_nats: float = 0.1
    exact_noise_share: float = 0.95
    interval_points: int = 100
    decisive_nats: float = 30.0
    added_mass_share: float = 0.1
    slope_tolerance: float = 0.01


SETTINGS = DiagnosisSettings()
