"""Constants of the posterior, calibrated on virtual machines, and their origin."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict

from identification.words import Campaign, VarianceSource


class Calibration(BaseModel):
    """Constants of the posterior.

    Args:
        hidden: mean square of a gap, over that of the noise, that badly known noise may hide. The
            key is the source of the gap: neighbouring lines, or the variance from coherences or
            from third differences.
        hidden_width: width of the logarithm of ``hidden``.
        error_values: effective sample size of the model error: its number of independent values.
        noise_exponent: how nearly a residual must be noise alone before its values count as
            independent.
        max_noise_share: largest share of the noise in a variance: no model is exact, and the
            parameters of any cause fit some noise. A residual holds at most error_values /
            (1 - max_noise_share^noise_exponent) independent values.
        tolerance_weight: weight of the cost of tolerances in the log probability. It is far below
            1, since tolerances absorb a part of the model's error too, which any cause relieves.
        force_scale: temperature of the softmax over places, as a share of the largest gain.
        campaigns: number of campaigns of the calibration.
        command: command that makes the calibration.
        seeds: seeds of the campaigns.
        evidence: SHA-256 of their evidence.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    hidden: Mapping[str, float]
    hidden_width: float
    error_values: float
    noise_exponent: float
    max_noise_share: float
    tolerance_weight: float
    force_scale: float
    campaigns: int = 0
    command: str = ""
    seeds: str = ""
    evidence: str = ""

    def count_independent(self, noise_share: float, values: int) -> float:
        """Return the number of independent values in a residual of noise and model error.

        The noise of each value is independent; the error of a model is shared by lines, channels
        and hits. With a correlation c within clusters of values / error_values, the count is values
        over the design effect (Kish 1965, ch. 5.4), about

            1 / [(1 - c) / values + c / error_values],   c = 1 - s^q.

        With q = 1, c is the share of the error in the variance. But a wrong cause gains what it
        absorbs of the error, with or without noise beside it; noise decides only where hardly any
        error is in the residual. q is therefore larger, and calibrated.

        Args:
            noise_share: share s of the noise in the variance.
        """
        noise = float(min(noise_share, self.max_noise_share) ** self.noise_exponent)
        return 1 / (noise / values + (1 - noise) / self.error_values)


def find_variance_source(campaign: Campaign) -> VarianceSource:
    """Return where the noise's variance comes from; the worse source if there are two.

    A variance that the files state counts as one from coherences.
    """
    sources = {test.estimate.variance_source for test in campaign.tests}
    return "differences" if "differences" in sources else "coherence"


@cache
def load_calibration() -> Calibration:
    """Return the committed calibration."""
    text = (files("diagnosis.inference") / "calibration.json").read_text("utf-8")
    return Calibration.model_validate(json.loads(text))
