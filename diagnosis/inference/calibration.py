"""Constants of the posterior, calibrated on virtual machines, and their origin."""

import json
import math
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict


class Calibration(BaseModel):
    """Constants of the posterior.

    Args:
        hidden: mean square of a gap, over that of the noise, that badly known noise may hide. The
            key is the source of the gap: neighbouring lines, or the variance from coherences or
            from third differences.
        hidden_width: width of the logarithm of ``hidden``.
        error_values: effective sample size of the model error: its number of independent values.
        max_noise_share: largest share of the noise in a variance: no model is exact, and the
            parameters of any cause fit some noise.
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
    max_noise_share: float
    force_scale: float
    campaigns: int = 0
    command: str = ""
    seeds: str = ""
    evidence: str = ""

    def count_independent(self, noise_share: float, values: int) -> float:
        """Return the number of independent values in a residual of noise and model error.

        The noise of each value is independent; the error of a model is shared by lines, channels
        and hits. With the share s of the noise in the variance, 1 - s is the correlation within
        clusters of values / error_values, and the count is values over the design effect (Kish
        1965, ch. 5.4), about

            1 / [s / values + (1 - s) / error_values].

        Args:
            noise_share: share of the noise in the variance.
            values: number of values.
        """
        share = min(noise_share, self.max_noise_share)
        return 1 / (share / values + (1 - share) / self.error_values)

    def price_parameter(self, noise_share: float, values: int) -> float:
        """Return what a fitted parameter gains by chance, per independent value [nats].

        A prior as wide as a single value allows (unit information, Kass and Wasserman 1995) leaves
        of the likelihood of k parameters, fitted to N independent values, the evidence

            ln L - (k / 2) ln N   (Schwarz 1978),

        so that one costs ln N / (2 N) per value.

        Args:
            noise_share: share of the noise in the variance.
            values: number of values.
        """
        count = self.count_independent(noise_share, values)
        return math.log(max(count, 1.0)) / (2 * count)


@cache
def load_calibration() -> Calibration:
    """Return the committed calibration."""
    text = (files("diagnosis.inference") / "calibration.json").read_text("utf-8")
    return Calibration.model_validate(json.loads(text))
