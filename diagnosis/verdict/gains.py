"""Gains that the campaign declares unknown, as the verdict states them."""

from diagnosis.algorithm import Diagnosis
from tuning import estimate_confidence
from tuning.files.parameter_rows import channel_gain_rows
from tuning.files.schema import ChannelGainRow


def list_channel_gains(diagnosis: Diagnosis) -> list[ChannelGainRow]:
    """Return the gains of the fit with the causes, or of the null model without causes."""
    nominal = diagnosis.session.campaign.unknown_gains.nominal
    if not nominal:
        return []
    if diagnosis.parameters is not None:
        theta, confidence = diagnosis.parameters.theta, diagnosis.parameters.confidence
    else:
        refit = diagnosis.null
        theta = refit.fit.theta
        confidence = estimate_confidence(refit.session.model, refit.session.campaign, refit.fit)
    return channel_gain_rows(nominal, confidence.parametrisation, theta, confidence.interval())
