"""How far a fit is from what was measured, on lines that it did not see."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from diagnosis.estimates.intervals import Known, known
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.refits.parallel import Call, side_by_side
from diagnosis.refits.refitting import (
    ALL,
    FIRST,
    ONWARD,
    SHAPED,
    SOME,
    Refit,
    held_out,
    paced,
    refit,
)
from identification.words import Campaign, Complex, Mask, Real
from tuning import (
    ChannelGaps,
    Gap,
    HeldOutFits,
    Session,
    Stage,
    block_width,
    channel_gaps,
    predict,
    summarise_gaps,
)


@dataclass(frozen=True, eq=False)
class HeldOutGap:
    """A fit, and how far it is from what was measured.

    Args:
        refit: of all folds.
        held_out: with folds left out; None if the band is too narrow.
        predicted: each line by a fit that did not see it, or by the fit if there are no folds.
        campaign: what it is compared with.
        stride: every so manyth line was fitted to.
    """

    refit: Refit
    held_out: HeldOutFits | None
    predicted: tuple[Complex, ...]
    campaign: Campaign
    stride: int

    @cached_property
    def channels(self) -> ChannelGaps:
        """The gap of each channel."""
        return channel_gaps(self.predicted, self.campaign)

    @cached_property
    def gap(self) -> Gap:
        """On held-out lines, or on all if there are none."""
        return summarise_gaps(self.channels)

    @property
    def width(self) -> int | None:
        """Lines in a block; None without held-out lines."""
        return None if self.held_out is None else self.held_out.width

    @property
    def theta(self) -> Real:
        """The mean of the fits without a fold, for each saw most of the lines; (n_parameter,)."""
        held = self.held_out
        found: Real = self.refit.fit.theta if held is None else held.thetas.mean(axis=0)
        return found

    @property
    def unfinished(self) -> int:
        """How many of the fits without a fold did not go to their end."""
        held = self.held_out
        return 0 if held is None else sum(one != "converged" for one in held.outcomes)

    def on(self, lines: Mask) -> Gap:
        """The gap on some lines; (n_freq,)."""
        return summarise_gaps(
            channel_gaps(
                [values[lines] for values in self.predicted], self.campaign.select_lines(lines)
            )
        )


def levels(
    base: Scene,
    one: Hypothesis | None,
    whole: Session,
    before: Mapping[Hypothesis | None, Refit],
    *,
    exact: bool,
) -> tuple[HeldOutGap, HeldOutGap | None, Known | None]:
    """Levels without any effect and with what is there, and the parameters of that, side by side.

    Args:
        base: from where refits start that are not known.
        one: all that is there at once; None for nothing, or what no Part holds.
        whole: all that was measured.
        before: refits that are known.
        exact: whether the level without any effect is asked for to the third digit.
    """
    first = before.get(None) or begun(base, None, whole)
    freq_hz = whole.campaign.freq_hz
    width = block_width(first.session.model, first.fit.theta, freq_hz)
    coarse, fine = (_stage(base, exact=exactly) for exactly in (exact, True))
    if one is None:
        return _level(first, coarse, held_out(first, coarse, base.jobs, width)), None, None
    made = before.get(one) or begun(base, one, whole)
    # Hypotheses stay here.
    calls: list[Call] = [
        (held_out, (replace(made, hypothesis=None), fine, 1, width)),
        # Sizes by all that was measured: of a second hammer point too.
        (known, (replace(made, hypothesis=None), made.fit.theta, ALL.stride)),
        (held_out, (replace(first, hypothesis=None), coarse, 1, width)),
    ]
    after, worth, retuned = side_by_side(calls, base.jobs)
    return _level(first, coarse, retuned), _level(made, fine, after), worth


def begun(base: Scene, one: Hypothesis | None, whole: Session) -> Refit:
    """A refit to all that was measured."""
    stages = (*FIRST, *ONWARD) if one is None or one.reform is None else SHAPED
    return refit(base, one, whole.campaign, stages)


def level(base: Scene, made: Refit, width: int | None) -> HeldOutGap:
    """The level of a refit.

    Args:
        base: how many lines count, and how many processes.
        made: the refit.
        width: lines in a block; by the modes of its model if None.
    """
    stage = _stage(base, exact=True)
    return _level(made, stage, held_out(made, stage, base.jobs, width))


def _stage(base: Scene, *, exact: bool) -> Stage:
    (stage,) = paced((ALL if exact else SOME,), base.pace)
    return stage


def _level(made: Refit, stage: Stage, held: HeldOutFits | None) -> HeldOutGap:
    session = made.session
    predicted = (
        predict(session.model, made.fit.theta, session.campaign)
        if held is None
        else held.predict(session.model, session.campaign)
    )
    return HeldOutGap(made, held, predicted, session.campaign, stage.stride)
