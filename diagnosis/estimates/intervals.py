"""Parameters of a refit with their intervals, as the verdict states them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Hypothesis
from diagnosis.refits.refit import Refit, map_values
from diagnosis.settings import NEGLIGIBLE_SHARE, SETTINGS, DiagnosisSettings
from diagnosis.stated_values import (
    Ends,
    Value,
    drop_undetermined,
    find_scaled,
    flatten_values,
    pair_ends,
)
from identification.words import Real
from tuning import (
    NORMAL_QUANTILE_95,
    STAGES,
    Fit,
    ParameterConfidence,
    Parametrisation,
    Session,
    Stage,
    estimate_confidence,
    fit,
    is_gap_visible,
    thin_lines,
)


@dataclass(frozen=True, eq=False)
class FittedParameters:
    """Parameters of a refit with their confidence.

    Args:
        parametrisation: coordinates of the refit.
        theta: fitted parameters [SI]; (n_parameter,).
        confidence: confidence of the parameters.
        converged: whether the fit converged.
        settings: number of points of an interval.
        fit: the fit itself; None where parameters alone are known.
        stride: every ``stride``-th line counts for the confidence.
        scale_deviation: relative standard deviation of the calibration beside that.
    """

    parametrisation: Parametrisation
    theta: Real
    confidence: ParameterConfidence
    converged: bool = True
    settings: DiagnosisSettings = SETTINGS
    fit: Fit | None = None
    stride: int = 1
    scale_deviation: float = 0.0

    def state_parameters(self, hypothesis: Hypothesis) -> dict[str, Value]:
        """Return the parameters of a hypothesis as the verdict states them."""
        return hypothesis.state(map_values(self.parametrisation, self.theta))

    def estimate_intervals(self, hypothesis: Hypothesis) -> dict[str, Ends]:
        """Return the 95 % intervals of the fitted parameters of a hypothesis.

        With C the covariance of the coordinates x, the interval of a stated number y goes from its
        least to its largest value on the ellipsoid d' C^-1 d = q^2 about x. With g the slope of y,
        they are at d = +- q C g / sqrt(g' C g). For a linear y this is y +- q sqrt(g' C g), for
        the exponential of a coordinate it is the exponentials of the ends of the coordinate. Random
        points of the ellipsoid are added for a y that bends, such as the largest of several sizes.

        Each d is projected by P on the directions that change a stated number. Others may be
        unidentifiable: an equal loss of four supports is a softer joint. Coordinates that shape an
        effect, such as logarithms of frequencies and time constants, stay within their bounds. The
        ends of a damping that the data do not determine would be 1e-38 and 1e40 N s/m.

        If the interval of a number includes zero, numbers without it have none: the place of a mass
        is a quotient, with bounds only if its divisor is not zero (Fieller 1954).

        Args:
            hypothesis: cause whose parameters are stated.
        """
        fitted = _ReadRecord(map_values(self.parametrisation, self.theta))
        middle = hypothesis.state(fitted)
        names = self.parametrisation.names
        stating = [k for k, name in enumerate(names) if name in fitted.read_names]
        if not stating or not middle:
            return {}
        deviation = self.confidence.deviation[stating]
        correlation = self.confidence.covariance[np.ix_(stating, stating)] / np.outer(
            deviation, deviation
        )
        shapes = [k for k in stating if names[k] not in (hypothesis.scored or names)]
        ends = self.parametrisation.lower[shapes], self.parametrisation.upper[shapes]

        def state_at(units: Real) -> Real:
            x = self.confidence.x.copy()
            x[stating] += deviation * units
            x[shapes] = np.clip(x[shapes], *ends)
            values = middle | hypothesis.state(
                map_values(self.parametrisation, self.parametrisation.theta(x))
            )
            return flatten_values({name: values[name] for name in middle})

        slopes = _find_slopes(state_at, self._find_interior(stating))
        kept = _project_on_rows(slopes)
        root = _find_root(kept @ correlation @ kept)
        directions = np.vstack(
            [slopes @ root, _draw_directions(self.settings.interval_points, len(stating))]
        )
        directions = directions[directions.any(axis=1)]
        lengths = np.linalg.norm(directions, axis=1)[:, None]
        farthest = NORMAL_QUANTILE_95 * directions / lengths @ root
        points = [
            flatten_values(middle),
            *(state_at(sign * point) for point in farthest for sign in (-1, 1)),
        ]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        scale = NORMAL_QUANTILE_95 * self.scale_deviation * find_scaled(hypothesis.effect, middle)
        low, high = (
            points[0] + sign * np.hypot(ends - points[0], scale)
            for sign, ends in ((-1, low), (1, high))
        )
        return drop_undetermined(middle, pair_ends(middle, low, high))

    def _find_interior(self, stating: list[int]) -> Real:
        """Return a point inside the bounds at which no two coordinates are equal, in deviations."""
        x = self.confidence.x[stating]
        above = self.parametrisation.upper[stating] - x < x - self.parametrisation.lower[stating]
        away = 2 * _difference_step() * np.arange(1, len(stating) + 1)
        return np.where(above, -away, away)


def _find_slopes(state_at: Callable[[Real], Real], units: Real) -> Real:
    """Return central differences of stated numbers by coordinates; (n_number, n_coordinate)."""
    size = _difference_step()
    steps = size * np.eye(len(units))
    return np.array(
        [(state_at(units + step) - state_at(units - step)) / (2 * size) for step in steps]
    ).T


def _difference_step() -> float:
    """Return the step of central differences with the least error of a function of order one."""
    return float(np.cbrt(np.finfo(float).eps))


def _project_on_rows(slopes: Real) -> Real:
    """Return P, the projection on the coordinate directions that change a stated number."""
    sizes = np.linalg.norm(slopes, axis=1)
    _, values, directions = np.linalg.svd(slopes[sizes > 0] / sizes[sizes > 0, None])
    effective = directions[: len(values)][values > NEGLIGIBLE_SHARE]
    return effective.T @ effective


def _find_root(matrix: Real) -> Real:
    """Return the symmetric root of a positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T


def _draw_directions(points: int, count: int) -> Real:
    """Return random directions by a fixed seed; (points, count)."""
    return np.random.default_rng(0).standard_normal((points, count))


class _ReadRecord(dict[str, float]):
    """Parameters by name, with a record of those that were read."""

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__(values)
        self.read_names: set[str] = set()

    def __getitem__(self, name: str) -> float:
        """Return a value."""
        self.read_names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: float = 0.0) -> float:  # type: ignore[override]
        """Return a value, or the default."""
        self.read_names.add(name)
        return super().get(name, default)


def fit_parameters(
    refit: Refit,
    stride_factor: int = 1,
    settings: DiagnosisSettings = SETTINGS,
    *,
    is_final: bool = True,
) -> FittedParameters:
    """Return the parameters of a refit with their confidence.

    If little but noise remains, the final fit counts all lines, in as many steps as it needs.
    Outlying tolerances were admitted before (``refits.refitting``): those held at their bounds
    would shift the parameters. If more than noise remains, the covariance is that of the number of
    independent values, or of bands of lines.

    Args:
        stride_factor: factor on the stride of the lines.
        settings: stride of the schedule.
        is_final: whether the final fit is made; else the parameters are those of the refit.
    """
    session, fitted = refit.session, refit.fit
    model, campaign, parametrisation = session.model, session.campaign, fitted.parametrisation
    stride, is_visible = stride_factor, is_gap_visible(refit.gap)
    if is_final and not is_visible:
        stage = replace(STAGES[-1], model_error_floor=refit.floor, stride=stride_factor)
        whole = replace(session, parametrisation=parametrisation)
        fitted = fit_final_stage(whole, refit.fit.theta, stage)
        confidence = estimate_confidence(model, thin_lines(campaign, stride), fitted)
    else:
        stride = settings.schedule.stride // 2 * stride_factor
        thin = thin_lines(campaign, stride)
        confidence = estimate_confidence(model, thin, fitted, has_model_error=is_visible)
        shared = refit.summary.values / refit.summary.effective_values
        confidence = replace(confidence, chi_square=max(confidence.chi_square, shared))
    return FittedParameters(
        fitted.parametrisation,
        fitted.theta,
        confidence,
        fitted.converged,
        settings,
        fitted,
        stride,
        0.0 if model.machine.rest is None else model.machine.rest.scale_deviation,
    )


def fit_final_stage(session: Session, start: Real, stage: Stage) -> Fit:
    """Return the fit of a session by one stage, in as many steps as it needs.

    Args:
        start: start values [SI]; (n_parameter,).

    Raises:
        KeyboardInterrupt: the fit was interrupted.
    """
    fitted = fit(
        session.model,
        session.campaign,
        parametrisation=session.parametrisation,
        starts=(start,),
        stages=(stage,),
    )
    if fitted.outcome == "interrupted":
        raise KeyboardInterrupt
    return fitted
