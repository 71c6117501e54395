"""Meaning of a path: the model of a campaign or of a fit, and the tests of a campaign.

Check of the frequency band that a user states.
"""

from pathlib import Path

from identification import correct_layout, read_campaign, read_layout, read_settings, select_band
from identification.readers.campaign_toml import model_file
from identification.words import Campaign, InputError, UsageError
from mbmodel import Machine
from tuning import open_campaign
from tuning.files.plant_folder import plant_file
from tuning.files.result import TUNED_MJCF

_CAMPAIGN_TOML = "campaign.toml"  # of the folder of a campaign


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


def find_model(path: Path, key: str | None = None) -> tuple[Path, Path, str | None]:
    """Return the MJCF of a model, a fit or a campaign, and the file that states its loops.

    Args:
        path: an MJCF, a folder of ``mbw tune`` or ``mbw diagnose``, or a campaign.
        key: keyframe that the user states; None for that of a campaign.

    Returns:
        The MJCF, the campaign.toml or the MJCF beside which its loops stand, and the keyframe.

    Raises:
        InputError: a folder without one.
    """
    is_campaign = path.suffix == ".toml" or (path / _CAMPAIGN_TOML).is_file()
    if is_campaign:
        source, settings = read_settings(path)
        return model_file(source, settings), source, settings.key if key is None else key
    if not path.is_dir():
        return path, path, key
    mjcf = plant_file(path)
    if not mjcf.is_file():
        raise InputError(
            f"{path} holds no {TUNED_MJCF}: name an MJCF, a folder of mbw tune or mbw diagnose, or "
            "a campaign"
        )
    return mjcf, mjcf, key


def check_band(band: tuple[float, float] | None) -> None:
    """Refuse a band whose limits are exchanged or equal.

    Args:
        band: lowest and highest frequency [Hz]; None where the user states none.

    Raises:
        UsageError: the first limit is not below the second.
    """
    if band is not None and not band[0] < band[1]:  # true for NaN, too
        raise UsageError(f"--band {band[0]:g} {band[1]:g}: give the lower frequency first")
