"""The minimisations that a fit goes through, with falling allowance."""

from dataclasses import dataclass

from identification.words import Campaign, Integers, Mask, Real
from mbmodel import Model
from tuning.misfit.misfit import Misfit, Sparse
from tuning.misfit.normal_equations import Arrow
from tuning.parametrisation.parametrisation import Freedom

_FEWEST_LINES = 32
_NORMAL_LINES = 128  # that normal equations come from at least


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
        curved: whether steps that creep are made longer by the misfit's own curvature.
        sparse: normal equations are those of every so manyth of its lines, of 128 at least.
    """

    allowance: float
    tolerance: float = 1e-3
    stride: int = 1
    logarithmic: bool = True
    everything: bool = False
    at_bodies: bool = False
    max_steps: int = 60
    curved: bool = False
    sparse: int = 1

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

    def problem(
        self,
        model: Model,
        campaign: Campaign,
        varies: Freedom,
        *,
        counted: Mask | None = None,
        threads: int = 1,
    ) -> Misfit | Sparse:
        """The misfit of this stage, as it is minimised."""
        whole = self.misfit(model, campaign, varies, counted=counted, threads=threads)
        few, ratio = self._few(campaign)
        if ratio == 1:
            return whole
        kept = None if counted is None else counted[few]
        thin = self.misfit(model, campaign.lines(few), varies, counted=kept, threads=threads)
        return Sparse(whole, thin, ratio)

    def normals(
        self,
        model: Model,
        campaign: Campaign,
        varies: Freedom,
        x: Real,
        folds: Integers,
        threads: int = 1,
    ) -> list[Arrow]:
        """Normal equations of all lines but one fold, for each fold, as it is minimised.

        Args:
            model: machine and Parts.
            campaign: its lines are those that count.
            varies: coordinates of the parameters.
            x: where; (n_x,).
            folds: of each line, from 0; (n_freq,).
            threads: that form them.
        """
        few, ratio = self._few(campaign)
        problem = self.misfit(model, campaign.lines(few), varies, threads=threads)
        return [normal * ratio for _, _, normal in problem.normals(x, folds[few])[1:]]

    def _few(self, campaign: Campaign) -> tuple[slice, float]:
        """Lines that normal equations come from, and how many times as many there are."""
        n_freq = len(campaign.freq_hz)
        few = counted_lines(n_freq, min(self.sparse, max(1, n_freq // _NORMAL_LINES)))
        return few, n_freq / len(range(n_freq)[few])


STAGES = (
    Stage(0.5, stride=8),
    Stage(0.2, stride=8),
    Stage(0.1, stride=4, everything=True),
    Stage(0.03, stride=4, logarithmic=False, everything=True),
    Stage(0.0, stride=4, logarithmic=False, everything=True),
    Stage(0.0, tolerance=1e-8, logarithmic=False, everything=True, sparse=4),
)
LAST = STAGES[-1]


def thinned(campaign: Campaign, stride: int) -> Campaign:
    """Every stride-th line, but no fewer than 32 of them as long as there are so many."""
    return campaign.lines(counted_lines(len(campaign.freq_hz), stride))


def counted_lines(n_freq: int, stride: int) -> slice:
    """Which lines ``thinned`` keeps."""
    stride = min(stride, max(1, n_freq // _FEWEST_LINES))
    return slice(stride // 2, None, stride)
