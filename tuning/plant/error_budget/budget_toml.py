"""Reader of budget.toml: errors, disturbances, noise, loops and correlations."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from identification.readers.controller import LoopTable
from identification.readers.toml_files import FileName, TomlTable, read_toml

_MAX_SINES = 1000  # of a source
Weights = list[Annotated[float, Field(ge=-1e12, le=1e12)]]


class ErrorTable(TomlTable):
    """Settings of ``[error.NAME]``: an output, or the difference of two.

    ``unit`` is the unit in which the error is shown: nm or nrad without it.
    """

    output: str
    minus: str | None = None
    unit: str | None = None


class LineTable(TomlTable):
    """A sine of a source.

    Its frequency is ``frequency`` [Hz], or ``order`` times the speed of the source. Its peak is
    ``amplitude`` in the unit of the source, or the force of an ``unbalance`` [kg m] at that speed.
    """

    order: float | None = Field(default=None, gt=0)
    frequency: float | None = Field(default=None, gt=0)
    amplitude: float | None = Field(default=None, ge=0)
    unbalance: float | None = Field(default=None, ge=0)


class SpectrumTable(TomlTable):
    """Spectrum of a source: a table, a vibration criterion, a constant density, or lines."""

    csv: FileName | None = None
    column: str | None = None
    two_sided: bool = False
    vc: str | None = None
    density: float | None = Field(default=None, ge=0)
    unit: str | None = None
    band: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    speed_hz: float | None = Field(default=None, gt=0)
    speed_rpm: float | None = Field(default=None, gt=0)
    lines: list[LineTable] = Field(default_factory=list, max_length=_MAX_SINES)


class DisturbanceTable(SpectrumTable):
    """Settings of ``[disturbance.NAME]``: where a signal acts, and its spectrum.

    With several inputs ``gain`` and ``phase_deg`` state the factor of each: one signal acts at all
    of them.
    """

    input: str | list[str]
    gain: Weights | None = None
    phase_deg: Weights | None = None


class NoiseTable(SpectrumTable):
    """Settings of ``[noise.NAME]``: the noise of the measurement of a loop."""

    loop: str


class CorrelationTable(TomlTable):
    """Settings of one ``[[correlation]]``: coherence of two sources, from 0 to 1."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    coherence: float = Field(ge=0, le=1)
    phase_deg: float = 0.0


class BudgetFile(TomlTable):
    """Content of budget.toml."""

    band: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    error: dict[str, ErrorTable] = Field(default_factory=dict)
    disturbance: dict[str, DisturbanceTable] = Field(default_factory=dict)
    noise: dict[str, NoiseTable] = Field(default_factory=dict)
    loop: dict[str, LoopTable] = Field(default_factory=dict)
    correlation: list[CorrelationTable] = Field(default_factory=list)


def read_budget_file(path: Path) -> BudgetFile:
    """Read budget.toml and check every key.

    Raises:
        InputError: the file cannot be read, or a key is unknown or has a wrong value.
    """
    return read_toml(path, BudgetFile)
