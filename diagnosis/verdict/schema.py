"""Schema of verdict.json, as FORMATS defines it."""

from diagnosis.decision.established import RemarkRow, Word
from diagnosis.decision.remaining_gap import RestRow, Where
from diagnosis.estimates.gap_by_level import LevelGapRow
from diagnosis.inference.evidence import NamedRow
from diagnosis.stated_values import Ends, Value
from identification.readers.result_files import ResultFile, StrictRow
from tuning.files.schema import ChannelGainRow, GapRow


class Probability(StrictRow):
    """Probabilities of the empty set, without and with a rest, and of several causes."""

    none: float
    unexplained: float
    several: float


class Interval(StrictRow):
    """Intervals of the gap with the causes."""

    closed: tuple[float, float] | None = None
    after: tuple[float, float] | None = None


class GapSteps(StrictRow):
    """Gap of the nominal model on all lines, and of both fits on held-out lines.

    ``levels`` has the gap at each level. ``foretold`` is that at the middle level of fits to all
    other levels.
    """

    as_drawn: GapRow
    retuned: GapRow
    after: GapRow
    noise: float | None
    closed: float | None
    interval: Interval
    levels: list[LevelGapRow] = []
    foretold: LevelGapRow | None = None


class CauseRow(NamedRow):
    """Cause: an effect at a place.

    ``places`` lists all places that the test cannot tell apart, the likeliest first. ``laws`` lists
    the laws that the effect stands for, where the data do not tell them apart.
    """

    probability: float
    parameters: dict[str, Value]
    interval: dict[str, Ends]
    excess_after: float | None
    places: list[str] = []
    laws: list[str] = []


class Verdict(ResultFile, StrictRow):
    """Content of verdict.json."""

    verdict: Word
    probability: Probability
    gap: GapSteps
    where: list[Where]
    causes: list[CauseRow]
    rest: RestRow | None = None
    twins: list[tuple[str, str]]
    not_testable: list[str]
    next_experiment: str | None
    remarks: list[RemarkRow] = []
    channel_gains: list[ChannelGainRow] = []
