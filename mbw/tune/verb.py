"""``mbw tune``: a campaign in, a tuned model and the remaining gap out."""

from dataclasses import dataclass
from pathlib import Path

import typer
from rich.progress import Progress, TaskID

from diagnosis import residual_shares
from mbw.files import check_json, write_json
from mbw.messages import INTERRUPTED, NOT_CONVERGED, SCREEN, one_interrupt
from mbw.remarks import remarks
from mbw.tune.modes import measured_modes
from tuning import (
    CHECKPOINT,
    FOLDS,
    GAUSS_NEWTON,
    Freedom,
    Journal,
    Place,
    Residual,
    ShareRow,
    Tuned,
    TunedFile,
    Watch,
    check_folder,
    fingerprint,
    open_session,
    stages_of,
    tune,
    write_result,
)
from tuning import Progress as Step

_FEW = 5


@dataclass(frozen=True)
class Search:
    """What to fit.

    Args:
        residuals: what to minimise, in order.
        algorithm: of NLopt, by name, for the first stages; Gauss-Newton by default.
        at: where FRFs count: at the channels or at the centres of mass.
        modes: folder that ``mbw identify`` wrote; None to identify anew where modes are needed.
    """

    residuals: tuple[Residual, ...] = ("log",)
    algorithm: str = GAUSS_NEWTON
    at: Place = "sensors"
    modes: Path | None = None


_FRFS = Search()


def run(  # noqa: PLR0913  # one for each option
    campaign: Path,
    *,
    out: Path | None,
    json: Path | None = None,
    band: tuple[float, float] | None = None,
    starts: int = 1,
    seed: int = 0,
    jobs: int = 1,
    search: Search = _FRFS,
    resume: bool = False,
    inform: bool = False,
) -> Path:
    """Tune, write the result, say the gap; exit 130 if interrupted, 4 if not converged.

    Args:
        campaign: its folder.
        out: folder of the result; <campaign>-tuned if None.
        json: a file beside it, or ``-``.
        band: [Hz]; the lines with coherence if None.
        starts: the drawing, then random ones.
        seed: of the random starts.
        jobs: processes for the held-out fits.
        search: what to fit.
        resume: go on from the steps that an interrupted run finished.
        inform: say which further measurement would tell most.

    Returns:
        The folder of the result.
    """
    session = open_session(campaign, band)
    freq = session.campaign.freq_hz
    folder = out or Path(f"{session.campaign.name}-tuned")
    SCREEN.say(
        f"{session.campaign.name}: {len(session.campaign.tests)} tests, {len(freq)} lines "
        f"{freq[0]:g}..{freq[-1]:g} Hz, {_counted(session.freedom)}"
    )
    check_folder(folder)
    if json is not None:
        check_json(json)
    options = {"starts": starts, "seed": seed, "search": search}
    file = folder / CHECKPOINT
    if file.is_file() and not resume:
        SCREEN.say(f"{file} of an interrupted run is not used: --resume would go on from it")
    journal = Journal(file, fingerprint(session, options), resume=resume)
    measured = measured_modes(session.campaign, search.residuals, search.modes)
    for text in session.campaign.remarks:
        SCREEN.say(text)
    with SCREEN.progress() as progress, one_interrupt() as ends:
        bar = _Bar(progress, starts, len(stages_of(search.residuals)))
        tuned = tune(
            session,
            residuals=search.residuals,
            measured=measured,
            algorithm=search.algorithm,
            at=search.at,
            starts=starts,
            seed=seed,
            jobs=jobs,
            inform=inform,
            watch=Watch(bar.evaluated, bar.folded),
            journal=journal,
        )
        ends()
        summary = write_result(tuned, folder, _remaining(tuned))
        if json is not None:
            write_json(summary.model_dump_json(indent=1), json)
    _say(summary, folder)
    if not tuned.interrupted:
        journal.close()
    _leave(tuned)
    return folder


def _counted(varies: Freedom) -> str:
    tolerances = int(varies.has_prior.sum())
    return f"{varies.size - tolerances} parameters, {tolerances} tolerances"


def _remaining(tuned: Tuned) -> list[ShareRow]:
    """Where the gap shows, on held-out lines if there are any."""
    sensors = tuned.sensors
    gaps = sensors.channels(sensors.held_out or sensors.bounded)
    return [
        ShareRow(body=share.body, share=share.share, excess=share.excess)
        for share in residual_shares(gaps, tuned.session.campaign.layout)
    ]


class _Bar:
    """Stages of every start and folds, as steps of one bar."""

    def __init__(self, progress: Progress, starts: int, stages: int) -> None:
        self._progress, self._starts, self._stages = progress, starts, stages
        total = starts * stages + FOLDS
        self._task: TaskID = progress.add_task("reading", total=total)

    def evaluated(self, step: Step) -> None:
        """Show the stage, how many evaluations it has taken, and the cost."""
        where = f"start {step.start + 1}/{self._starts}, " if self._starts > 1 else ""
        self._progress.update(
            self._task,
            completed=step.start * self._stages + step.stage,
            description=(
                f"{where}stage {step.stage + 1}/{self._stages}: {step.evaluation} evaluations, "
                f"cost {step.cost:.4g}"
            ),
        )

    def folded(self, fold: int) -> None:
        """Show how many held-out fits are done."""
        self._progress.update(
            self._task,
            completed=self._starts * self._stages + fold + 1,
            description=f"held-out lines, fold {fold + 1}/{FOLDS}",
        )


def _say(summary: TunedFile, folder: Path) -> None:
    gap, fit = summary.gap.sensors, summary.fit
    trust = ", to be trusted" if fit.trusted else ""
    SCREEN.say(f"{fit.outcome} after {fit.evaluations} evaluations{trust}{_agreement(summary)}")
    rows = [("as drawn", gap.as_drawn), ("tuned", gap.tuned)]
    if gap.held_out is not None:
        rows.append(("tuned, on lines that the fit did not see", gap.held_out))
    for name, row in rows:
        SCREEN.say(f"  {name}: error {_number(row.error)}, excess {_number(row.excess)}")
    SCREEN.say(f"  noise: {_number(gap.noise)}")
    if summary.pairs:
        paired = sum(row.tuned is not None for row in summary.pairs)
        SCREEN.say(f"  {paired} of {len(summary.pairs)} measured modes have one of the model's")
    for remark in remarks(summary):
        SCREEN.say(f"  {remark}")
    for gain in summary.information[:_FEW]:
        where = f"a further hammer point at {gain.place}"
        if gain.what == "sensor":
            where = f"a further sensor beside {gain.place}"
        SCREEN.say(
            f"  {where}: {gain.parameter} known to {100 * gain.after:.2g} % instead of "
            f"{100 * gain.before:.2g} %; in the median, intervals shrink to "
            f"{100 * gain.shrink:.0f} %"
        )
    SCREEN.say(f"results in {folder}")


def _agreement(summary: TunedFile) -> str:
    fit = summary.fit
    if fit.starts == 1:
        return ""
    return f"; {fit.agreeing_starts} of {fit.starts} starts within 2 % of the best cost"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"


def _leave(tuned: Tuned) -> None:
    if tuned.interrupted:
        missing = tuned.fit.advice or "the fit is whole, held-out lines are missing"
        SCREEN.error(f"interrupted, go on with --resume: {missing}")
        raise typer.Exit(INTERRUPTED)
    if not tuned.fit.converged:
        SCREEN.error(f"not converged, {tuned.fit.outcome}: {tuned.fit.advice}")
        raise typer.Exit(NOT_CONVERGED)
