"""Settings of laws that depend on the level: steps of the simulation, starts and ends of fits."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LevelSettings:
    """Sizes of the simulation and of the refits of laws.

    Args:
        steps_per_period: time steps per period of the highest line; the force, straight between
            them, is then within 0.2 % of its own.
        series_bound: of ``|lambda h|``; below it the weights of a step are taken from their series.
        negligible_mode_share: of the highest resonance of the joint's stretch: modes below it are
            not simulated.
        block_steps: steps over which the linear machine is propagated at once; a divisor of the
            next.
        transformed_hits: hits whose forces are transformed at once; all of them leave the cache.
        look_steps: steps between two looks whether the joint still acts.
        quiet_share: of the largest step of the force; below it the joint acts no more.
        end_decay: logarithm of the decay of the slowest mode at the end of a simulated record.
        max_records: blocks of the FRFs that a simulated record may be long.
        newton_steps: of a cubic that begins at the stretch of the step before.
        drift_share: of the lowest line: frequency that a mode without a spring gets.
        durations: shortest and longest duration of hits times the highest line; 1.5 is the first
            zero of a half sine's spectrum.
        usual_duration: duration times the highest line where the variance does not tell it: the
            force then falls to a quarter at the highest line.
        duration_count: number of durations that are tried.
        recorded_durations: shortest and longest duration of hits times the limit of their records.
        recorded_duration_count: number of durations that are tried, in equal ratios.
        peak_sigma: standard deviation of a test's peak, relative: the mean of some hits by hand.
        duration_sigma: standard deviation of the duration that the noise of FRFs tells, relative.
        hit_scatter: usual standard deviation of the momentum of single hits by hand, relative.
        hit_sizes: sizes of hits that stand for all, and half of them in difference quotients: the
            stiffness of a gap stays rough by 4 % with two, by 1 % with eight.
        variance_sigma: standard deviation of the logarithm of its square; the scatter is between
            8 and 18 %.
        level_unit: of the fitted stiffness, per unit of a level's stiffness and damping.
        difference_step: relative, of difference quotients by a law's parameters. Where a decaying
            motion touches a stop or slides for the last time is rough in them on a scale of 1 %.
        linear_step: relative step of difference quotients by a joint's linear stiffness. It shifts
            resonances by up to half as much, which must stay within their width.
        steps_per_turn: Gauss-Newton steps of a turn: the law is linear in it, and so nearly is all.
        max_turns: simulations of a law, each about the machine that the refit before left.
        settled_nats: per value: a step of a fit alone that gains less is the last one.
        converged_nats: per value: a turn that promises less is the last one: about one nat of a
            campaign's 100,000 values, so that sizes are within their intervals.
        first_radius: of the trust region, for logarithms of sizes: what the FRFs show was within
            half of its change over 0.2, and beyond it over 0.6. It doubles after a turn that keeps
            half of its promise, up to the largest step of a start, shrinks to a quarter after a
            turn that lowers nothing, and ends below the step of difference quotients.
        max_start_behind_nats: per value: a law that is farther behind the best one before the
            machine is refitted about it, or after two turns, goes no further.
        max_behind_nats: per value: a law that is farther behind the best one goes no further after
            a third of the turns.
        min_gain_share: of what the best linear cause gains: laws that gain less are not refitted.
        min_own_share: of the stiffness at the lowest level that a joint's own spring begins with.
        start_stride: every so manyth line counts where starts are sought.
        coarse_steps_per_period: of simulations where starts are sought and in difference quotients:
            they are within 2 % of exact ones.
        fitted_families: best families of an effect that are fitted alone, before one is refitted.
        start_steps: Levenberg-Marquardt steps of these fits.
        start_damping: their first damping.
        damping_factor: by which it falls after a step that lowers the cost, and rises after others.
        compared_change: of the joint's stiffness, of the FRFs that the products of receptances
            follow from.
        largest_start_step: of a coordinate, the logarithm of a size: a factor of 2.
        element_shares: stiffness of a sliding element where fits begin, of that at rest.
        slip_shares: stretch at which it slides, of the largest linear one.
        cubic_signs: of k3; both are tried.
        stiffening_shares: relative stiffening at the largest linear stretch where fits begin.
        softening_shares: relative softening there.
        gap_shares: gaps where fits begin, of the largest linear stretch; the basin of a gap that
            the motion often crosses is narrow.
        loose_gap_shares: further gaps, which the motion does not leave at the lowest level; a refit
            begins at one of them too, since a law with the rest of a machine held tells nothing of
            them.
        gap_centres: centres of the gap where fits begin, of the gap to either side; the joint rests
            in its middle, or lifts off at 0.3, 2 or 7 times the gap.
        element_ends: ends of an element's stiffness, of the joint's.
        slip_ends: ends of its limit, of the joint's force at the largest linear stretch.
        stiffening_ends: ends of the relative stiffening at the largest stretch of all levels.
        softening_ends: ends of the softening there; a sixth leaves half the tangent.
        gap_ends: ends of the gap, of the largest stretch of all levels.
        centre_ends: ends of its centre, of the gap.
    """

    steps_per_period: int = 40
    series_bound: float = 1e-2
    negligible_mode_share: float = 1e-4
    block_steps: int = 32
    transformed_hits: int = 32
    look_steps: int = 512
    quiet_share: float = 1e-4
    end_decay: float = 7.0
    max_records: int = 4
    newton_steps: int = 5
    drift_share: float = 0.01
    durations: tuple[float, float] = (0.2, 1.4)
    usual_duration: float = 1.0
    duration_count: int = 121
    recorded_durations: tuple[float, float] = (0.05, 20.0)
    recorded_duration_count: int = 121
    peak_sigma: float = 0.05
    duration_sigma: float = 0.1
    hit_scatter: float = 0.12
    hit_sizes: int = 12
    variance_sigma: float = 0.8
    level_unit: float = 0.1
    difference_step: float = 0.05
    linear_step: float = 0.02
    steps_per_turn: int = 3
    max_turns: int = 12
    settled_nats: float = 2e-3
    converged_nats: float = 1e-5
    first_radius: float = 0.25
    max_start_behind_nats: float = 0.5
    max_behind_nats: float = 0.1
    min_gain_share: float = 0.5
    min_own_share: float = 0.05
    start_stride: int = 8
    coarse_steps_per_period: int = 16
    fitted_families: int = 3
    start_steps: int = 8
    start_damping: float = 1e-2
    damping_factor: float = 10.0
    compared_change: float = 0.1
    largest_start_step: float = 0.7
    element_shares: tuple[float, ...] = (0.15, 0.5, 2.0, 8.0)
    slip_shares: tuple[float, ...] = (0.02, 0.06, 0.2, 0.6)
    cubic_signs: tuple[float, ...] = (1.0, -1.0)
    stiffening_shares: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3, 1.0)
    softening_shares: tuple[float, ...] = (0.001, 0.003, 0.01)
    gap_shares: tuple[float, ...] = tuple(0.003 * 10 ** (k / 8) for k in range(17))
    loose_gap_shares: tuple[float, ...] = (0.3, 0.42, 0.6, 1.0)
    gap_centres: tuple[float, ...] = (0.0, 1.3, -1.3, 3.0, -3.0, 8.0, -8.0)
    element_ends: tuple[float, float] = (1e-3, 30.0)
    slip_ends: tuple[float, float] = (1e-5, 30.0)
    stiffening_ends: tuple[float, float] = (1e-6, 1e3)
    softening_ends: tuple[float, float] = (1e-6, 1 / 6)
    gap_ends: tuple[float, float] = (1e-6, 10.0)
    centre_ends: tuple[float, float] = (-30.0, 30.0)


LEVEL_SETTINGS = LevelSettings()
