"""Measured modes for ``mbw tune``: identified anew, or read from the result of mbw identify."""

from pathlib import Path

from identification.words import Campaign, ModalModel, UsageError
from mbw.results.measured_modes import read_measured_modes
from tuning import ResidualKind, modes_in_band

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
        residuals: residuals of the fit, in order.
        folder: folder that ``mbw identify`` wrote, or its modes.json; None to identify anew.

    Raises:
        InputError: the folder holds no modes of this band and machine.
        UsageError: modes shall be fitted, but the band holds none.
    """
    if folder is not None:
        measured = read_measured_modes(folder, campaign)
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
