"""Content of excitation.json."""

from typing import Annotated

from pydantic import BaseModel, Field

from identification.readers.result_files import ResultFile

EXCITATION_JSON = "excitation.json"
Number = Annotated[float, Field(allow_inf_nan=False)]


class DriveRow(BaseModel):
    """A drive; ``force`` is that of one unit of its signal, in ``force_unit``."""

    drive: str
    unit: str
    force: Number
    force_unit: str
    rms: Number


class LimitRow(BaseModel):
    """A limit, and the largest value that is reached, both in ``unit``."""

    drive: str
    what: str
    reached: Number
    limit: Number
    unit: str


class CoherenceSummary(BaseModel):
    """Coherence that an output will have with a drive: median and lowest over the lines."""

    drive: str
    output: str
    median: Number
    lowest: Number


class ParameterForecast(BaseModel):
    """A stiffness or damping with its expected 95 % interval [SI]."""

    parameter: str
    nominal: Number
    unit: str
    interval: tuple[Number, Number]
    determined: bool


class SlidingSummary(BaseModel):
    """A joint with friction: part of the time in which it slides, or force over its limit."""

    joint: str
    limit: Number
    sliding: Number | None
    force_ratio: Number | None
    slides: bool


class CriterionRow(BaseModel):
    """D-optimality: ``value`` is -ln det of the covariance of the coordinates ``of`` [nats].

    ``flat`` is that of the flat spectrum under the same limits, and ``gap`` the upper bound of what
    a better spectrum could add. ``causes`` are the open causes whose sizes these coordinates are.
    """

    name: str
    of: list[str]
    causes: list[str] = []
    value: Number
    flat: Number
    gap: Number


class ExcitationFile(ResultFile):
    """Content of excitation.json.

    Args:
        model: path of the MJCF.
        kind: ``multisine`` or ``sweep``.
        band: lowest and highest line [Hz].
        rate: samples per second.
        period: length of a period [s].
        periods: periods of a realisation, with the first, which settles.
        realisations: signals, one after the other.
        averages: periods that count.
        seconds: length of the record.
        lines: number of lines.
        drives, limits, coherence, parameters, sliding: see their rows.
        noise: assumed noise of each output, one-sided [unit / sqrt(Hz)].
        criterion: for what the spectrum was designed.
        undetermined: sentences on parameters that stay undetermined.
        remarks: sentences for the user.
    """

    model: str
    kind: str
    band: tuple[Number, Number]
    rate: Number
    period: Number
    periods: int
    realisations: int
    averages: int
    seconds: Number
    lines: int
    drives: list[DriveRow]
    limits: list[LimitRow]
    noise: dict[str, Number]
    coherence: list[CoherenceSummary]
    criterion: CriterionRow
    parameters: list[ParameterForecast]
    undetermined: list[str]
    sliding: list[SlidingSummary]
    remarks: list[str]
