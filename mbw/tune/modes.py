"""Measured modes for ``mbw tune``: identified anew, or read from the result of mbw identify."""

from pathlib import Path

import numpy as np

from identification.words import Campaign, Dof, InputError, ModalModel, UsageError
from mbw.results.identified_files import read_result
from tuning import ResidualKind, modes_in_band, select_modes

RESIDUALS: dict[str, tuple[ResidualKind, ...]] = {
    "log": ("log",),
    "modal": ("modal",),
    "modal,log": ("modal", "log"),
}


def parse_residuals(text: str) -> tuple[ResidualKind, ...]:
    """Return the residuals of a text ``log``, ``modal`` or ``modal,log``.

    Raises:
        UsageError: the text is none of these.
    """
    residuals = RESIDUALS.get(text.replace(" ", ""))
    if residuals is None:
        raise UsageError(
            f"--residual {text} is none of {', '.join(RESIDUALS)}: modal fits frequencies, "
            "damping and shapes of modes, log fits the FRFs"
        )
    return residuals


def measured_modes(
    campaign: Campaign, residuals: tuple[ResidualKind, ...], folder: Path | None
) -> ModalModel | None:
    """Return the measured modes inside the campaign's band; None if the fit needs none.

    Args:
        campaign: campaign on the frequency lines of the band.
        residuals: residuals of the fit, in order.
        folder: folder that ``mbw identify`` wrote, or its modes.json; None to identify anew.

    Raises:
        InputError: the folder holds no modes of this band and machine.
        UsageError: modes shall be fitted, but the band holds none.
    """
    if folder is not None:
        measured = _read(folder, campaign)
    elif "modal" in residuals:
        measured = modes_in_band(campaign)
    else:
        return None
    if not len(measured.poles) and "modal" in residuals:
        raise UsageError(
            f"{campaign.name}: no mode was identified in the band: widen --band, or tune with "
            "--residual log"
        )
    return measured


def _read(folder: Path, campaign: Campaign) -> ModalModel:
    result = read_result(folder)
    arrays = result.arrays
    try:
        model = ModalModel(
            **{name: arrays[name] for name in _ARRAYS},
            outputs=tuple(result.layout.parse(label) for label in result.summary.outputs),
            inputs=tuple(result.layout.parse(label) for label in result.summary.inputs),
        )
        is_measured = np.asarray(arrays["is_measured"].any(axis=1), np.bool_)
        inside = np.asarray(arrays["inside_band"], np.bool_)
    except (KeyError, ValueError) as error:
        raise InputError(f"{folder} holds no modes ({error}): run mbw identify again") from error
    points = {dof.point for dof in campaign.layout.body_dofs()} | set(campaign.layout.points)
    unknown = sorted({dof.point for dof in model.outputs if isinstance(dof, Dof)} - points)
    if unknown:
        raise InputError(
            f"{folder} holds modes of another machine: {campaign.name} has no {unknown[0]}; name "
            "the folder that mbw identify wrote for this campaign"
        )
    lowest, highest = campaign.freq_hz[[0, -1]]
    inside &= (model.freq_hz >= lowest) & (model.freq_hz <= highest)
    return select_modes(model, inside, is_measured)


_ARRAYS = ("poles", "shapes", "participation", "lower", "upper", "freq_sd", "damping_sd")
