"""tuned.json: its rows, checked on writing and on reading."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

from identification.words import Quantity

Residual = Literal["modal", "log"]
Place = Literal["sensors", "bodies"]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class GapRow(_Row):
    """Error and excess of one prediction."""

    error: float | None
    excess: float | None


class LevelGap(_Row):
    """The gap at the sensors or at the bodies.

    ``tuned`` is of the fit to all lines, on the lines that it saw; ``held_out`` predicts each line
    by a fit that did not see it: the figure to quote.
    """

    as_drawn: GapRow
    tuned: GapRow
    held_out: GapRow | None
    noise: float | None
    channels: int
    quiet_channels: int


class GapTable(_Row):
    """The gap at both levels."""

    sensors: LevelGap
    bodies: LevelGap


class ParameterRow(_Row):
    """One parameter that was tuned.

    ``low`` and ``high`` are its 95 % interval, ``deviation`` one standard deviation (of sizes
    relative); None if the tuning was interrupted. ``prior`` is the standard deviation that the
    drawing states, None where it states none; ``pull`` by how many of them it was pulled in the fit
    without bounds. ``at_bound`` is of the fit within bounds. ``seen`` is false where the data tell
    nothing.
    """

    name: str
    location: str
    unit: str
    drawn: float
    tuned: float
    at_bound: bool
    low: float | None = None
    high: float | None = None
    deviation: float | None = None
    prior: float | None = None
    pull: float | None = None
    seen: bool = True


class CorrelationRow(_Row):
    """Two parameters that the data tell apart badly."""

    first: str
    second: str
    correlation: float


class UnseenRow(_Row):
    """A direction that the data cannot see."""

    parameters: list[str]
    deviation: float
    sentence: str


class GainRow(_Row):
    """What one further measurement would do for the parameter that is known worst.

    ``what`` is a hammer point at a site, or a sensor beside it; ``before`` and ``after`` are the
    parameter's standard deviation (of sizes relative), ``shrink`` the median over all stiffnesses
    and dampings of after / before.
    """

    what: str
    place: str
    parameter: str
    before: float
    after: float
    shrink: float


class StartRow(_Row):
    """Where one start ended, after the last stage that all went through.

    ``farthest`` names the parameters that lie farthest from the best start's, with the factor.
    """

    cost: float | None
    agrees: bool
    farthest: dict[str, float]


class InputRow(_Row):
    """A file that was read, and its SHA-256."""

    file: str
    sha256: str


class FitRow(_Row):
    """How the search went, and whether its result is to be trusted: two questions.

    ``chi_square`` is the mean squared misfit in units of the noise.
    """

    outcome: str
    converged: bool
    trusted: bool = False
    doubts: list[str] = []
    advice: str
    algorithm: str = ""
    evaluations: int
    cost: float | None
    chi_square: float | None = None
    starts: int
    agreeing_starts: int
    ends: list[StartRow] = []


class TestRow(_Row):
    """One test."""

    __test__ = False

    file: str
    reference: str
    level: float | None
    averages: int | None
    variance_from: str
    channels: int


class ModeRow(_Row):
    """One mode of the model in the band."""

    frequency: float
    damping: float


class PartnerRow(_Row):
    """The model's mode that belongs to a measured one.

    ``mode`` is its place in ``modes`` of the file, counted from 1; None outside the band. Errors
    are relative to what was measured.
    """

    mode: int | None
    frequency: float
    damping: float
    mac: float
    frequency_error: float
    damping_error: float | None


class PairRow(_Row):
    """One measured mode, and its partners; None where the model has none."""

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    as_drawn: PartnerRow | None
    tuned: PartnerRow | None


class BlockRow(_Row):
    """One held-out block of lines, and its part of the squared held-out error."""

    low: float
    high: float
    share: float


class ShareRow(_Row):
    """One body's part of the gap that remains."""

    body: str
    share: float
    excess: float


class TunedFile(_Row):
    """tuned.json.

    ``residuals`` are those that were minimised, in order, FRFs ``at`` sensors or bodies; ``pairs``
    holds every measured mode and ``unpaired_modes`` the tuned model's modes in the band that belong
    to none, where modes were measured.
    """

    campaign: str
    model: str
    quantity: Quantity
    band: tuple[float, float]
    lines: int
    interrupted: bool
    held_out_outcomes: list[str]
    held_out_blocks: list[BlockRow]
    tests: list[TestRow]
    fit: FitRow
    gap: GapTable
    parameters: list[ParameterRow]
    correlations: list[CorrelationRow] = []
    unseen: list[UnseenRow] = []
    information: list[GainRow] = []
    inputs: list[InputRow] = []
    modes: dict[str, list[ModeRow]]
    residuals: list[Residual] = ["log"]
    at: Place = "sensors"
    pairs: list[PairRow] = []
    unpaired_modes: list[ModeRow] = []
    remaining_gap: list[ShareRow]
    not_held_by_mjcf: list[str]
