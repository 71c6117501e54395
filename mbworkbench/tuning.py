"""A model tuned to a campaign."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mbworkbench.campaign import MeasuredCampaign
from mbworkbench.labels import AnyPath, as_path, check_count
from mbworkbench.model import MachineModel
from mbworkbench.parameters import ParameterTable
from mbworkbench.sessions import open_checkpoint, open_together, takes_a_campaign
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
from tuning.files.schema import LevelGap

MAX_DOUBTS = 3  # doubts that the summary lists


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
        """Return the gap and the number of parameters in a few lines."""
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
