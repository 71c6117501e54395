"""Modal model that ``mbw identify`` wrote, restricted to the band of a campaign."""

from pathlib import Path

import numpy as np

from identification.result.stored_result import read_result
from identification.words import Campaign, Dof, InputError, ModalModel
from tuning import select_modes

_MODAL_ARRAYS = ("poles", "shapes", "participation", "lower", "upper", "freq_sd", "damping_sd")


def read_measured_modes(folder: Path, campaign: Campaign) -> ModalModel:
    """Return the modes that ``mbw identify`` found, inside the band of a campaign.

    Args:
        folder: folder that the verb wrote, or its modes.json.

    Raises:
        InputError: the folder holds no modes of this machine.
    """
    result = read_result(folder)
    arrays = result.arrays
    try:
        model = ModalModel(
            **{name: arrays[name] for name in _MODAL_ARRAYS},
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
