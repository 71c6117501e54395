"""Confidence in tuned parameters: their covariance, and directions that the data do not determine.

At the minimum the posterior density is approximately normal (Laplace approximation), with the
covariance

    C = (N / s^2 + D)^-1,   s^2 = max(1, sum |r|^2 / var / n).

N are the normal equations of the data, D is the precision of the priors. s^2 lowers the weight of
the data if the model does not fit them to their noise, since missing dynamics bias parameters too.
Parameters without a prior have one here, so that C exists even for a parameter without influence on
the data. Its standard deviation is log 100 for a logarithm; otherwise log 100 units of x, or of the
parameter's own size if that is larger. The data do not determine a parameter or a combination whose
posterior deviation is above 0.7 of the prior's.

Neighbouring lines share the errors of a model, so that they determine less than as many independent
ones. Without the b-th of B bands of lines, whose data have the slope g_b and the normal equations
N_b, the coordinates shift by d_b = (N - N_b + D)^-1 (g_b - g), with g the mean slope. The jackknife
of bands (Efron and Stein 1981) has the covariance

    V = (B - 1) / B sum d_b d_b'.

Where more than noise remains, the covariance is C + V, but in no direction wider than the prior:
steps without a band are linear, and would move what the data hardly determine by any number of
decades. What the data determine in combination, such as a sum of stiffnesses, stays as certain as
the bands agree on it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from identification.words import Campaign, Integers, Mask, Real
from mbmodel import Model
from tuning.assessment.findings import CorrelationRow, UnseenRow
from tuning.assessment.gap import is_gap_visible
from tuning.fitting.fitter import Fit
from tuning.fitting.stage_search import LAST_STAGE
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import ArrowMatrix
from tuning.parametrisation.parametrisation import Parametrisation

NORMAL_QUANTILE_95 = 1.959964  # two-sided 95 % quantile of the normal distribution
FREE_PRIOR_SD = float(np.log(100.0))  # of a logarithm without a prior, for intervals alone
# Posterior over prior deviation: above it the data halve the prior's variance at best.
MAX_DETERMINED_SHARE = 0.7
_N_BANDS = 16  # of lines: wider than a resonance, and enough for a deviation to 20 %
_MIN_CORRELATION = 0.9  # of two parameters, to be reported
_MIN_DIRECTION_SHARE = 0.25  # of a direction's largest entry, for a parameter to be named
_MIN_SUM_COSINE = 0.98  # between a direction and that of a sum


@dataclass(frozen=True, eq=False)
class ParameterConfidence:
    """Confidence in the parameters of a fit.

    Args:
        parametrisation: coordinates of the fit.
        x: coordinates at its end; (n_x,).
        normal: N at x.
        chi_square: sum |r|^2 / var / n of the data.
        band_shifts: d_b, where lines share the errors of a model; (n_band, n_x); None where noise
            alone remains.
    """

    parametrisation: Parametrisation
    x: Real
    normal: ArrowMatrix
    chi_square: float
    band_shifts: Real | None = None

    @property
    def variance_inflation(self) -> float:
        """Factor s^2 by which the covariance of the data is inflated."""
        return max(1.0, self.chi_square)

    @cached_property
    def covariance(self) -> Real:
        """Covariance of the coordinates; (n_x, n_x)."""
        covariance = self._posterior_covariance(self.variance_inflation)
        if self.band_shifts is None:
            return covariance
        bands = len(self.band_shifts)
        shared = (bands - 1) / bands * self.band_shifts.T @ self.band_shifts
        return bound_covariance(covariance + shared, 1 / self.prior_precision)

    @cached_property
    def prior_precision(self) -> Real:
        """Diagonal of D; (n_x,)."""
        return posterior_precision(self.parametrisation, self.x)

    @cached_property
    def _undetermined_deviation(self) -> Real:
        """Posterior deviation from which the data do not determine a coordinate; (n_x,)."""
        deviation: Real = MAX_DETERMINED_SHARE / np.sqrt(self.prior_precision)
        return np.where(self.parametrisation.is_logarithmic, np.minimum(deviation, 1.0), deviation)

    def _posterior_covariance(self, variance_inflation: float) -> Real:
        """Return C for a given s^2; (n_x, n_x)."""
        information = self.normal.dense() / variance_inflation + np.diag(self.prior_precision)
        scale = 1 / np.sqrt(np.diag(information))
        covariance: Real = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(
            scale, scale
        )
        return (covariance + covariance.T) / 2

    @cached_property
    def deviation(self) -> Real:
        """Standard deviation of each coordinate; (n_x,)."""
        return np.sqrt(np.diag(self.covariance))

    def interval(self) -> tuple[Real, Real]:
        """Return both ends of each parameter's 95 % interval [SI]; (n_parameter,) each."""
        spread = NORMAL_QUANTILE_95 * self.deviation
        ends = (
            self.parametrisation.theta(self.x - spread),
            self.parametrisation.theta(self.x + spread),
        )
        return np.minimum(*ends), np.maximum(*ends)

    def parameter_deviation(self) -> Real:
        """Return the standard deviation of each parameter, relative for sizes; (n_parameter,)."""
        parametrisation = self.parametrisation
        of_parameters = (
            np.append(self.deviation, 0.0)[parametrisation.coordinate_of] * parametrisation.scale
        )
        return np.where(parametrisation.free, of_parameters, 0.0)

    @cached_property
    def is_undetermined(self) -> Mask:
        """Whether the data do not determine each stiffness or damping; (n_x,)."""
        is_vague = self.deviation > self._undetermined_deviation
        return ~self.parametrisation.is_tolerance & is_vague

    @cached_property
    def unidentifiable(self) -> Mask:
        """Whether the data do not determine each stiffness or damping; (n_parameter,)."""
        parametrisation = self.parametrisation
        return np.append(self.is_undetermined, False)[parametrisation.coordinate_of]

    def correlations(self) -> tuple[CorrelationRow, ...]:
        """Return pairs with a correlation above 0.9, strongest first."""
        correlation = self.covariance / np.outer(self.deviation, self.deviation)
        first, second = np.nonzero(np.triu(np.abs(correlation) > _MIN_CORRELATION, 1))
        names = self.parametrisation.names
        rows = [
            CorrelationRow(first=names[a], second=names[b], correlation=float(correlation[a, b]))
            for a, b in zip(first, second, strict=True)
        ]
        return tuple(sorted(rows, key=lambda row: -abs(row.correlation)))

    def unidentifiable_directions(self) -> tuple[UnseenRow, ...]:
        """Return directions that the data do not determine, the most uncertain first."""
        free = np.flatnonzero(~self.parametrisation.is_tolerance)
        return tuple(sorted(self._directions(free), key=lambda row: -row.deviation))

    def _directions(self, coordinates: Integers) -> Iterator[UnseenRow]:
        """Yield the unidentifiable directions among some coordinates.

        Directions that share coordinates span a space in which every basis is arbitrary: of two
        parameters it may be a product and a ratio, though neither parameter is determined. So a
        coordinate whose axis lies in that space is stated alone, and the others are sought again.
        """
        if not coordinates.size:
            return
        unit = self._undetermined_deviation[coordinates]
        values, vectors = np.linalg.eigh(
            self.covariance[np.ix_(coordinates, coordinates)] / np.outer(unit, unit)
        )
        order = np.argsort(-values, kind="stable")[: int((values > 1).sum())]
        values, vectors = values[order], vectors[:, order]
        is_member = np.abs(vectors) > _MIN_DIRECTION_SHARE * np.abs(vectors).max(axis=0)
        for together in _join_overlapping(is_member):
            members = np.flatnonzero(is_member[:, together].any(axis=1))
            if len(together) == 1:
                yield self._row(coordinates[members], vectors[members, together[0]])
                continue
            inside = (vectors[members][:, together] ** 2).sum(axis=1)
            alone = members[inside > _MIN_SUM_COSINE**2]
            for k in coordinates[alone]:
                yield self._row(np.array([k]), np.ones(1))
            rest = np.setdiff1d(members, alone)
            if alone.size:
                yield from self._directions(coordinates[rest])
            else:  # several combinations of at least three parameters
                yield self._row(coordinates[rest], inside)

    def _row(self, coordinates: Integers, vector: Real) -> UnseenRow:
        """Return the row of one direction, its largest entry first."""
        parametrisation = self.parametrisation
        vector = self._undetermined_deviation[coordinates] * vector
        vector = vector / np.linalg.norm(vector)
        variance = float(vector @ self.covariance[np.ix_(coordinates, coordinates)] @ vector)
        order = np.argsort(-np.abs(vector), kind="stable")
        names = tuple(parametrisation.names[k] for k in coordinates[order])
        theta = parametrisation.theta(self.x)
        first = [int(np.flatnonzero(parametrisation.coordinate_of == k)[0]) for k in coordinates]
        sentence = _describe_direction(names, vector[order], theta[first][order])
        return UnseenRow(
            parameters=list(names), deviation=float(np.sqrt(variance)), sentence=sentence
        )


def posterior_precision(varies: Parametrisation, x: Real) -> Real:
    """Return the precision of each coordinate's prior, with a wide one for those without; (n_x,).

    Args:
        x: their values; (n_x,).
    """
    units = np.where(varies.is_logarithmic, 1.0, np.maximum(np.abs(x), 1.0))
    return np.where(varies.precision > 0, varies.precision, (FREE_PRIOR_SD * units) ** -2)


def bound_covariance(covariance: Real, limits: Real) -> Real:
    """Return a covariance that is in no direction wider than a prior; (n, n).

    With D = diag(1 / v), the eigenvalues of D^1/2 S D^1/2 are limited to 1.

    Args:
        covariance: S; (n, n).
        limits: v, variance of the prior of each coordinate; (n,).
    """
    unit = np.sqrt(np.outer(limits, limits))
    values, vectors = np.linalg.eigh(covariance / unit)
    result: Real = (vectors * np.clip(values, 0.0, 1.0)) @ vectors.T * unit
    return (result + result.T) / 2


def estimate_confidence(
    model: Model, campaign: Campaign, fit: Fit, jobs: int = 1, *, has_model_error: bool = False
) -> ParameterConfidence:
    """Linearise at the end of a fit, on all lines and at the last stage's weights.

    Args:
        jobs: threads; the result does not depend on it.
        has_model_error: whether more than noise remains, though the weights tolerate it.
    """
    stage = fit.last_stage or LAST_STAGE
    problem = stage.build_misfit(model, campaign, fit.parametrisation, threads=jobs)
    value, slope, normal = problem.quadratic_model(fit.x)
    chi_square = (value - problem.prior(fit.x)) / max(problem.values, 1)
    confidence = ParameterConfidence(fit.parametrisation, fit.x, normal, chi_square)
    lines = len(campaign.freq_hz)
    if lines <= _N_BANDS or not (has_model_error or is_gap_visible(chi_square - 1)):
        return confidence
    edges = np.linspace(0, lines, _N_BANDS + 1).astype(int).tolist()
    bands = [campaign.select_lines(slice(*span)) for span in pairwise(edges)]
    misfits = (stage.build_misfit(model, band, fit.parametrisation, threads=jobs) for band in bands)
    return replace(confidence, band_shifts=_list_band_shifts(confidence, slope, misfits))


def _list_band_shifts(
    confidence: ParameterConfidence, slope: Real, misfits: Iterable[Misfit]
) -> Real:
    """Return the shifts d_b without the lines of each band; (n_band, n_x).

    Args:
        confidence: confidence in the fit to all lines.
        slope: dJ/dx of all lines, with the prior; (n_x,).
        misfits: misfit of each band; one at a time is in memory.
    """
    of_prior = confidence.parametrisation.precision * confidence.x
    precision, mean = np.diag(confidence.prior_precision), (slope - of_prior) / _N_BANDS
    shifts = []
    for misfit in misfits:
        _, band_slope, band_normal = misfit.quadratic_model(confidence.x)
        remaining = (confidence.normal - band_normal).dense() + precision
        shifts.append(np.linalg.solve(remaining, band_slope - of_prior - mean))
    return np.array(shifts)


def _join_overlapping(is_member: Mask) -> list[list[int]]:
    """Return groups of directions that share a coordinate, also by way of a third direction.

    Args:
        is_member: whether a coordinate takes part in a direction; (n_coordinate, n_direction).
    """
    groups: list[tuple[Mask, list[int]]] = []
    for direction, members in enumerate(is_member.T):
        touching = [group for group in groups if (group[0] & members).any()]
        joined = [direction, *(k for _, numbers in touching for k in numbers)]
        union = np.logical_or.reduce([members, *(mask for mask, _ in touching)])
        groups = [group for group in groups if not (group[0] & members).any()]
        groups.append((union, sorted(joined)))
    return [numbers for _, numbers in groups]


def rank_pulls(parametrisation: Parametrisation, x: Real) -> list[tuple[str, float]]:
    """Return each tolerance with its pull [standard deviations], largest first."""
    order = np.argsort(-np.abs(np.where(parametrisation.is_tolerance, x, 0.0)), kind="stable")
    return [
        (parametrisation.names[k], float(x[k])) for k in order if parametrisation.is_tolerance[k]
    ]


def _describe_direction(names: tuple[str, ...], vector: Real, sizes: Real) -> str:
    """Describe an unidentifiable direction of logarithms in a sentence; a size of zero has none."""
    if len(names) == 1:
        return f"{names[0]} is not determined by the data"
    if len(names) > 2 or not sizes.all():
        return f"{', '.join(names[:-1])} and {names[-1]} are determined in combination only"
    opening = f"{names[0]} and {names[1]} are determined only as"
    for power, quantity in ((-1, "a sum"), (1, "a sum of compliances")):
        of_sum = np.array([1.0, -1.0]) * sizes**power
        cosine = abs(float(of_sum @ vector)) / np.linalg.norm(of_sum) / np.linalg.norm(vector)
        if cosine > _MIN_SUM_COSINE:
            return f"{opening} {quantity}"
    return f"{opening} a product" if vector[0] * vector[1] < 0 else f"{opening} a ratio"
