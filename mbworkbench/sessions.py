"""A campaign and its model, opened together for tuning and diagnosis."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from identification import select_band as select_campaign_band
from identification.words import Campaign, UsageError
from mbworkbench.campaign import MeasuredCampaign
from mbworkbench.labels import AnyPath, as_path, check_band
from mbworkbench.model import MachineModel
from tuning import Checkpoint, Session, open_session

_P = ParamSpec("_P")
_R = TypeVar("_R")


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

    The tests of a campaign that was read are used as they are. With another model its files are
    read anew, since their labels refer to the bodies and points of that model.

    Args:
        campaign: from ``read_campaign``, or the path of its folder.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.

    Raises:
        InputError: campaign or model cannot be used, or the band holds no line.
        UsageError: campaign and model are exchanged, or the lower frequency of the band does not
            come first.
    """
    if isinstance(campaign, MachineModel) or isinstance(model, MeasuredCampaign):
        raise UsageError(
            "the campaign comes first and the model by its name: call tune(campaign, model=model) "
            "or diagnose(campaign, model=model)"
        )
    if not isinstance(model, MachineModel | None):
        raise UsageError(f"{model!r} is no model: give what read_model returned, or None")
    machine = None if model is None else model.machine
    if not isinstance(campaign, MeasuredCampaign):
        return open_session(as_path(campaign), check_band(band), machine)
    tests = campaign.content if model is None else None
    return open_session(campaign.source, check_band(band), machine, tests)


def takes_a_campaign(call: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that refuses more than a campaign by position, and prints the new call."""

    @wraps(call)
    def check_positions(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        if len(args) > 1:
            name = getattr(call, "__name__", "")
            raise UsageError(f"a model is given by its name: mb.{name}(campaign, model=model)")
        return call(*args, **kwargs)

    return check_positions


def open_checkpoint(file: AnyPath | None, key: Callable[[], str]) -> Checkpoint | None:
    """Return the finished steps of a file, which is made where it does not exist; None for none.

    Args:
        file: path, or None.
        key: returns the fingerprint of inputs and options.

    Raises:
        InputError: the file was altered, or is that of other inputs.
    """
    return None if file is None else Checkpoint(as_path(file), key(), resume=True)
