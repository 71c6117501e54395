"""``mbw diagnose``: search for effects that the model lacks, with places and probabilities.

Table of hypotheses with the reasons of their rejection, for ``mbw diagnose --explain``.
"""

from functools import partial
from pathlib import Path

from rich.progress import Progress, TaskID
from rich.table import Table

from diagnosis import Diagnosis, diagnose, hash_inputs
from diagnosis.effects import check_others
from diagnosis.verdict.sentences import other_places
from mbmodel import refuse_difference
from mbw.diagnose.augmented import write_augmented
from mbw.diagnose.fitted_sets import fitted_rows, key_words, rejection_reasons
from mbw.diagnose.gap_sentences import closed_words, unestablished_words
from mbw.diagnose.headline import doubts, findings, lead
from mbw.diagnose.page import render
from mbw.diagnose.result import collect_result
from mbw.diagnose.sentences import cause_parameters, sensor_check_sentences
from mbw.files import write_json
from mbw.messages import SCREEN, allow_one_interrupt
from mbw.output_folder import ResultOptions
from mbw.page.numbers import format_closed, format_percent
from mbw.remarks import calibration_sentence, describe_gap, describe_not_in_mjcf, gain_sentence
from mbw.results.diagnosed_files import CHECKPOINT, NAMES, PAGE, StoredDiagnosis, write_files
from mbw.resume import open_checkpoint
from tuning import Checkpoint, Session, open_session
from tuning.files.plant_folder import AUGMENTED, SHOWN, VERDICT

_MAX_LISTED_CAUSES = 8  # causes that the terminal lists


def run(
    campaign: Path,
    outputs: ResultOptions,
    *,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    explain: bool = False,
    resume: bool = False,
) -> Path:
    """Diagnose, write the verdict and its page, print a summary.

    Args:
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.
        jobs: number of processes; the verdict does not depend on it.
        explain: whether to print the hypotheses that were tested and rejected.
        resume: whether to continue from the refits that an interrupted run finished.

    Returns:
        The folder of the result.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished refits are in the checkpoint.
    """
    session = open_session(campaign, band)
    check_others(session)
    with outputs.open("diagnose", session.source, "diagnosed", NAMES) as output:
        checkpoint = open_checkpoint(
            output.path / CHECKPOINT, hash_inputs(session), "search", resume=resume
        )
        diagnosis = _diagnose(session, jobs, checkpoint)
        with output.write() as place:
            augmented = write_augmented(diagnosis, place / AUGMENTED)
            result = collect_result(diagnosis, augmented)
            write_files(result, place)
            if outputs.pictures:
                (place / PAGE).write_text(render(result), encoding="utf-8")
        checkpoint.close()
    write_json(result.verdict.model_dump_json(indent=1), outputs.json)
    if explain and not SCREEN.quiet:
        _explain(diagnosis)
    _say(result, diagnosis)
    SCREEN.say(f"verdict in {output.path / VERDICT}")
    effect = " with the effect" if diagnosis.present.established else ""
    SCREEN.say(f"tuned model{effect} in {output.path / AUGMENTED}")
    # Without a rest of the state before, sizes are in the units of its fitted force channel.
    is_exact = session.campaign.has_states and diagnosis.session.model.machine.rest is None
    tolerance = 0.0 if is_exact else session.known_force_tolerance
    SCREEN.say(f"  {calibration_sentence(tolerance)}")
    for row in augmented.plant.alternatives:
        SCREEN.say(
            f"  {row.name} may be there instead ({format_percent(row.probability)}): {row.file}"
        )
    shown = result.shown
    if missing := describe_not_in_mjcf(shown.not_held_by_mjcf, shown.not_held_error, SHOWN):
        SCREEN.say(f"  {missing}")
    if outputs.pictures:
        SCREEN.say(f"report in {(output.path / PAGE).absolute().as_uri()}")
    refuse_difference(AUGMENTED, shown.mjcf_difference)
    return output.path


def _diagnose(session: Session, jobs: int, checkpoint: Checkpoint) -> Diagnosis:
    """Diagnose with a progress bar, and print the remarks on the data.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished refits are in the checkpoint.
    """
    for text in session.campaign.remarks:
        SCREEN.say(text)
    with SCREEN.progress() as progress, allow_one_interrupt() as ignore_interrupts:
        # The number of steps depends on the data.
        tell = partial(_show_step, progress, progress.add_task("diagnosis", total=None))
        diagnosis = diagnose(session, jobs=jobs, tell=tell, checkpoint=checkpoint)
        ignore_interrupts()
    for text in diagnosis.session.campaign.remarks[len(session.campaign.remarks) :]:
        SCREEN.say(text)
    return diagnosis


def _show_step(progress: Progress, bar: TaskID, text: str) -> None:
    """Show that another step begins."""
    progress.update(bar, advance=1, description=text)


def _say(result: StoredDiagnosis, diagnosis: Diagnosis) -> None:
    """Print the headline of the page, the gap, the causes, and what the page says beside them."""
    verdict, present = result.verdict, diagnosis.present
    gap, joint_causes = verdict.gap, sum(row.excess_after is not None for row in verdict.causes)
    SCREEN.say(f"\n{result.shown.campaign}: {lead(result)}")
    steps = (
        ("as drawn (nominal model)", gap.as_drawn),
        ("re-tuned", gap.retuned),
        (f"with the effect{'s' if joint_causes > 1 else ''}", gap.after),
    )
    for name, at in steps:
        if at.excess is not None:
            SCREEN.say(f"  {name}: {describe_gap(at.error, at.excess)}")
    if gap.closed is not None and gap.closed >= 0:
        SCREEN.say(f"  {closed_words(gap.closed, gap.interval.closed)}")
    established = {row.cause for row in result.shown.established}
    closed = {key[:2]: share for key, share in present.closes.items()}
    sized = {key[:2] for key in present.intervals}  # their sizes decided, all else being enough
    for number, row in enumerate(verdict.causes[:_MAX_LISTED_CAUSES]):
        name, sizes = key_words(row.key), cause_parameters(row)
        name += "".join(f" or {place}" for place in other_places(row))
        sizes = f": {sizes}" if sizes else ""
        share = closed.get((row.effect, row.location))
        part = "" if share is None else f"; closes {format_closed(share)} of the fitted lines' gap"
        part += " that the others leave" if part and joint_causes > 1 else ""
        if share is not None and number not in established:
            has_size = (row.effect, row.location) not in sized
            part += f", {unestablished_words(share, has_size=has_size)}"
        SCREEN.say(f"  {row.probability:.0%} {name}{sizes}{part}")
    is_everywhere = verdict.rest is not None and verdict.rest.spread == "everywhere"
    if verdict.verdict == "unexplained" and verdict.where and not is_everywhere:
        places = ", ".join(
            f"{row.location} {row.share:.0%}" for row in verdict.where[:3] if row.share is not None
        )
        SCREEN.say(f"  where: {places}" if places else "  where: these data do not locate it")
    for text in (
        *doubts(result)[len(diagnosis.session.campaign.remarks) :],  # which are said before the fit
        *filter(None, [gain_sentence(verdict.channel_gains)]),
        *sensor_check_sentences(result.shown),
        *(f"{place} has an unknown fault and was left out" for place in diagnosis.checks.unknown),
        *findings(result),
    ):
        SCREEN.say(f"  {text}")
    if verdict.next_experiment:
        SCREEN.say(f"  next experiment: {verdict.next_experiment}")


def _explain(diagnosis: Diagnosis) -> None:
    """Print the data checks and the hypotheses with the reasons of their rejection."""
    for check in diagnosis.checks.bodies:
        SCREEN.say(check.sentence)
    null = diagnosis.evidence.null
    SCREEN.say(
        f"null model, without any effect: model error {format_percent(null.floor)}, residual over "
        f"noise {null.chi_square**0.5:.3g}"
    )
    SCREEN.console.print(hypothesis_table(diagnosis))


_MAX_LISTED_SCORES = 8  # hypotheses without a refit
_MAX_LISTED_SETS = 16  # sets of causes
_MIN_ODDS_WIDTH = 18  # characters of log odds and reason, on a narrow terminal


def hypothesis_table(diagnosis: Diagnosis) -> Table:
    """Return a table of sets of causes, the best fit first, then of hypotheses with a score alone.

    Args:
        diagnosis: diagnosis with its evidence.
    """
    evidence = diagnosis.evidence
    table = Table(title=f"{evidence.hypotheses} effects and places, by score and after a refit")
    table.add_column("hypothesis", overflow="fold")
    for name in ("score", "error %", "closed %"):
        table.add_column(name, no_wrap=True, justify="right", min_width=len(name))
    table.add_column("log odds", min_width=_MIN_ODDS_WIDTH)
    table.caption = (
        "score and log odds: nats; error: of the model after the refit; closed: part of the gap, "
        "all where the residual falls below the noise, none where it grows"
    )
    rows = [row for row in fitted_rows(evidence, diagnosis.settings) if row.fit.keys]
    proven = {hypothesis.key for hypothesis in diagnosis.gross_hypotheses}
    named = frozenset(cause.key for cause in diagnosis.present.causes) - proven
    scores = {score.key[:2]: score.gain for score in evidence.scored}
    for row, why in list(zip(rows, rejection_reasons(rows, named), strict=True))[:_MAX_LISTED_SETS]:
        keys = row.fit.keys
        score = scores.get(keys[0][:2]) if len(keys) == 1 else None
        table.add_row(
            " + ".join(map(key_words, keys)),
            "" if score is None else f"{score:.0f}",
            f"{100 * row.fit.floor:.2g}",
            "" if row.closed is None else _closed_cell(row.closed),
            ", ".join(filter(None, ["" if row.log_odds is None else f"{row.log_odds:.0f}", why])),
        )
    fitted = {key[:2] for row in rows for key in row.fit.keys}
    unfitted = [score for score in evidence.scored if score.key[:2] not in fitted]
    for scored in unfitted[:_MAX_LISTED_SCORES]:
        table.add_row(key_words(scored.key), f"{scored.gain:.0f}", "", "", "small score")
    return table


def _closed_cell(closed: float) -> str:
    """Return the closed share of a gap in whole per cent, ``all`` or ``none``."""
    text = f"{100 * closed:.0f}"
    is_share = 0 <= closed < 1.005
    return text if is_share else format_closed(closed).removeprefix("about ")
