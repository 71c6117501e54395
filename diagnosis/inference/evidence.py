"""Evidence of a verdict as plain numbers, which can be kept and weighed again.

Fits take seconds, the posterior a millisecond. The constants of the posterior are therefore
calibrated on evidence that is kept, and a new calibration needs no fit.
"""

from pydantic import BaseModel, ConfigDict

from identification.words import VarianceSource

Key = tuple[str, str, str | None]  # effect, location, dof
BENDS = "flexible_body"  # what redundant channels prove of a body, not of a sensor
# Share by which the variance may be wrong: from coherences, from third differences of sharp modes.
BADLY_KNOWN = {"coherence": 0.1, "differences": 0.3}


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Named(_Row):
    effect: str
    location: str
    dof: str | None

    @property
    def key(self) -> Key:
        """Effect, location and direction."""
        return self.effect, self.location, self.dof


class Scored(_Named):
    """Score test of the best hypothesis of an effect and place.

    Args:
        gain: predicted gain in log likelihood at the null model's floor [nats].
    """

    gain: float


class FitSummary:
    """Objective of a fit, and its residual gap beyond the noise.

    The residual's mean square over the stated variance exceeds one by the gap only if that variance
    is right, which from a few hits it is not. Neighbouring lines share the gap, but not the noise
    of sensors: the mean product of their residuals is the gap's mean square whatever the noise
    (``Misfit.serial_covariance``). Beside modes narrower than the lags it misses a gap, so that chi
    square counts too, less what a badly known variance may add.

    Args:
        chi_square: mean square of residual over noise; 1 is noise alone.
        serial: mean product of the residuals of neighbouring lines; None where lines share noise.
        doubt: what chi square may exceed one by where nothing is missing.
        cost: -ln L at the floor, mean of all values [nats].
        prior: cost of the tolerances, half the sum of their squared shifts [nats].
        fitted_values: number of values that the fit saw.
    """

    chi_square: float
    serial: float | None
    doubt: float
    cost: float
    prior: float
    fitted_values: int

    @property
    def objective(self) -> float:
        """Objective of the fit per value [nats]: -ln L at the floor, and cost of tolerances."""
        return self.cost + self.prior / self.fitted_values

    @property
    def gap(self) -> float:
        """Mean square of the residual gap over that of the noise."""
        beyond = self.chi_square - 1
        return beyond if self.serial is None else max(self.serial, beyond - self.doubt)


class FittedSet(_Row, FitSummary):
    """A set of causes, fitted at its own model-error floor; the empty set is the null model.

    Args:
        keys: causes of the set.
        floor: relative model error.
        cost: -ln L at the floor, mean of all values [nats].
        prior: cost of the tolerances, half the sum of their squared shifts [nats].
        values: number of values.
        fitted_values: number of those that the fit saw.
        noise_share: mean share of the noise in the variance of a value.
        effective_values: number of independent values in the residual.
        chi_square, serial, doubt: as of ``FitSummary``.
        shifts: of each cause that only releases tolerances, how far these are shifted [standard
            deviations of a single one]; else None.
    """

    keys: tuple[Key, ...]
    floor: float
    cost: float
    prior: float = 0.0
    values: int
    fitted_values: int
    noise_share: float
    effective_values: float
    chi_square: float
    serial: float | None = None
    doubt: float = BADLY_KNOWN["differences"]
    shifts: tuple[float | None, ...] = ()


class ForceGain(_Row):
    """Gain of an unknown force of any spectrum at one place, in its best direction.

    Args:
        location: a joint or body.
        dof: about or along which world axis; None of a joint that is drawn askew.
        gain: gain in log likelihood [nats], less what it would gain by chance.
        share: gain over the cost of the residual.
    """

    location: str
    dof: str | None
    gain: float
    share: float = 0.0


class Evidence(_Row):
    """All that a verdict is judged by.

    Args:
        proven: faults that redundant channels prove; they are corrected in every set.
        unknown: places of sensors that are proven wrong by no fault of the catalogue.
        null: the null model.
        unbounded: the gap of the null model if no tolerance is bounded; None if not fitted.
        largest_shift: the largest tolerance then [standard deviations].
        sets: sets of causes, in the order of their fits.
        pushed: places, the one first whose free force explains most of the null model's gap.
        rest_pushed: places, likewise of what the most probable set of causes leaves.
        hypotheses: number of effects and places that were scored.
        variance: where the noise's variance comes from; the worse source if there are two.
        unsteady: number of tests that met different machines from hit to hit.
        scored: score tests, the most promising first; no judgement needs them.
    """

    proven: tuple[Key, ...] = ()
    unknown: tuple[str, ...] = ()
    null: FittedSet
    unbounded: float | None = None
    largest_shift: float = 0.0
    sets: tuple[FittedSet, ...] = ()
    pushed: tuple[ForceGain, ...] = ()
    rest_pushed: tuple[ForceGain, ...] = ()
    hypotheses: int = 0
    variance: VarianceSource
    unsteady: int = 0
    scored: tuple[Scored, ...] = ()

    @property
    def gap_source(self) -> str:
        """Source of the gap: neighbouring lines, or the origin of the noise's variance."""
        return self.variance if self.null.serial is None else "lines"
