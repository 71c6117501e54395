"""Tolerances of single instruments, from ``[sensor.<name>]`` and ``[hammer.<name>]``."""

from glob import escape

from identification.readers.campaign_toml import CampaignSettings, port_key


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
