"""Where ``mbw tune`` takes measured modes from: the campaign itself, or what was identified."""

from pathlib import Path

import numpy as np

from identification.words import Campaign, Dof, InputError, ModalModel, UsageError
from mbw.identify.files import read_result
from tuning import Residual, modes_in_band, some_modes

RESIDUALS: dict[str, tuple[Residual, ...]] = {
    "log": ("log",),
    "modal": ("modal",),
    "modal,log": ("modal", "log"),
}


def parse_residuals(text: str) -> tuple[Residual, ...]:
    """Read ``log``, ``modal`` or ``modal,log``.

    Raises:
        UsageError: anything else.
    """
    found = RESIDUALS.get(text.replace(" ", ""))
    if found is None:
        raise UsageError(
            f"--residual {text} is none of {', '.join(RESIDUALS)}: modal starts from frequencies, "
            "damping and shapes, log fits the FRFs"
        )
    return found


def measured_modes(
    campaign: Campaign, residuals: tuple[Residual, ...], folder: Path | None
) -> ModalModel | None:
    """Modes inside the campaign's band; None if nobody asked for them.

    Args:
        campaign: the lines of the band.
        residuals: what is to be minimised.
        folder: that ``mbw identify`` wrote, or its modes.json; None to identify anew.

    Raises:
        InputError: the folder holds no modes of this band and machine.
        UsageError: no mode in the band where modes are to be fitted.
    """
    if folder is not None:
        measured = _read(folder, campaign)
    elif "modal" in residuals:
        measured = modes_in_band(campaign)
    else:
        return None
    if not len(measured.poles) and "modal" in residuals:
        raise UsageError(
            f"{campaign.name}: no mode was found in the band: widen --band, or tune with "
            "--residual log"
        )
    return measured


def _read(folder: Path, campaign: Campaign) -> ModalModel:
    result = read_result(folder)
    arrays = result.arrays
    try:
        model = ModalModel(
            **{name: arrays[name] for name in _ARRAYS},
            outputs=tuple(Dof.parse(label) for label in result.summary.outputs),
            inputs=tuple(Dof.parse(label) for label in result.summary.inputs),
        )
        seen = np.asarray(arrays["is_measured"].any(axis=1), np.bool_)
        inside = np.asarray(arrays["inside_band"], np.bool_)
    except (KeyError, ValueError) as error:
        raise InputError(f"{folder} holds no modes ({error}): run mbw identify again") from error
    known = {dof.point for dof in campaign.layout.body_dofs()} | set(campaign.layout.points)
    unknown = sorted({dof.point for dof in model.outputs} - known)
    if unknown:
        raise InputError(
            f"{folder} holds modes of another machine: {campaign.name} has no {unknown[0]}; name "
            "the folder that mbw identify wrote for this campaign"
        )
    lowest, highest = campaign.freq_hz[[0, -1]]
    inside &= (model.freq_hz >= lowest) & (model.freq_hz <= highest)
    return some_modes(model, inside, seen)


_ARRAYS = ("poles", "shapes", "participation", "lower", "upper", "freq_sd", "damping_sd")
