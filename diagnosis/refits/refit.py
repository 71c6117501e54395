"""A fit with a set of causes, at its own model-error floor, and the statistics of its residual."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtri

from diagnosis.hypothesis import Hypothesis
from diagnosis.inference.evidence import FittedSet, Key
from diagnosis.refits.level_dependence import measure_level_dependence
from diagnosis.stated_values import Value
from identification.words import Campaign, Real
from tuning import (
    Fit,
    Misfit,
    Parametrisation,
    Session,
    predict,
    residual_statistics,
    thin_lines,
    thinning_slice,
)


@dataclass(frozen=True, eq=False)
class Refit:
    """Fit with a set of causes, at its own model-error floor.

    Args:
        causes: causes of the set; none for the null model.
        session: campaign corrected for the causes, model with their Parts.
        fit: fitted parameters.
        summary: plain numbers of the fit, as the evidence keeps them.
    """

    causes: tuple[Hypothesis, ...]
    session: Session
    fit: Fit
    summary: FittedSet

    @property
    def keys(self) -> tuple[Key, ...]:
        """Effect, location and direction of each cause."""
        return tuple(cause.key for cause in self.causes)

    @property
    def floor(self) -> float:
        """Relative model error."""
        return self.summary.floor

    @property
    def gap(self) -> float:
        """Mean square of the residual gap over that of the noise."""
        return self.summary.gap

    @property
    def objective(self) -> float:
        """Objective of the fit per value [nats]."""
        return self.summary.objective

    def state_parameters(self, cause: Hypothesis) -> dict[str, Value]:
        """Return the parameters of a cause as the verdict states them."""
        return cause.state(map_values(self.fit.parametrisation, self.fit.theta))

    def find_direction(self, cause: Hypothesis) -> str | None:
        """Return the direction that the fit gives a cause."""
        return cause.along(map_values(self.fit.parametrisation, self.fit.theta))

    def count_parameters(self, cause: Hypothesis) -> int:
        """Return the number of parameters that the fit gives a cause.

        Tolerances without their prior count, and parameters of Parts. Those at a bound do not, nor
        those that stay at zero, such as the direction of a link without stiffness. A prior narrower
        than the unit of its parameter makes it a tolerance, which does not count.
        """
        varies, x = self.fit.parametrisation, self.fit.x
        narrow = {name for name, deviation in cause.believed.items() if deviation < 1}
        added = {p.name for part in cause.parts for p in part.parameters}
        added -= {*cause.follow, *narrow}
        is_added = np.isin(np.array(varies.names), [*added, *cause.release])
        free = is_added & ~varies.coordinates_at_bound(x) & (x != 0)
        return int(free.sum())

    @property
    def shows_another_effect(self) -> bool:
        """Whether a cause ended at an upper bound where its Parts describe another effect."""
        varies, x = self.fit.parametrisation, self.fit.x
        limited = [name for cause in self.causes for name in cause.valid_below_bound]
        is_limited = np.isin(np.array(varies.names), limited)
        is_upper = varies.upper - x < x - varies.lower
        return bool((is_limited & is_upper & varies.coordinates_at_bound(x)).any())

    def tolerance_shift(self, cause: Hypothesis) -> float | None:
        """Return how far a cause that only releases tolerances shifts them (``find_shift``).

        Returns:
            z in standard deviations; None for a cause that adds or corrects something.
        """
        released = np.isin(np.array(self.fit.parametrisation.names), cause.release)
        return find_shift(cause, self.fit.x[released])


def find_shift(cause: Hypothesis, released: Real) -> float | None:
    """Return how far a cause that only releases tolerances shifts them.

    The shift z is as improbable as that of a single tolerance: with the sum of squares chi square
    distributed, z = -Phi^-1(p / 2) of its upper tail p.

    Args:
        released: coordinates of its tolerances; (n_released,).

    Returns:
        z in standard deviations; None for a cause that adds or corrects something.
    """
    if cause.parts or cause.correct or cause.reform or not cause.release:
        return None
    tail = max(float(chdtrc(released.size, released @ released)), np.finfo(float).tiny)
    return -float(ndtri(tail / 2))


def map_values(parametrisation: Parametrisation, theta: Real) -> dict[str, float]:
    """Return parameters [SI] by name."""
    names = (parameter.name for parameter in parametrisation.parameters)
    return dict(zip(names, theta.tolist(), strict=True))


def describe_fit(session: Session, fit: Fit, stride: int, lags: Sequence[int]) -> Refit:
    """Return a fit with the statistics of its residual, before ``complete_refit`` adds its causes.

    Args:
        session: model, campaign and coordinates.
        stride: every ``stride``-th line was fitted; the statistics are those of twice as many.
        lags: distances of neighbouring lines [lines]; none if lines share noise.

    Raises:
        ValueError: no channel moves.
    """
    counted = thin_lines(session.campaign, max(1, stride // 2))
    predicted = predict(session.model, fit.theta, counted)
    statistics = residual_statistics(predicted, counted)
    if statistics is None:
        raise ValueError("no channel moves, so that no model error shows")
    serial = None
    if lags:
        campaign, lines = session.campaign, len(session.campaign.freq_hz)
        misfit = Misfit(session.model, campaign, session.parametrisation, model_error_floor=0.0)
        fitted = np.isin(np.arange(lines), np.arange(lines)[thinning_slice(lines, stride)])
        serial = misfit.serial_covariance(fit.x, lags, fitted)
        if serial is not None:
            serial -= mean_shared_part(campaign)
    fitted_lines = len(thin_lines(session.campaign, stride).freq_hz)
    fitted_values = max(1, round(statistics.values * fitted_lines / len(counted.freq_hz)))
    excess = measure_level_dependence(predicted, counted)
    summary = FittedSet(
        keys=(),
        fitted_values=fitted_values,
        serial=serial,
        level_excess=excess,
        **vars(statistics),
    )
    return Refit((), session, fit, summary)


def mean_shared_part(campaign: Campaign) -> float:
    """Return the mean product of neighbouring residuals by errors that a state before brings along.

    Args:
        campaign: tests, the variance of which says what part of it neighbouring lines share.
    """
    estimates = [test.estimate for test in campaign.tests]
    if all(estimate.shared is None for estimate in estimates):
        return 0.0
    parts = [
        np.zeros(0) if estimate.shared is None else estimate.shared[estimate.variance > 0]
        for estimate in estimates
    ]
    return float(np.concatenate(parts).mean())
