"""Content of ``match.json``, which ``mbw match`` writes."""

from identification.matching import HandEstimate
from identification.readers.result_files import ResultFile, ResultRow


class CircleRow(ResultRow):
    """Circle of one mode at one channel in the Nyquist plane, as in fig. 7 of the gondola's paper.

    Args:
        channel: label of the channel, such as ``acc1:+tx``.
        impact: file of the impact.
        frequency, damping: natural frequency [Hz] and damping ratio by the angle along the circle;
            null without a circle.
        amplitude: amplitude C by the diameter, signed [m/s]; null without a circle.
        scatter: rms distance of the lines from the circle, relative to its radius.
        reason: why there is no circle; empty if there is one.
    """

    channel: str
    impact: str
    frequency: float | None
    damping: float | None
    amplitude: float | None
    scatter: float | None
    reason: str


class MatchRow(ResultRow):
    """Measured mode and the simulated mode that matches it.

    Args:
        frequency, frequency_sd: natural frequency and its standard deviation [Hz].
        damping, damping_sd: damping ratio and its standard deviation.
        simulated: number of the simulated mode in its file, from 1; null for no match.
        simulated_frequency: frequency of the simulated mode [Hz].
        probability: posterior probability of this match; without a match, that of no match.
        mac: MAC of the signed shapes at the channels.
        telling: channels that distinguish this match from the next candidate.
        shape: real shape at ``channels``, of unit norm.
        by_hand: estimates by hand at the channels that move most.
        circles: circle of every channel, in the impact that excites the mode most.
    """

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    simulated: int | None
    simulated_frequency: float | None
    probability: float
    mac: float | None
    telling: list[str]
    shape: list[float]
    by_hand: list[HandEstimate]
    circles: list[CircleRow]


class MassRow(ResultRow):
    """Mass of the simulated structure beside the mass that the user states.

    Args:
        stated, tolerance: mass of the structure and its tolerance [kg].
        agrees: whether the simulated mass lies within the tolerance; null if it is unknown.
        remark: the comparison in one sentence.
    """

    stated: float
    tolerance: float
    agrees: bool | None
    remark: str


class MatchFile(ResultFile):
    """Content of ``match.json``.

    Args:
        shapes, campaign: paths of the simulated shapes and of the campaign.
        band: lowest and highest frequency [Hz].
        lines: number of independent frequency lines in the band.
        mass: mass of the simulated structure by its rigid modes [kg]; null if they are not
            normalised by mass.
        mass_check: comparison with the mass that the user states; null without one.
        channels: labels of the channels, such as ``acc1:+tx``.
        impacts: files of the records.
        modes: measured modes, by rising frequency.
        unmatched: numbers of simulated modes in the band without a measured mode.
        alike: pairs of simulated modes with a MAC above 0.8 at these channels.
        alike_told_by: for each of these pairs the channels where they differ most.
        unseen: numbers of simulated modes in the band that do not move at these channels.
        reference: place in the denominator of the ratios of amplitudes.
    """

    shapes: str
    campaign: str
    band: list[float]
    lines: int
    mass: float | None
    mass_check: MassRow | None = None
    channels: list[str]
    impacts: list[str]
    modes: list[MatchRow]
    unmatched: list[int]
    alike: list[list[int]]
    alike_told_by: list[list[str]]
    unseen: list[int]
    reference: str
