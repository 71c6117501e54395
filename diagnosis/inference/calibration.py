"""The judgement's constants, and where they come from."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict


class Calibration(BaseModel):
    """The judgement's constants.

    Args:
        hidden: e that may be no gap, by what it is known by: neighbouring lines; or the noise's
            own variance, badly known, which third differences tell worse than coherences do.
        hidden_width: of its logarithm.
        outlier: standard deviations that the largest of all tolerances may have.
        told: nats that one of all hypotheses may gain where nothing is missing, likewise.
        told_width: of their logarithm.
        exact: e that badly known noise may leave of a gap, likewise.
        left: part of the gap, to that power, that is as likely explained as not, likewise.
        left_width: of its logarithm.
        least: nats that decide nothing.
        inexact: nats a value that decide nothing.
        temper: part of the whole gain that decides nothing.
        rival: nats of cost that decide nothing between rivals.
        foretold: nats likewise of what they foretell.
        share: part of the best place's gain that decides nothing.
        sure: probability of what leaves no doubt.
        campaigns: how many it was made from.
        by_lines: how many of them tell the gap by neighbouring lines.
        command: that makes it.
        seeds: of the campaigns.
        commits: that diagnosed them.
        evidence: SHA-256 of what they gave.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    hidden: Mapping[str, float]
    hidden_width: float
    outlier: float
    told: Mapping[str, float]
    told_width: float
    exact: Mapping[str, float]
    left: Mapping[str, float]
    left_width: float
    least: float
    inexact: float
    temper: float
    rival: float
    foretold: float
    share: float
    sure: float
    campaigns: int = 0
    by_lines: int = 0
    command: str = ""
    seeds: str = ""
    commits: str = ""
    evidence: str = ""


@cache
def calibrated() -> Calibration:
    """The committed calibration."""
    text = (files("diagnosis.inference") / "calibration.json").read_text("utf-8")
    return Calibration.model_validate(json.loads(text))
