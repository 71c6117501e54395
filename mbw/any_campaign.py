"""Opening of a campaign that names a model or a layout."""

from pathlib import Path

from identification import correct_layout, read_campaign, read_layout, read_settings, select_band
from identification.words import Campaign
from mbmodel import Machine
from tuning import open_campaign


def open_any_campaign(
    campaign: Path, band: tuple[float, float] | None
) -> tuple[Path, Machine | None, Campaign]:
    """Return campaign.toml, the machine, None if it names none, and the tests in the band."""
    source, settings = read_settings(campaign)
    if settings.layout is None:
        _, machine, band_campaign = open_campaign(campaign, band)
        return source, machine, band_campaign
    layout = correct_layout(source, settings, read_layout(source.parent / settings.layout))
    all_lines = read_campaign(source, settings, layout)
    return source, None, select_band(all_lines, band, source)
