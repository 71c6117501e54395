"""``mbw diagnose``: search for effects that the model lacks, with places and probabilities."""

from pathlib import Path

from rich.progress import Progress
from rich.table import Table

from diagnosis import Diagnosis, Verdict, diagnose
from diagnosis.effects import check_others
from diagnosis.refits.refitting import Refit
from mbw.band import check_band
from mbw.diagnose.files import (
    AUGMENTED,
    NAMES,
    PAGE,
    SHOWN,
    VERDICT,
    write_augmented,
    write_files,
)
from mbw.diagnose.page import render
from mbw.diagnose.pulled_tolerance import pull_sentence
from mbw.diagnose.result import collect_result, unfinished_fit_sentences
from mbw.diagnose.sentences import (
    cause_parameters,
    closed_words,
    confounded_sentences,
    noise_sentences,
    serial_correlation_sentences,
    swap_sentence,
    untested_sentences,
)
from mbw.files import write_json
from mbw.gain_text import gain_sentence
from mbw.gap_text import describe_gap
from mbw.messages import SCREEN, allow_one_interrupt
from mbw.output_folder import ResultOptions
from mbw.remarks import describe_not_in_mjcf
from tuning import Session, open_session

_MAX_LISTED_CAUSES = 8  # causes that the terminal lists; twice as many hypotheses with --explain


def run_options(  # one for each option
    campaign: Path,
    *,
    out: Path | None,
    json: Path | None,
    band: tuple[float, float] | None,
    jobs: int,
    explain: bool,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.diagnose.options`` describes them."""
    check_band(band)
    outputs = ResultOptions(out, json, overwrite)
    run(campaign, outputs, band=band, jobs=jobs, explain=explain)


def run(
    campaign: Path,
    outputs: ResultOptions,
    *,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    explain: bool = False,
) -> Path:
    """Diagnose, write the verdict and its page, print a summary.

    Args:
        campaign: folder of the campaign.
        outputs: where the result is written.
        band: lowest and highest frequency [Hz]; None for the frequency lines with coherence.
        jobs: number of processes; the verdict does not depend on it.
        explain: whether to print the hypotheses that were tested and rejected.

    Returns:
        The folder of the result.
    """
    session = open_session(campaign, band)
    check_others(session)
    with outputs.open("diagnose", session.source, "diagnosed", NAMES) as output:
        diagnosis = _diagnose(session, jobs)
        with output.write() as place:
            result = collect_result(diagnosis, write_augmented(diagnosis, place / AUGMENTED))
            write_files(result, place)
            (place / PAGE).write_text(render(result), encoding="utf-8")
    if outputs.json is not None:
        write_json(result.verdict.model_dump_json(indent=1), outputs.json)
    if explain and not SCREEN.quiet:
        _explain(diagnosis)
    _say(result.verdict, diagnosis)
    SCREEN.say(f"verdict in {output.path / VERDICT}")
    effect = " with the effect" if diagnosis.after else ""
    SCREEN.say(f"tuned model{effect} in {output.path / AUGMENTED}")
    if missing := describe_not_in_mjcf(result.shown.not_held_by_mjcf, SHOWN):
        SCREEN.say(f"  {missing}")
    SCREEN.say(f"report in {(output.path / PAGE).absolute().as_uri()}")
    return output.path


def _diagnose(session: Session, jobs: int) -> Diagnosis:
    """Diagnose with a progress bar, and print the remarks on the data."""
    for text in session.campaign.remarks:
        SCREEN.say(text)
    with SCREEN.progress() as progress, allow_one_interrupt() as ignore_interrupts:
        diagnosis = diagnose(session, jobs=jobs, tell=_ProgressReporter(progress).show_step)
        ignore_interrupts()
    for text in diagnosis.session.campaign.remarks[len(session.campaign.remarks) :]:
        SCREEN.say(text)
    return diagnosis


class _ProgressReporter:
    """Reporter of the current step on a progress bar."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        # The number of steps depends on the data.
        self._bar = progress.add_task("diagnosis", total=None)

    def show_step(self, text: str) -> None:
        """Show that another step begins."""
        self._progress.update(self._bar, advance=1, description=text)


def _say(verdict: Verdict, diagnosis: Diagnosis) -> None:
    """Print the verdict in a few lines."""
    campaign = diagnosis.session.campaign.name
    gap = verdict.gap
    words = {
        "none": "nothing is missing beyond tolerances and noise",
        "unexplained": "the model lacks something that no effect of the catalogue explains",
        "several": "several effects are present",
        "explained": "one effect is present",
    }
    SCREEN.say(f"\n{campaign}: {words[verdict.verdict]}")
    steps = (
        ("as drawn (nominal model)", gap.as_drawn),
        ("re-tuned", gap.retuned),
        ("with the effect", gap.after),
    )
    for name, at in steps:
        if at.excess is not None:
            SCREEN.say(f"  {name}: {describe_gap(at.error, at.excess)}")
    if gap.closed is not None:
        SCREEN.say(f"  {closed_words(gap.closed, gap.interval.closed)}")
    for row in verdict.causes[:_MAX_LISTED_CAUSES]:
        dof = f" {row.dof}" if row.dof else ""
        sizes = cause_parameters(row)
        sizes = f": {sizes}" if sizes else ""
        SCREEN.say(f"  {row.probability:.0%} {row.effect} at {row.location}{dof}{sizes}")
    if verdict.verdict == "unexplained" and verdict.where:
        places = ", ".join(
            f"{row.location} {row.share:.0%}" for row in verdict.where[:3] if row.share is not None
        )
        SCREEN.say(f"  where: {places}" if places else "  where: these data do not locate it")
    _say_more(verdict, diagnosis)


def _say_more(verdict: Verdict, diagnosis: Diagnosis) -> None:
    """Print remarks on tolerances, fits, sensors, noise, confounded causes and the next test."""
    first = (pull_sentence(verdict, diagnosis), gain_sentence(verdict.channel_gains))
    for text in (*filter(None, first), *unfinished_fit_sentences(diagnosis)):
        SCREEN.say(f"  {text}")
    for check in diagnosis.gate.flexible:
        SCREEN.say(f"  {check.sentence}")
    for fault in diagnosis.gate.faults:
        if fault.effect == "sensor_swap":
            SCREEN.say(f"  {swap_sentence(fault.location, fault.dof)}")
    for place in diagnosis.gate.unknown:
        SCREEN.say(f"  {place} has an unknown fault and was left out")
    evidence = diagnosis.evidence
    for text in (*serial_correlation_sentences(evidence), *noise_sentences(evidence)):
        SCREEN.say(f"  {text}")
    levels = len({test.condition.level_n for test in diagnosis.session.campaign.tests})
    for text in (*confounded_sentences(verdict), *untested_sentences(verdict, levels)):
        SCREEN.say(f"  {text}")
    if verdict.next_experiment:
        SCREEN.say(f"  next experiment: {verdict.next_experiment}")


def _explain(diagnosis: Diagnosis) -> None:
    """Print the data checks and the hypotheses with the reasons of their rejection."""
    for check in diagnosis.gate.checks:
        SCREEN.say(check.sentence)
    before = diagnosis.nothing.chi_square
    SCREEN.say(f"refit without any effect: residual over noise {before**0.5:.3g}")
    if not diagnosis.search.scores:
        bends = "the bending of a body explains the gap"
        why = bends if diagnosis.gate.flexible else "no gap is left to explain"
        SCREEN.say(f"{why}: no hypothesis was tested")
        return
    SCREEN.console.print(_hypothesis_table(diagnosis))


def _hypothesis_table(diagnosis: Diagnosis) -> Table:
    """Return a table of effects and places: refitted ones first, then those with a score alone."""
    search = diagnosis.search
    table = Table(title=f"{len(search.scores)} hypotheses, the best of each effect and place")
    table.add_column("hypothesis", no_wrap=True)
    for name in ("score at a 3 % model-error floor [nats]", "residual over noise", "rejected, as"):
        table.add_column(name)
    best_refits: dict[str, Refit] = {}
    for refit in sorted(search.refits, key=lambda refit: refit.cost):
        if refit.hypothesis is not None:
            best_refits.setdefault(refit.hypothesis.site, refit)
    best_scores = {score.hypothesis.site: score for score in reversed(search.scores)}
    sites = dict.fromkeys([*best_refits, *(score.hypothesis.site for score in search.scores)])
    first_refits = {refit.hypothesis.site for refit in search.begun if refit.hypothesis}
    for site in list(sites)[: 2 * _MAX_LISTED_CAUSES]:
        best_refit, score = best_refits.get(site), best_scores.get(site)
        residual, why = "", "not refitted: its score is small"
        words = score.hypothesis.words if score else site
        if best_refit is not None and best_refit.hypothesis is not None:
            words, residual = best_refit.hypothesis.words, f"{best_refit.chi_square**0.5:.3g}"
            why = _rejection_reason(best_refit, diagnosis)
        elif site in first_refits:
            why = "a first refit gained much less than the best"
        table.add_row(words, f"{score.gain:.4g}" if score else "", residual, why)
    return table


def _rejection_reason(refit: Refit, diagnosis: Diagnosis) -> str:
    """Return why a refitted hypothesis was rejected; empty for a present one."""
    if refit.hypothesis and refit.hypothesis.site in {
        hypothesis.site for hypothesis in diagnosis.present
    }:
        return ""
    best = min(fit.cost for fit in (*diagnosis.search.refits, *diagnosis.search.pairs))
    if refit.cost > best:
        return f"{refit.cost - best:.4g} nats worse"
    if diagnosis.judged.word == "none":
        return "its gain is within tolerances and noise"
    return "it does not explain the gap"
