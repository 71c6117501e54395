"""Evidence of a verdict as plain numbers, which can be kept and weighed again.

Fits take seconds, the posterior takes a millisecond. The constants of the posterior are therefore
calibrated on stored evidence, and a new calibration needs no fit.
"""

from collections.abc import Iterable
from math import log

from pydantic import ConfigDict

from diagnosis.inference.calibration import Calibration
from identification.readers.result_files import ResultFile, StrictRow
from identification.words import VarianceSource
from tuning import is_gap_visible

Key = tuple[str, str, str | None]  # effect, location, dof
Site = tuple[str, str]  # effect, location
BENDS = "flexible_body"  # the effect on a body, not on a sensor, that redundant channels prove


def read_site(key: Key) -> Site:
    """Return effect and location, which several directions of one cause share."""
    return key[0], key[1]


class _Row(StrictRow):
    model_config = ConfigDict(allow_inf_nan=True)


class NamedRow(StrictRow):
    """Row of a cause: an effect at a place, in a direction or in all."""

    effect: str
    location: str
    dof: str | None

    @property
    def key(self) -> Key:
        """Effect, location and direction."""
        return self.effect, self.location, self.dof


class Scored(NamedRow):
    """Score of the best hypothesis of an effect and place.

    Args:
        gain: predicted gain in log likelihood at the null model's floor [nats].
    """

    gain: float


class FittedSet(_Row):
    """Set of causes, fitted at its own model-error floor; the empty set is the null model.

    Chi square, the mean square of the residual over the stated variance, exceeds one by the gap if
    that variance is right, which it is not with a few hits. Neighbouring lines share the gap, but
    not the noise of sensors. The mean product of their residuals is therefore the mean square of
    the gap, whatever the noise (``Misfit.serial_covariance``). It misses a gap at modes narrower
    than the lags, so that chi square counts too, less the error of a badly known variance.

    Args:
        keys: causes of the set.
        chi_square: mean square of residual over noise; 1 is noise alone.
        floor: relative model error.
        serial: mean product of the residuals of neighbouring lines; None where lines share noise.
        doubt: excess of chi square over one that a badly known variance explains.
        cost: -ln L at the floor, mean of all values [nats].
        prior: cost of the tolerances, half the sum of their squared shifts [nats].
        fitted_values: number of values that the fit saw.
        noise_share: mean share of the noise in the variance of a value.
        values: number of values.
        level_excess: how far residuals depend on the level (``level_dependence``); None where no
            point was hit at several levels.
        effective_values: number of independent values in the residual.
        shifts: shift of the tolerances that each cause releases [standard deviations of a single
            one]; None for a cause that does not only release tolerances.
        parameters: number of fitted parameters of each cause; none if empty.
    """

    keys: tuple[Key, ...]
    chi_square: float
    floor: float
    serial: float | None = None
    doubt: float = 0.0
    cost: float
    prior: float = 0.0
    fitted_values: int
    noise_share: float
    values: int
    level_excess: float | None = None
    effective_values: float
    shifts: tuple[float | None, ...] = ()
    parameters: tuple[int, ...] = ()

    @property
    def objective(self) -> float:
        """Objective of the fit per value [nats]: -ln L at the floor, and cost of tolerances."""
        return self.cost + self.prior / self.fitted_values

    @property
    def gap(self) -> float:
        """Mean square of the residual gap over that of the noise."""
        beyond = self.chi_square - 1
        return beyond if self.serial is None else max(self.serial, beyond - self.doubt)

    def count_independent(self, constants: Calibration) -> float:
        """Return the number of independent values in the residual.

        A badly known variance of the noise looks like a model error too. The share of the noise is
        therefore at least what the gap leaves, 1 - gap / chi square.
        """
        without_gap = 1 - max(self.gap, 0.0) / self.chi_square
        return constants.count_independent(max(self.noise_share, without_gap), self.values)

    def gain_between_levels(
        self, null: "FittedSet", best: "FittedSet", constants: Calibration
    ) -> float:
        """Return the gain in log likelihood from differences of residuals between levels [nats].

        Errors that all levels share cancel in these differences. What remains is noise and the
        level dependence e that the fit does not explain (``level_dependence``). By the profile
        likelihood over its size, the gain is N ln[(1 + e_0) / (1 + e_S)], N the number of
        independent values at the share 1 / (1 + e) of the best fit. An excess that a badly known
        variance explains counts as none.

        Args:
            best: the fit whose residual says how many values are independent.
        """
        if self.level_excess is None or null.level_excess is None or best.level_excess is None:
            return 0.0
        of_null, of_fit, of_best = (
            1 + max(summary.level_excess or 0.0, self.doubt) for summary in (null, self, best)
        )
        return constants.count_independent(1 / of_best, self.values) * log(of_null / of_fit)

    def is_material_step(
        self, before: "FittedSet", min_closed: float, null: "FittedSet | None" = None
    ) -> bool:
        """Return whether one more cause closes so much of the gap that remains without it.

        Beside a strong effect a weaker one closes little of the gap of the null model. Where other
        causes leave no visible gap, a further one is material only if it closes as much of a
        visible gap of the null model: either of two effects may leave less than is visible.

        Args:
            before: fit without the cause.
            min_closed: part of its gap.
            null: the null model; None if only the gap before counts.
        """
        closed = before.gap - self.gap
        if not before.keys or is_gap_visible(before.gap):
            return closed >= min_closed * before.gap
        if null is None or not is_gap_visible(null.gap):
            return False
        return closed >= min_closed * null.gap

    @property
    def parameter_count(self) -> int:
        """Number of fitted parameters of all causes."""
        return sum(self.parameters)


class ForceGain(_Row):
    """Gain of an unknown force of any spectrum at one place, in its best direction.

    Args:
        location: a joint or body.
        dof: world axis along or about which it acts; None if the joint is drawn askew.
        gain: gain in log likelihood [nats], less the mean gain by chance.
        share: gain over the cost of the residual.
    """

    location: str
    dof: str | None
    gain: float
    share: float = 0.0


class Evidence(ResultFile, _Row):
    """Evidence of a verdict.

    Args:
        proven: faults that redundant channels prove; every set corrects them.
        small_faults: other faults that redundant channels prove; sets may contain them.
        unknown: places of sensors with a proven fault that is not in the catalogue.
        sets: sets of causes, in the order of their fits.
        pushed: free forces that explain the gap of the null model, the largest gain first.
        rest_pushed: free forces that explain the gap with the selected causes.
        hypotheses: number of effects and places that were scored.
        variance: where the noise's variance comes from; the worse source if there are two.
        unsteady: number of tests whose machine changed from hit to hit.
        scored: scores, the most promising first; the posterior does not need them.
        rejected: sets that do not predict held-out lines; none that contains one is admitted.
        interchangeable: pairs of places of one effect whose refits take the same off the gap.
    """

    proven: tuple[Key, ...] = ()
    small_faults: tuple[Key, ...] = ()
    unknown: tuple[str, ...] = ()
    null: FittedSet
    sets: tuple[FittedSet, ...] = ()
    pushed: tuple[ForceGain, ...] = ()
    rest_pushed: tuple[ForceGain, ...] = ()
    hypotheses: int = 0
    variance: VarianceSource
    unsteady: int = 0
    scored: tuple[Scored, ...] = ()
    rejected: tuple[tuple[Key, ...], ...] = ()
    interchangeable: tuple[tuple[Site, Site], ...] = ()

    @property
    def admitted_sets(self) -> tuple[FittedSet, ...]:
        """Sets that contain none that held-out lines reject."""
        return tuple(fitted for fitted in self.sets if self.admits(fitted.keys))

    def admits(self, keys: Iterable[Key]) -> bool:
        """Return whether a set contains none that held-out lines reject."""
        causes = set(keys)
        return not any(set(rejected) <= causes for rejected in self.rejected)

    def price_causes(self, keys: Iterable[Key]) -> float:
        """Return what the uniform prior of all hypotheses takes for causes [nats]."""
        return len(set(keys) - set(self.small_faults)) * log(max(self.hypotheses, 1))

    @property
    def gap_source(self) -> str:
        """Source of the gap: neighbouring lines, or the origin of the noise's variance."""
        return self.variance if self.null.serial is None else "lines"
