"""Tolerances of single instruments, from ``[sensor.<name>]`` and ``[hammer.<name>]``."""

from glob import escape

from identification.readers.campaign_toml import CampaignSettings, port_key
from identification.words import TOLERANCE_BOUND_SIGMA, Campaign


def instrument_priors(settings: CampaignSettings) -> dict[str, float]:
    """Return the standard deviation of each gain and delay that campaign.toml states by itself.

    Args:
        settings: content of campaign.toml.

    Returns:
        Relative standard deviations of gains and those of delays [s], by patterns of parameters.
    """
    priors: dict[str, float] = {}
    for name, sensor in settings.sensor.items():
        place = escape(port_key(name))
        for kind, deviation in (("gain", sensor.gain_tolerance), ("delay", sensor.delay_tolerance)):
            if deviation is not None:
                priors[f"{place}.{kind}*"] = deviation
    for name, hammer in settings.hammer.items():
        place = escape(port_key(name))
        for kind, deviation in (("gain", hammer.gain_tolerance), ("delay", hammer.delay_tolerance)):
            if deviation is not None:
                priors[f"hammer({place}).{kind}"] = deviation
    return priors


def drive_delay_ranges(settings: CampaignSettings, campaign: Campaign) -> dict[str, float]:
    """Return the largest delay of each hammer or drive that its tolerance allows [s], by name.

    Args:
        settings: content of campaign.toml.
        campaign: its tests.
    """
    stated = {port_key(name): hammer.delay_tolerance for name, hammer in settings.hammer.items()}
    ranges = {}
    for instrument in {test.condition.instrument for test in campaign.tests}:
        deviation = stated.get(instrument)
        deviation = campaign.tolerance.hammer_delay if deviation is None else deviation
        ranges[instrument] = TOLERANCE_BOUND_SIGMA * deviation
    return ranges
