"""Schema of mode_table.json, the result of a tuning to a table of modes."""

from pydantic import BaseModel, ConfigDict

from identification.readers.result_files import ResultFile
from tuning.files.schema import InputRow, ModelModeRow, ParameterRow


class _TableRow(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class TablePartnerRow(_TableRow):
    """Mode of the model that is matched with a row of the table.

    ``mode`` is its number among the modes that oscillate, by rising frequency from 1. Errors are
    relative to the table. ``largest`` is the direction of a body with the largest kinetic energy.
    ``moves_most`` says whether the motion that the row names is the largest of its kind; None if
    the row names none.
    """

    mode: int
    frequency: float
    damping: float
    frequency_error: float
    damping_error: float | None
    largest: str
    moves_most: bool | None


class TabulatedModeRow(_TableRow):
    """One row of the table and its partners; None if the model has none.

    ``line`` is its line in the file. Standard deviations are those of the fit, stated or default.
    """

    line: int
    frequency: float
    frequency_sd: float
    damping: float | None
    damping_sd: float | None
    motion: str | None
    as_drawn: TablePartnerRow | None
    tuned: TablePartnerRow | None


class TableParameterRow(ParameterRow):
    """One parameter that varied, with the part of its prior's uncertainty that remains.

    ``ratio`` is its posterior over its prior standard deviation: 1 where the table tells nothing.
    """

    ratio: float


class TableFitRow(_TableRow):
    """How the search ended.

    ``chi_square`` is the mean squared residual of the table in units of its standard deviations.
    ``agreeing_starts`` ended within 2 % of the best cost.
    """

    outcome: str
    converged: bool
    advice: str
    evaluations: int
    cost: float
    chi_square: float
    starts: int
    agreeing_starts: int


class ModeTableFile(ResultFile, _TableRow):
    """Content of mode_table.json.

    ``determined`` names the parameters whose ``ratio`` is below 0.5. ``modes_without_row`` are
    modes of the tuned model between the lowest and the highest row that no row names.
    """

    table: str
    model: str
    fit: TableFitRow
    modes: list[TabulatedModeRow]
    modes_without_row: list[ModelModeRow]
    parameters: list[TableParameterRow]
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
