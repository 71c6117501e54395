"""A campaign and its model, opened together for tuning and diagnosis."""

from identification import select_band as select_campaign_band
from identification.words import Campaign, UsageError
from mbworkbench.campaign import MeasuredCampaign
from mbworkbench.labels import AnyPath, as_path, check_band
from mbworkbench.model import MachineModel
from tuning import Session, open_session


def select_band(campaign: MeasuredCampaign, band: tuple[float, float] | None) -> Campaign:
    """Return the tests of a campaign on the lines of a band.

    Args:
        campaign: all lines.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.

    Raises:
        InputError: the band holds no line.
        UsageError: the lower frequency does not come first.
    """
    content = campaign.content
    return select_campaign_band(content, check_band(band), campaign.source)


def open_together(
    campaign: MeasuredCampaign | AnyPath,
    model: MachineModel | None,
    band: tuple[float, float] | None,
) -> Session:
    """Open a campaign with the model that it names, or with another one.

    Args:
        campaign: from ``read_campaign``, or the path of its folder; its files are read anew.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.

    Raises:
        InputError: campaign or model cannot be used, or the band holds no line.
        UsageError: campaign and model are exchanged, or the lower frequency of the band does not
            come first.
    """
    if isinstance(campaign, MachineModel) or isinstance(model, MeasuredCampaign):
        raise UsageError(
            "campaign and model are exchanged: call tune(model, campaign) or "
            "diagnose(campaign, model)"
        )
    if not isinstance(model, MachineModel | None):
        raise UsageError(f"{model!r} is no model: give what read_model returned, or None")
    source = campaign.source if isinstance(campaign, MeasuredCampaign) else as_path(campaign)
    return open_session(source, check_band(band), None if model is None else model.machine)
