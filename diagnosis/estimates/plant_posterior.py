"""Posterior of the machine that a fit of the diagnosis describes, for predictions of the plant.

Parameters of springs, bodies and joints are those of its MJCF. Those of effects change the machine
as ``tuning.assessment.effect_slopes`` measures. What an MJCF does not hold, such as a gain or a law
over frequency, is integrated out.
"""

from collections.abc import Sequence

import numpy as np

from diagnosis.estimates.intervals import FittedParameters
from identification.words import Complex
from mbmodel import AddedPart, machine_model, read_as_written
from tuning import Fit, Session, estimate_model_error, thin_lines
from tuning.assessment.effect_slopes import STEP_SHARE, find_effect_slopes
from tuning.assessment.parameter_posterior import ParameterPosterior
from tuning.assessment.plant_confidence import estimate_plant_confidence
from tuning.files.posterior_file import machine_posterior


def estimate_plant_posterior(
    session: Session, fitted: FittedParameters, fit: Fit, predicted: Sequence[Complex]
) -> ParameterPosterior:
    """Return the posterior of a machine, with its discrepancy and its error at the sensors.

    Args:
        session: campaign and model of the fit.
        fitted: parameters with their confidence.
        predicted: FRFs on held-out lines, else of the fit; (n_freq, n_out, 1) each.

    Raises:
        InputError: the MJCF of the machine cannot be read any more.
    """
    model, campaign = session.model, session.campaign
    thin = thin_lines(campaign, fitted.stride)
    plant = estimate_plant_confidence(model, thin, fit, fitted.confidence)
    theta = model.without_small_sizes(fitted.theta)
    written = read_as_written(model, theta)
    effects = find_effect_slopes(model, theta, _list_steps(session, fitted), written)
    error = estimate_model_error(predicted, campaign)
    return machine_posterior(
        model,
        fitted.parametrisation,
        fitted.confidence.x,
        plant.covariance,
        None if error is None or error.is_at_force_error else error.floor,
        plant.discrepancy,
        held={parameter.name: parameter.drawn for parameter in machine_model(written).parameters},
        effects=effects,
    )


def _list_steps(session: Session, fitted: FittedParameters) -> dict[str, float]:
    """Return a step of each parameter of an added Part that varies, within its bounds."""
    varies, x = fitted.parametrisation, fitted.confidence.x
    added = np.repeat(
        [isinstance(part, AddedPart) for part in session.model.parts],
        [len(part.parameters) for part in session.model.parts],
    )
    half = STEP_SHARE * fitted.confidence.deviation
    ahead = varies.upper - x >= x - varies.lower
    moved = varies.theta(np.clip(x + np.where(ahead, half, -half), varies.lower, varies.upper))
    steps = moved - varies.theta(x)
    return {
        session.model.parameters[k].name: float(steps[k])
        for k in np.flatnonzero(added & varies.free & (steps != 0))
    }
