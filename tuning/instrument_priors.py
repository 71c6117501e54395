"""Tolerances of single instruments, from ``[sensor.<name>]`` and ``[hammer.<name>]``."""

from glob import escape

from identification.readers.campaign_toml import CampaignSettings, port_key
from identification.words import TOLERANCE_BOUND_SIGMA, Campaign


def instrument_priors(settings: CampaignSettings) -> dict[str, float]:
    """Return the standard deviation of each gain and delay that campaign.toml states by itself.

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


def delay_ranges(settings: CampaignSettings, campaign: Campaign) -> dict[str, float]:
    """Return the largest delay of each drive and channel that its tolerance allows [s].

    Returns:
        Delays by location, such as ``hammer:drive`` or ``sensor:encoder``.
    """
    tolerance, deviations = campaign.tolerance, dict[str, float]()
    for test in campaign.tests:
        deviations[f"hammer:{test.condition.instrument}"] = tolerance.hammer_delay
        for dof in test.estimate.frf.outputs:
            deviations[f"sensor:{dof.point}"] = tolerance.sensor_delay
    for kind, tables in (("sensor", settings.sensor), ("hammer", settings.hammer)):
        for name, table in tables.items():
            if table.delay_tolerance is not None:
                deviations[f"{kind}:{port_key(name)}"] = table.delay_tolerance
    return {place: TOLERANCE_BOUND_SIGMA * deviation for place, deviation in deviations.items()}
