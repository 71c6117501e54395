"""Content of excitation.json."""

from identification.readers.result_files import ResultFile, ResultRow
from tuning.excitation.prediction import SlidingRow

EXCITATION_JSON = "excitation.json"


class DriveRow(ResultRow):
    """A drive; ``force`` is that of one unit of its signal, in ``force_unit``."""

    drive: str
    unit: str
    force: float
    force_unit: str
    rms: float


class LimitRow(ResultRow):
    """A limit, and the largest value that is reached, both in ``unit``."""

    drive: str
    what: str
    reached: float
    limit: float
    unit: str


class CoherenceSummary(ResultRow):
    """Coherence that an output will have with a drive: median and lowest over the lines."""

    drive: str
    output: str
    median: float
    lowest: float


class ParameterForecast(ResultRow):
    """A stiffness or damping with its expected 95 % interval [SI]."""

    parameter: str
    nominal: float
    unit: str
    interval: tuple[float, float]
    determined: bool


class CriterionRow(ResultRow):
    """D-optimality: ``value`` is -ln det of the covariance of the coordinates ``of`` [nats].

    ``flat`` is that of the flat spectrum under the same limits, and ``gap`` the upper bound of what
    a better spectrum could add. ``causes`` are the open causes whose sizes these coordinates are.
    """

    name: str
    of: list[str]
    causes: list[str] = []
    value: float
    flat: float
    gap: float


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
    band: tuple[float, float]
    rate: float
    period: float
    periods: int
    realisations: int
    averages: int
    seconds: float
    lines: int
    drives: list[DriveRow]
    limits: list[LimitRow]
    noise: dict[str, float]
    coherence: list[CoherenceSummary]
    criterion: CriterionRow
    parameters: list[ParameterForecast]
    undetermined: list[str]
    sliding: list[SlidingRow]
    remarks: list[str]
