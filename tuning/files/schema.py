"""Schema of tuned.json: its rows, validated on writing and on reading."""

from identification.readers.result_files import ResultFile, StrictRow
from identification.words import Quantity
from tuning.assessment.findings import CorrelationRow, GainRow, UnseenRow
from tuning.campaign_tuning import FrfPlace, ResidualKind


class GapRow(StrictRow):
    """Error and excess of one prediction."""

    error: float | None
    excess: float | None


class LevelGap(StrictRow):
    """Gap at the sensors or at the bodies.

    ``tuned`` is the gap of the fit to all lines, on those lines. ``held_out`` predicts each line
    by a fit that left it out: the figure to quote.
    """

    as_drawn: GapRow
    tuned: GapRow
    held_out: GapRow | None
    noise: float | None
    channels: int
    quiet_channels: int


class GapTable(StrictRow):
    """Gaps at both levels."""

    sensors: LevelGap
    bodies: LevelGap


class ParameterRow(StrictRow):
    """One parameter that was tuned.

    ``low`` and ``high`` are the ends of its 95 % interval, ``deviation`` is one standard deviation
    (relative for sizes); they are None if the tuning was interrupted. ``prior`` is the standard
    deviation of its tolerance, None without one. ``pull`` is its shift in units of ``prior`` in
    the fit without bounds. ``at_bound`` refers to the fit within bounds. ``seen`` is false for a
    parameter that the data do not determine. Of a table of modes, ``ratio`` is the posterior over
    the prior standard deviation: 1 where the table tells nothing.
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
    ratio: float | None = None


class ChannelGainRow(StrictRow):
    """Gain that a campaign called unknown: measured value per SI unit, H_measured = gain H.

    ``location`` is ``sensor:<site>`` or ``hammer:<name>``, ``dof`` the direction of a channel.
    ``interval`` is the 95 % interval, or None. With ``is_product``, the data show the product with
    the gain of the force channel only. ``delay`` is that of a drive or encoder [s], None for
    a sensor's axis: its estimate before the fit and the fitted deviation.
    """

    location: str
    dof: str | None
    gain: float
    interval: tuple[float, float] | None
    is_product: bool
    delay: float | None = None


class StartRow(StrictRow):
    """End of one start, after the last stage that all starts went through.

    ``farthest`` names the parameters that lie farthest from those of the best start, with the
    factor.
    """

    cost: float | None
    agrees: bool
    farthest: dict[str, float]


class InputRow(StrictRow):
    """A file that was read, and its SHA-256."""

    file: str
    sha256: str


class FitRow(StrictRow):
    """How the search ended, and whether there are doubts about its result: two questions.

    ``chi_square`` is the mean squared misfit in units of the noise's variance, or of the standard
    deviations of a table of modes.
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


class TunedTestRow(StrictRow):
    """One test of the campaign; ``variant`` names its own model or pose, if it has one.

    ``drive_unit`` is the unit of what drove the machine, and of the level.
    """

    __test__ = False

    file: str
    reference: str
    level: float | None
    averages: int | None
    variance_from: str
    channels: int
    variant: str = ""
    drive_unit: str = "N"


class ModelModeRow(StrictRow):
    """One mode of the model in the band."""

    frequency: float
    damping: float


class ModePartnerRow(StrictRow):
    """Mode of the model that is paired with a measured one.

    ``mode`` is its position in ``modes`` of the file, counted from 1, or None outside the band; of
    a table of modes, its number among the modes that oscillate. Errors are relative to the measured
    values. ``mac`` compares measured shapes. Of a table, ``largest`` is the direction of a body
    with the largest kinetic energy; ``moves_most`` says whether the motion that the row names is
    the largest of its kind, None if the row names none.
    """

    mode: int | None
    frequency: float
    damping: float
    mac: float | None = None
    frequency_error: float
    damping_error: float | None
    largest: str | None = None
    moves_most: bool | None = None


class ModePairRow(StrictRow):
    """One measured mode and its partners; None if the model has none.

    In a table of modes, ``line`` is its line in the file, ``motion`` what it names as its largest
    motion, and standard deviations are those of the fit, stated or default.
    """

    line: int | None = None
    frequency: float
    frequency_sd: float
    damping: float | None
    damping_sd: float | None
    motion: str | None = None
    as_drawn: ModePartnerRow | None
    tuned: ModePartnerRow | None


class BlockRow(StrictRow):
    """One held-out block of lines, and its share of the squared held-out error."""

    low: float
    high: float
    share: float


class ShareRow(StrictRow):
    """Share of one body in the residual gap."""

    body: str
    share: float
    excess: float


class TunedFile(ResultFile, StrictRow):
    """Content of tuned.json.

    ``residuals`` are the residuals that were minimised, in order, with FRFs ``at`` sensors or
    bodies. ``model_error`` is the relative error of the tuned model at the sensors' points that the
    residuals show beside the noise. If modes were measured, ``pairs`` holds each of them and
    ``unpaired_modes`` the tuned model's modes in the band without a partner.
    """

    campaign: str
    model: str
    quantity: Quantity
    band: tuple[float, float]
    lines: int
    interrupted: bool
    held_out_outcomes: list[str]
    held_out_blocks: list[BlockRow]
    tests: list[TunedTestRow]
    fit: FitRow
    gap: GapTable
    model_error: float | None = None
    parameters: list[ParameterRow]
    correlations: list[CorrelationRow] = []
    unseen: list[UnseenRow] = []
    information: list[GainRow] = []
    channel_gains: list[ChannelGainRow] = []
    inputs: list[InputRow] = []
    modes: dict[str, list[ModelModeRow]]
    residuals: list[ResidualKind] = ["log"]
    at: FrfPlace = "sensors"
    pairs: list[ModePairRow] = []
    unpaired_modes: list[ModelModeRow] = []
    remaining_gap: list[ShareRow]
    not_held_by_mjcf: list[str]
    not_held_error: float | None = None
    mjcf_difference: str = ""

    def __repr__(self) -> str:
        """Return campaign, model, number of parameters and outcome in one line."""
        return (
            f"tuned.json of {self.campaign}: model {self.model}, {len(self.parameters)} "
            f"parameters, {self.fit.outcome}"
        )


class ModeTableFile(ResultFile, StrictRow):
    """Content of mode_table.json, the result of a tuning to a table of modes.

    ``determined`` names the parameters whose ``ratio`` is below 0.5. ``modes_without_row`` are
    modes of the tuned model between the lowest and the highest row that no row names.
    """

    table: str
    model: str
    fit: FitRow
    modes: list[ModePairRow]
    modes_without_row: list[ModelModeRow]
    parameters: list[ParameterRow]
    determined: list[str]
    remarks: list[str]
    not_held_by_mjcf: list[str]
    mjcf_difference: str = ""
    inputs: list[InputRow]

    def __repr__(self) -> str:
        """Return table, model, number of rows and outcome in one line."""
        return (
            f"mode_table.json of {self.table}: model {self.model}, {len(self.modes)} modes, "
            f"{self.fit.outcome}"
        )
