"""Constants of the posterior, calibrated on virtual machines, and where they come from."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict


class Calibration(BaseModel):
    """Constants of the posterior.

    Args:
        hidden: mean square over that of the noise that may be no gap, by what the gap is known by:
            neighbouring lines, or the variance from coherences or third differences.
        hidden_width: width of its logarithm.
        tempering: kappa, part of the independent values that counts.
        chance: nats per value that a wrong cause gains on the model error of a real machine.
        force_scale: part of the best place's gain that decides nothing between places.
        campaigns: number of campaigns that it was made from.
        command: command that makes it.
        seeds: seeds of the campaigns.
        evidence: SHA-256 of their evidence.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    hidden: Mapping[str, float]
    hidden_width: float
    tempering: float
    chance: float
    force_scale: float
    campaigns: int = 0
    command: str = ""
    seeds: str = ""
    evidence: str = ""


@cache
def load_calibration() -> Calibration:
    """Return the committed calibration."""
    text = (files("diagnosis.inference") / "calibration.json").read_text("utf-8")
    return Calibration.model_validate(json.loads(text))
