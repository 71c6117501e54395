r"""Interval of the rms errors, from the covariance of the fit, by one adjoint solve an error.

A mean square J = sum_f E S E^H changes with the FRFs by dJ = 2 Re sum L dH R S E^H, with L and R of
``loop_algebra``: its cotangent is conj(L' (R S E^H)'). The adjoint method turns it into the
derivatives of J by all parameters. To first order log rms = log(J) / 2 has the variance g' P g, g
its gradient and P the covariance.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Real
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95, ParameterConfidence
from tuning.error_budget.budget import ErrorBudget


@dataclass(frozen=True, eq=False)
class RmsInterval:
    """Interval of each error.

    Args:
        deviation: standard deviation of the logarithm of the rms; (n_error,).
        low: lower end of the 95 % interval [m or rad]; (n_error,).
        high: upper end; (n_error,).
    """

    deviation: Real
    low: Real
    high: Real


def log_rms_gradient(budget: ErrorBudget) -> Real:
    """Return the derivative of log rms by every parameter in SI; (n_error, n_parameter)."""
    response, lines, ports = budget.response, budget.linearised, budget.ports
    correlated = budget.scaled @ budget.definition.coherence  # E a times the coherence
    rows = []
    for error, mean_square in enumerate(budget.rms**2):
        drive = np.einsum(
            "fis,fs,fs->fi",
            response.right,
            budget.weights,
            correlated[:, error].conj(),
            optimize=True,
        )
        cotangent = (response.left[:, error, :, None] * drive[:, None, :]).conj()
        gradient = lines.gradient(np.asarray(cotangent))
        rows.append(gradient / mean_square if mean_square else 0 * gradient)
    del ports
    return np.array(rows)


def rms_interval(budget: ErrorBudget, confidence: ParameterConfidence) -> RmsInterval:
    """Return the interval of each error.

    Args:
        budget: at the parameters of ``confidence``.
        confidence: covariance of the fit's coordinates.
    """
    parametrisation = confidence.parametrisation
    by_parameter = log_rms_gradient(budget) * parametrisation.rates(confidence.x)
    by_coordinate = np.zeros((len(by_parameter), parametrisation.size))
    free = parametrisation.free
    for row, values in zip(by_coordinate, by_parameter, strict=True):
        np.add.at(row, parametrisation.coordinate_of[free], values[free])
    variance = np.einsum("zi,ij,zj->z", by_coordinate, confidence.covariance, by_coordinate)
    deviation = np.sqrt(np.maximum(variance, 0.0))
    spread = np.exp(NORMAL_QUANTILE_95 * deviation)
    return RmsInterval(deviation, budget.rms / spread, budget.rms * spread)
