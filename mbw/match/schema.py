"""What ``mbw match`` writes: match.json."""

from typing import Annotated

from pydantic import BaseModel, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]


class HandRow(BaseModel):
    """A channel's damping and amplitude by hand, as tables 2 and 3 of the gondola's paper.

    Args:
        channel: such as ``acc1:+tx``.
        impact: its file.
        lower, peak, upper: the peak, and where it has fallen by 3 dB [Hz].
        damping: ratio, by that width.
        least_squares, maximum: amplitude C by the lines of the width and by the peak [m/s2 s].
    """

    channel: str
    impact: str
    lower: Finite
    peak: Finite
    upper: Finite
    damping: Finite
    least_squares: Finite
    maximum: Finite


class MatchRow(BaseModel):
    """A measured mode and the simulated one that it is.

    Args:
        frequency, frequency_sd: natural [Hz].
        damping, damping_sd: ratio.
        simulated: number of the simulated mode in its file, from 1; null for no match.
        simulated_frequency: its frequency [Hz].
        probability: that it is that one; of no match where that is likelier.
        mac: of signed shapes at the channels.
        telling: channels that tell it from the next candidate.
        shape: real, at ``channels``, of unit size.
        by_hand: of the channels that move most.
    """

    frequency: Finite
    frequency_sd: Finite
    damping: Finite
    damping_sd: Finite
    simulated: int | None
    simulated_frequency: Finite | None
    probability: Finite
    mac: Finite | None
    telling: list[str]
    shape: list[Finite]
    by_hand: list[HandRow]


class MatchFile(BaseModel):
    """What was found.

    Args:
        shapes, campaign: what was read.
        band: of the lines [Hz].
        lines: independent ones in the band.
        mass: of the simulated structure by its rigid modes [kg]; null if they do not tell.
        channels: such as ``acc1:+tx``.
        impacts: files of the records.
        modes: measured, by rising frequency.
        unmatched: numbers of simulated modes in the band that no measured mode is.
        alike: pairs of simulated modes with a MAC above 0.8 at these channels.
        alike_told_by: for each of them the channels where they differ most.
        unseen: numbers of simulated modes in the band that do not move at these channels.
        reference: place to which ratios of amplitudes are taken.
    """

    shapes: str
    campaign: str
    band: list[Finite]
    lines: int
    mass: Finite | None
    channels: list[str]
    impacts: list[str]
    modes: list[MatchRow]
    unmatched: list[int]
    alike: list[list[int]]
    alike_told_by: list[list[str]]
    unseen: list[int]
    reference: str
