r"""Interval of the rms errors, from the covariance of the fit, by one adjoint solve an error.

A mean square J = sum_f E S E^H changes with the FRFs by dJ = 2 Re sum L dH R S E^H, with L and R of
``loop_algebra``: its cotangent is conj(L' (R S E^H)'). The adjoint method turns it into the
derivatives of J by all parameters. To first order log rms = log(J) / 2 has the variance g' P g, g
its gradient and P the covariance.

The discrepancy of the model is a relative error e of its forces (``model_discrepancy``), with an
error dE of unknown phase at each line. If that had one sign over all lines that matter, log rms
would have the deviation e / sqrt(2) sum_f S |E| sd(dE) / J, which is added to the other.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Real
from tuning.assessment.model_discrepancy import discrepancy_motion
from tuning.assessment.parameter_confidence import NORMAL_QUANTILE_95
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.control_loops.stability import growing_pole
from tuning.plant.error_budget.budget import ErrorBudget, error_budget
from tuning.plant.error_budget.closed_loop_states import loop_states, refuse_unstable


@dataclass(frozen=True, eq=False)
class RmsInterval:
    """Interval of each error.

    Args:
        rms: of the fitted model [m or rad]; (n_error,).
        by_parameters: standard deviation of the logarithm of the rms by the parameters;
            (n_error,).
        by_model_error: by the discrepancy of the model; (n_error,).
    """

    rms: Real
    by_parameters: Real
    by_model_error: Real

    @property
    def deviation(self) -> Real:
        """Standard deviation of the logarithm of the rms; (n_error,)."""
        return np.hypot(self.by_parameters, self.by_model_error)

    def ends(self) -> tuple[Real, Real]:
        """Return both ends of the 95 % interval [m or rad]; (n_error,) each."""
        spread = np.exp(NORMAL_QUANTILE_95 * self.deviation)
        return self.rms / spread, self.rms * spread


def log_rms_gradient(budget: ErrorBudget) -> Real:
    """Return the derivative of log rms by every parameter in SI; (n_error, n_parameter)."""
    response = budget.response
    correlated = (budget.scaled @ budget.definition.coherence).conj()
    rows = []
    for error, mean_square in enumerate(budget.rms**2):
        drive = (response.right @ (budget.weights * correlated[:, error])[:, :, None])[:, :, 0]
        cotangent = (response.left[:, error, :, None] * drive[:, None, :]).conj()
        gradient = budget.linearised.gradient(cotangent)
        rows.append(gradient / mean_square if mean_square else 0 * gradient)
    return np.array(rows)


def rms_interval(budget: ErrorBudget, posterior: PosteriorOfModel) -> RmsInterval:
    """Return the interval of each error.

    Args:
        budget: of the posterior's model at its nominal values.
        posterior: of the parameters.
    """
    by_parameter = (log_rms_gradient(budget) * posterior.rates)[:, posterior.varies]
    by_coordinate = by_parameter @ posterior.membership
    covariance = posterior.posterior.covariance
    variance = np.einsum("zi,ij,zj->z", by_coordinate, covariance, by_coordinate)
    return RmsInterval(
        budget.rms,
        np.sqrt(np.maximum(variance, 0.0)),
        posterior.posterior.discrepancy * _discrepancy_slope(budget),
    )


def _discrepancy_slope(budget: ErrorBudget) -> Real:
    """Return the deviation of log rms per unit of e; (n_error,)."""
    response = budget.response
    deviation = discrepancy_motion(budget.linearised, response.left, response.right)
    shift = np.einsum("fes,fes,fs->e", np.abs(budget.scaled), deviation, budget.weights)
    mean_square = np.where(budget.rms > 0, budget.rms, 1.0) ** 2
    slope: Real = np.asarray(shift / mean_square / np.sqrt(2))
    return slope


def sample_rms(budget: ErrorBudget, thetas: Real) -> Real:
    """Return the rms errors of machines drawn from the posterior; (n_sample, n_error).

    Args:
        budget: of the fitted machine.
        thetas: parameters of each machine [SI]; (n_sample, n_theta).

    Raises:
        InputError: a machine is unstable with the loops.
    """
    model = budget.linearised.model
    return np.array([error_budget(model, theta, budget.definition).rms for theta in thetas])


def stable_poles_of_samples(budget: ErrorBudget, thetas: Real) -> list[Complex]:
    """Return the closed-loop poles of machines of the posterior [rad/s]; (n_pole,) each.

    Args:
        budget: of the fitted machine.
        thetas: parameters of each machine [SI]; (n_sample, n_theta).

    Raises:
        InputError: a machine is unstable with the loops; the worst pole is named.
    """
    definition, model = budget.definition, budget.linearised.model
    poles = [loop_states(model, theta, definition, budget.ports).poles() for theta in thetas]
    growing = [each for each in poles if growing_pole(each) is not None]
    if growing:
        worst = max(growing, key=lambda each: float(each.real.max()))
        refuse_unstable(worst, definition.loops, samples=(len(growing), len(poles)))
    return poles
