"""``mbw tune``: tuning of a model to a campaign, with the gap that remains."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import typer
from rich.progress import Progress, TaskID

from diagnosis import compute_residual_shares
from identification.readers.result_files import json_text
from identification.words import Campaign, UsageError, percent_text
from mbmodel import refuse_difference
from mbw.files import write_json
from mbw.interrupts import INTERRUPTED
from mbw.messages import NOT_CONVERGED, SCREEN, allow_one_interrupt
from mbw.output_folder import OutputFolder, ResultOptions
from mbw.remarks import (
    calibration_sentence,
    describe_gap,
    describe_search,
    gain_tolerance,
    list_reading_options,
    list_remarks,
    number_text,
)
from mbw.resume import open_checkpoint
from mbw.tune.modes import measured_modes, parse_residuals
from mbw.tune.page import PAGE, render
from tuning import (
    CHECKPOINT_FILE,
    POSTERIOR_NPZ,
    TUNING_ALGORITHM,
    CampaignTuning,
    FitProgress,
    Parametrisation,
    ProgressCallbacks,
    ResidualKind,
    TunedFile,
    fingerprint,
    open_session,
    read_result,
    select_stages,
    tune,
    write_result,
)
from tuning.assessment.held_out import N_FOLDS
from tuning.control_loops.loops_file import LOOPS_JSON
from tuning.files.result import FRF_NPZ, TUNED_JSON, TUNED_MJCF
from tuning.files.schema import ShareRow
from tuning.fitting.machine_fit import count_starts

NAMES = (TUNED_JSON, TUNED_MJCF, FRF_NPZ, POSTERIOR_NPZ, LOOPS_JSON, PAGE)
_MAX_FURTHER_POINTS = 5  # further hammer points and sensors that the terminal lists


@dataclass(frozen=True)
class SearchOptions:
    """Choices of the user about the fit.

    Args:
        residual: text of the residuals to minimise, in order, such as ``modal,log``.
        algorithm: name of an algorithm of NLopt, or ``GAUSS_NEWTON``, for stages in which
            stiffness and damping alone vary.
        at_bodies: whether FRFs are compared at the centres of mass, not at the channels.
        from_modes: folder that ``mbw identify`` wrote; None to identify modes anew if needed.
    """

    residual: str = "log"
    algorithm: str = TUNING_ALGORITHM
    at_bodies: bool = False
    from_modes: Path | None = None


_DEFAULT_SEARCH = SearchOptions()


def run(  # noqa: PLR0913  # one for each option
    source: Path,
    outputs: ResultOptions,
    *,
    misplaced: Sequence[str] = (),
    band: tuple[float, float] | None = None,
    starts: int | None = None,
    seed: int = 0,
    jobs: int = 1,
    search: SearchOptions = _DEFAULT_SEARCH,
    resume: bool = False,
    information: bool = False,
) -> Path:
    """Tune the model, write the result, print the gap.

    Args:
        source: folder of the campaign.
        misplaced: names of stated options that a table of modes alone has.
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.
        starts: number of starts: the nominal model, then random ones; None for 1.
        jobs: number of processes for the held-out fits.
        search: choices about the fit.
        resume: whether to continue from the steps that an interrupted run finished.
        information: whether to rank further measurements by their information.

    Returns:
        The folder of the result.

    Raises:
        typer.Exit: the fit was interrupted (code 130) or did not converge (code 4).
    """
    if misplaced:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in misplaced)
        raise UsageError(
            f"{names} works with --modes only: state what is known in [tuning] of campaign.toml"
        )
    residuals, starts = parse_residuals(search.residual), starts or 1
    session = open_session(source, band)
    session = replace(session, campaign=session.campaign.leave_out_after())
    freq = session.campaign.freq_hz
    SCREEN.say(
        f"{session.campaign.name}: {len(session.campaign.tests)} tests, {len(freq)} frequency "
        f"lines {freq[0]:g}..{freq[-1]:g} Hz, {_parameter_counts(session.parametrisation)}"
    )
    with outputs.open("tune", session.source, "tuned", NAMES) as output:
        options = {"starts": starts, "seed": seed, "search": search}
        checkpoint = open_checkpoint(
            output.path / CHECKPOINT_FILE, fingerprint(session, options), "tuning", resume=resume
        )
        measured = measured_modes(session.campaign, residuals, search.from_modes)
        for text in session.campaign.remarks:
            SCREEN.say(text)
        with SCREEN.progress() as progress, allow_one_interrupt() as ignore_interrupts:
            bar = _ProgressBar(progress, session.campaign, residuals, starts)
            tuned = tune(
                session,
                residuals=residuals,
                measured=measured,
                algorithm=search.algorithm,
                at="bodies" if search.at_bodies else "sensors",
                starts=starts,
                seed=seed,
                jobs=jobs,
                inform=information,
                callbacks=ProgressCallbacks(bar.show_evaluation, bar.show_fold),
                checkpoint=checkpoint,
            )
            ignore_interrupts()
            summary = _write(tuned, output, outputs)
        _say(summary, output.path)
        if summary.fit.trusted:
            words = shlex.join([str(session.source.parent), *list_reading_options()])
            SCREEN.say(f"next: mbw diagnose {words} seeks what the model lacks")
        outputs.say_page(output.path / PAGE)
        if not tuned.interrupted:
            checkpoint.close()
    refuse_difference(TUNED_MJCF, summary.mjcf_difference)
    _exit_unless_converged(tuned)
    return output.path


def _write(tuned: CampaignTuning, output: OutputFolder, outputs: ResultOptions) -> TunedFile:
    """Write the result, its page and the further JSON file; return the content of tuned.json."""
    with output.write() as place:
        summary = write_result(tuned, place, _remaining_gap(tuned))
        if outputs.pictures:
            (place / PAGE).write_text(render(read_result(place)), encoding="utf-8")
    write_json(json_text(summary), outputs.json)
    return summary


def _parameter_counts(parametrisation: Parametrisation) -> str:
    tolerances = int(parametrisation.is_tolerance.sum())
    return f"{parametrisation.size - tolerances} parameters, {tolerances} tolerances"


def _remaining_gap(tuned: CampaignTuning) -> list[ShareRow]:
    """Return each body's share of the remaining gap, on held-out lines if there are any."""
    sensors = tuned.sensors
    gaps = sensors.channels(sensors.held_out or sensors.bounded)
    return [
        ShareRow(body=share.body, share=share.share, excess=share.excess)
        for share in compute_residual_shares(gaps, tuned.session.campaign.layout)
    ]


class _ProgressBar:
    """Progress bar whose steps are the stages of every start and the folds."""

    def __init__(
        self,
        progress: Progress,
        campaign: Campaign,
        residuals: tuple[ResidualKind, ...],
        starts: int,
    ) -> None:
        has_frfs = residuals[-1] == "log"
        self._progress, self._stages = progress, len(select_stages(residuals)) + has_frfs
        self._starts = count_starts(campaign, starts) if has_frfs else starts
        total = self._starts * self._stages + N_FOLDS
        self._task: TaskID = progress.add_task("reading", total=total)

    def show_evaluation(self, step: FitProgress) -> None:
        """Show the stage, its number of evaluations and the cost."""
        where = f"start {step.start + 1}/{self._starts}, " if self._starts > 1 else ""
        self._progress.update(
            self._task,
            completed=step.start * self._stages + step.stage,
            description=(
                f"{where}stage {step.stage + 1}/{self._stages}: {step.evaluation} evaluations, "
                f"cost {step.cost:.4g}"
            ),
        )

    def show_fold(self, fold: int) -> None:
        """Show the number of finished held-out fits."""
        self._progress.update(
            self._task,
            completed=self._starts * self._stages + fold + 1,
            description=f"held-out frequency lines, fold {fold + 1}/{N_FOLDS}",
        )


def _say(summary: TunedFile, folder: Path) -> None:
    gap = summary.gap.sensors
    SCREEN.say(describe_search(summary.fit))
    rows = [("as drawn (nominal model)", gap.as_drawn), ("tuned", gap.tuned)]
    if gap.held_out is not None:
        rows.append(("tuned, on held-out frequency lines", gap.held_out))
    for name, row in rows:
        SCREEN.say(f"  {name}: {describe_gap(row.error, row.excess)}")
    if gap.noise is not None:
        SCREEN.say(f"  noise: {number_text(gap.noise)}")
    if summary.model_error is not None:
        SCREEN.say(
            f"  model error beside the noise: {percent_text(summary.model_error)} of the motion at "
            "each sensor"
        )
    if summary.pairs:
        paired = sum(row.tuned is not None for row in summary.pairs)
        SCREEN.say(f"  {paired} of {len(summary.pairs)} measured modes match a mode of the model")
    for remark in list_remarks(summary):
        SCREEN.say(f"  {remark}")
    SCREEN.say(f"  {calibration_sentence(gain_tolerance(summary))}")
    for gain in summary.information[:_MAX_FURTHER_POINTS]:
        where = f"a further hammer point at {gain.place}"
        if gain.what == "sensor":
            where = f"a further sensor beside {gain.place}"
        SCREEN.say(
            f"  {where}: the standard deviation of {gain.parameter} would be "
            f"{percent_text(gain.after)} instead of {percent_text(gain.before)}; in the median, "
            f"intervals would shrink to {100 * gain.shrink:.0f} %"
        )
    SCREEN.say(f"results in {folder}")


def _exit_unless_converged(tuned: CampaignTuning) -> None:
    if tuned.interrupted:
        missing = tuned.fit.advice or "the fit is complete, the held-out fits are missing"
        SCREEN.error(f"interrupted, continue with --resume: {missing}")
        raise typer.Exit(INTERRUPTED)
    if not tuned.fit.converged:
        SCREEN.error(f"not converged, {tuned.fit.outcome}: {tuned.fit.advice}")
        raise typer.Exit(NOT_CONVERGED)
