"""The minimisations that a fit goes through, with falling allowance."""

from dataclasses import dataclass

from identification.words import Campaign, Mask
from mbmodel import Model
from tuning.freedom import Freedom
from tuning.misfit import Misfit

_FEWEST_LINES = 32


@dataclass(frozen=True)
class Stage:
    """One minimisation of the misfit of FRFs.

    Args:
        allowance: relative error that the model may have anyway.
        tolerance: it ends when a step promises less than this part of the cost.
        stride: only every so manyth line counts.
        logarithmic: whether the residual is the logarithm of the ratio.
        everything: whether tolerances vary too, or only what has no prior.
        at_bodies: whether differences count at the centres of mass instead of the channels.
        max_steps: of Gauss-Newton, at which it stops wherever it is.
    """

    allowance: float
    tolerance: float = 1e-3
    stride: int = 1
    logarithmic: bool = True
    everything: bool = False
    at_bodies: bool = False
    max_steps: int = 60

    def misfit(
        self,
        model: Model,
        campaign: Campaign,
        varies: Freedom,
        *,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> Misfit:
        """The misfit of this stage."""
        return Misfit(
            model,
            campaign,
            varies,
            allowance=self.allowance,
            logarithmic=self.logarithmic,
            at_bodies=self.at_bodies,
            counted=counted,
            threads=threads,
        )


STAGES = (
    Stage(0.5, stride=8),
    Stage(0.2, stride=8),
    Stage(0.1, stride=4, everything=True),
    Stage(0.03, stride=4, logarithmic=False, everything=True),
    Stage(0.0, stride=4, logarithmic=False, everything=True),
    Stage(0.0, tolerance=1e-8, logarithmic=False, everything=True),
)
LAST = STAGES[-1]


def thinned(campaign: Campaign, stride: int) -> Campaign:
    """Every stride-th line, but no fewer than 32 of them as long as there are so many."""
    return campaign.lines(counted_lines(len(campaign.freq_hz), stride))


def counted_lines(n_freq: int, stride: int) -> slice:
    """Which lines ``thinned`` keeps."""
    stride = min(stride, max(1, n_freq // _FEWEST_LINES))
    return slice(stride // 2, None, stride)
