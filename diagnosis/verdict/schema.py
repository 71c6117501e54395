"""The verdict as a file: what the contract calls for, keys and all."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from diagnosis.hypothesis import Ends, Value
from tuning.files.schema import ChannelGainRow

Word = Literal["none", "explained", "several", "unexplained"]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Probability(_Row):
    """Of what is no single cause."""

    none: float
    unexplained: float
    several: float


class GapAt(_Row):
    """Error and excess; null where a number does not exist."""

    error: float | None
    excess: float | None


class Interval(_Row):
    """Of what the gap becomes."""

    closed: tuple[float, float] | None = None
    after: tuple[float, float] | None = None


class GapSteps(_Row):
    """As drawn on all lines; re-tuned and with the cause added on held-out ones."""

    as_drawn: GapAt
    retuned: GapAt
    after: GapAt
    noise: float | None
    closed: float | None
    interval: Interval


class Where(_Row):
    """A place, and the probability that the cause sits there, normalised over places."""

    location: str
    share: float | None


class CauseRow(_Row):
    """An effect at a place."""

    effect: str
    location: str
    dof: str | None
    probability: float
    parameters: dict[str, Value]
    interval: dict[str, Ends]
    excess_after: float | None


class Verdict(_Row):
    """verdict.json."""

    verdict: Word
    probability: Probability
    gap: GapSteps
    where: list[Where]
    causes: list[CauseRow]
    twins: list[tuple[str, str]]
    not_testable: list[str]
    next_experiment: str | None
    channel_gains: list[ChannelGainRow] = []
