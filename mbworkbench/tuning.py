"""A model tuned to a campaign.

Table of tuned parameters.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

from identification.words import UsageError
from mbworkbench.campaign import MeasuredCampaign, open_checkpoint, open_together, takes_a_campaign
from mbworkbench.labels import AnyPath, as_path, check_count
from mbworkbench.model import MachineModel
from mbworkbench.tables import Shown, Table, cell_text
from tuning import (
    CampaignTuning,
    FitProgress,
    ProgressCallbacks,
    TunedFile,
    fingerprint,
    write_result,
)
from tuning import tune as tune_session
from tuning.files.result import summarise_tuning
from tuning.files.schema import LevelGap, ParameterRow

MAX_LISTED = 8  # rows of the summary


@dataclass(frozen=True, eq=False, repr=False)
class ParameterTable(Shown, Sequence[ParameterRow]):
    """Parameters with nominal value, tuned value, 95 % interval and pull.

    ``table["tilt_tz.stiffness"]`` is the row of one parameter, ``table[0]`` the first row.

    Attributes:
        rows: one row for each parameter.
    """

    rows: tuple[ParameterRow, ...]

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.rows)

    def __iter__(self) -> Iterator[ParameterRow]:
        """Iterate over the rows."""
        return iter(self.rows)

    @overload
    def __getitem__(self, key: int | str) -> ParameterRow: ...

    @overload
    def __getitem__(self, key: slice) -> "ParameterTable": ...

    def __getitem__(self, key: int | str | slice) -> "ParameterRow | ParameterTable":
        """Return one row by number or name, or several by a slice.

        Raises:
            UsageError: there is no parameter of this name.
        """
        if isinstance(key, slice):
            return ParameterTable(self.rows[key])
        if isinstance(key, int):
            return self.rows[key]
        for row in self.rows:
            if row.name == key:
                return row
        raise UsageError(f"{key!r} is no parameter: the table lists {len(self.rows)} by name")

    def __repr__(self) -> str:
        """Return the first rows, and how many there are."""
        lines = [
            f"  {row.name}: {cell_text(row.drawn)} -> {cell_text(row.tuned)} {row.unit}"
            for row in self.rows[:MAX_LISTED]
        ]
        return "\n".join([f"{len(self.rows)} parameters, nominal -> tuned", *lines])

    def table(self) -> Table:
        """Return a table of all rows."""
        header = ("parameter", "unit", "nominal", "tuned", "low", "high", "pull")
        rows = [
            (row.name, row.unit, row.drawn, row.tuned, row.low, row.high, row.pull)
            for row in self.rows
        ]
        return Table(f"{len(self.rows)} parameters", header, rows)


MAX_DOUBTS = 3  # doubts that the summary lists, and as many undetermined parameters


@dataclass(frozen=True, eq=False)
class TunedModel(Shown):
    """A tuned model: its parameters with intervals, and the gap that remains.

    Attributes:
        fits: fits, held-out fits and predictions.
        summary: the content of ``tuned.json``.
    """

    fits: CampaignTuning
    summary: TunedFile

    @property
    def parameters(self) -> ParameterTable:
        """Every parameter: nominal value, tuned value, 95 % interval and pull."""
        return ParameterTable(tuple(self.summary.parameters))

    @property
    def gap(self) -> LevelGap:
        """The gap at the sensors: nominal model, tuned model, held-out lines and noise."""
        return self.summary.gap.sensors

    def write(self, folder: AnyPath) -> Path:
        """Write ``tuned.json``, the tuned MJCF and the FRFs, as ``mbw tune`` does.

        Args:
            folder: where they go; it is made where it does not exist.

        Raises:
            InputError: the folder cannot be written.
        """
        target = as_path(folder)
        write_result(self.fits, target)
        return target

    def __repr__(self) -> str:
        """Return the gap, its doubts and what the data do not determine in a few lines."""
        gap = self.gap
        steps = {"nominal": gap.as_drawn, "tuned": gap.tuned, "held out": gap.held_out}
        return "\n".join(
            (
                f"{self.summary.campaign}: {len(self.parameters)} parameters tuned, "
                f"{'interrupted' if self.summary.interrupted else self.summary.fit.outcome}",
                *(
                    f"  {name}: error {cell_text(step.error)}, excess {cell_text(step.excess)}"
                    for name, step in steps.items()
                    if step is not None
                ),
                f"  noise: {cell_text(gap.noise)}",
                *(f"  doubt: {doubt}" for doubt in self.summary.fit.doubts[:MAX_DOUBTS]),
                *(f"  {row.sentence}" for row in self.summary.unseen[:MAX_DOUBTS]),
            )
        )

    def table(self) -> Table:
        """Return a table of the parameters."""
        return self.parameters.table()


@takes_a_campaign
def tune(
    campaign: MeasuredCampaign | AnyPath,
    *,
    model: MachineModel | None = None,
    band: tuple[float, float] | None = None,
    starts: int = 1,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[FitProgress], None] | None = None,
    resume: AnyPath | None = None,
) -> TunedModel:
    """Tune stiffness, damping and tolerances of a model to a campaign.

    Args:
        campaign: from ``read_campaign``, or the path of its folder.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.
        starts: number of starts: the nominal model, then random ones.
        seed: seed of the random starts.
        jobs: number of processes for the starts, and of threads for the held-out fits.
        progress: called at each evaluation of the fit.
        resume: file that keeps finished steps; an interrupted tuning goes on from it.

    Raises:
        InputError: campaign or model cannot be used, or the file is that of another tuning.
        UsageError: arguments are exchanged or out of their range.
    """
    check_count("starts", starts)
    check_count("jobs", jobs)
    session = open_together(campaign, model, band)
    fits = tune_session(
        session,
        starts=starts,
        seed=seed,
        jobs=jobs,
        callbacks=ProgressCallbacks(on_evaluation=progress),
        checkpoint=open_checkpoint(
            resume, lambda: fingerprint(session, {"starts": starts, "seed": seed})
        ),
    )
    return TunedModel(fits, summarise_tuning(fits))
