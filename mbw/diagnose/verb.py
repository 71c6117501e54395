"""``mbw diagnose``: what the model lacks, where, and how far the gap shrinks with it."""

from pathlib import Path

from rich.progress import Progress
from rich.table import Table

from diagnosis import Diagnosis, Verdict, diagnose
from diagnosis.effects import check_others
from diagnosis.refits.refitting import Refit
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
from mbw.diagnose.pulled_tolerance import pulled_sentence
from mbw.diagnose.result import gather, unfinished
from mbw.diagnose.sentences import (
    cause_parameters,
    closed_words,
    noise_sentences,
    shared_sentences,
    twin_sentences,
    untested_sentences,
)
from mbw.files import check_json, check_names, write_json
from mbw.messages import SCREEN, one_interrupt
from mbw.remarks import not_held
from tuning import files_of, open_session

_FEW = 8


def run(  # one for each option
    campaign: Path,
    *,
    out: Path | None,
    json: Path | None = None,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
    explain: bool = False,
) -> Path:
    """Diagnose, write the verdict and its page, say it.

    Args:
        campaign: its folder.
        out: folder of the result; <campaign>-diagnosed if None.
        json: a file beside it, or ``-``.
        band: [Hz]; the lines with coherence if None.
        jobs: processes; the verdict does not depend on it.
        explain: print what was tried and why the rest fell.

    Returns:
        The folder of the result.
    """
    session = open_session(campaign, band)
    check_others(session)
    folder = out or Path(f"{session.campaign.name}-diagnosed")
    check_names(folder, NAMES)
    if json is not None:
        check_json(json)
    for text in session.campaign.remarks:
        SCREEN.say(text)
    with SCREEN.progress() as progress, one_interrupt() as ends:
        found = diagnose(session, jobs=jobs, tell=_Teller(progress).tell)
        ends()
    for text in found.session.campaign.remarks[len(session.campaign.remarks) :]:
        SCREEN.say(text)
    with files_of(folder) as place:
        result = gather(found, write_augmented(found, place / AUGMENTED))
        write_files(result, place)
        (place / PAGE).write_text(render(result), encoding="utf-8")
    if json is not None:
        write_json(result.verdict.model_dump_json(indent=1), json)
    if explain:
        _explain(found)
    _say(result.verdict, found)
    SCREEN.say(f"verdict in {folder / VERDICT}")
    what = ", with what it lacked" if found.after else ""
    SCREEN.say(f"tuned model{what}, in {folder / AUGMENTED}")
    if lacking := not_held(result.shown.not_held_by_mjcf, SHOWN):
        SCREEN.say(f"  {lacking}")
    SCREEN.say(f"report in {(folder / PAGE).absolute().as_uri()}")
    return folder


class _Teller:
    """Shows which step is under way."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._bar = progress.add_task("diagnosis", total=None)  # what is found decides

    def tell(self, text: str) -> None:
        """Another step begins."""
        self._progress.update(self._bar, advance=1, description=text)


def _say(verdict: Verdict, found: Diagnosis) -> None:
    """The verdict in a few lines."""
    named = found.session.campaign.name
    gap = verdict.gap
    words = {
        "none": "nothing is missing beyond tolerances and noise",
        "unexplained": "something is missing that no effect of the catalogue explains",
        "several": "several things are missing",
        "explained": "one thing is missing",
    }
    SCREEN.say(f"\n{named}: {words[verdict.verdict]}")
    for name, at in (("as drawn", gap.as_drawn), ("re-tuned", gap.retuned), ("after", gap.after)):
        if at.excess is not None:
            SCREEN.say(f"  {name}: error {at.error:.3g}, excess {at.excess:.3g}")
    if gap.closed is not None:
        SCREEN.say(f"  {closed_words(gap.closed, gap.interval.closed)}")
    for row in verdict.causes[:_FEW]:
        dof = f" {row.dof}" if row.dof else ""
        sizes = cause_parameters(row)
        sizes = f": {sizes}" if sizes else ""
        SCREEN.say(f"  {row.probability:.0%} {row.effect} at {row.location}{dof}{sizes}")
    if verdict.verdict == "unexplained" and verdict.where:
        places = ", ".join(
            f"{one.location} {one.share:.0%}" for one in verdict.where[:3] if one.share is not None
        )
        SCREEN.say(f"  where: {places}" if places else "  where: not to be told")
    _say_more(verdict, found)


def _say_more(verdict: Verdict, found: Diagnosis) -> None:
    """What was believed, what sensors say, what these data cannot, and what to do next."""
    if pulled := pulled_sentence(verdict, found):
        SCREEN.say(f"  {pulled}")
    for text in unfinished(found):
        SCREEN.say(f"  {text}")
    for check in found.gate.flexible:
        SCREEN.say(f"  {check.words}")
    for place in found.gate.unknown:
        SCREEN.say(f"  {place} is wrong by no known fault, and was left out")
    for text in (*shared_sentences(found.evidence), *noise_sentences(found.evidence)):
        SCREEN.say(f"  {text}")
    levels = len({test.condition.level_n for test in found.session.campaign.tests})
    for text in (*twin_sentences(verdict), *untested_sentences(verdict, levels)):
        SCREEN.say(f"  {text}")
    if verdict.next_experiment:
        SCREEN.say(f"  next: {verdict.next_experiment}")


def _explain(found: Diagnosis) -> None:
    """The funnel: gates, places, candidates, refits, and why the rest fell."""
    for check in found.gate.checks:
        SCREEN.say(check.words)
    before = found.nothing.chi_square
    SCREEN.say(f"refit without any effect: residual over noise {before**0.5:.3g}")
    if not found.search.scores:
        bends = "what a body's bending drives is no gap of its own"
        why = bends if found.gate.flexible else "nothing is left to explain"
        SCREEN.say(f"{why}: no hypothesis was asked")
        return
    SCREEN.console.print(_tried(found))


def _tried(found: Diagnosis) -> Table:
    """Effects and places: those that were refitted, the best first, and then those that scored."""
    search = found.search
    table = Table(title=f"{len(search.scores)} hypotheses, the best of each effect and place")
    table.add_column("hypothesis", no_wrap=True)
    for name in ("gain at 3 % [nats]", "residual over noise", "why it fell"):
        table.add_column(name)
    ended: dict[str, Refit] = {}
    for made in sorted(search.refits, key=lambda one: one.cost):
        if made.hypothesis is not None:
            ended.setdefault(made.hypothesis.site, made)
    scored = {one.hypothesis.site: one for one in reversed(search.scores)}
    best_first = dict.fromkeys([*ended, *(one.hypothesis.site for one in search.scores)])
    begun = {one.hypothesis.site for one in search.begun if one.hypothesis}
    for site in list(best_first)[: 2 * _FEW]:
        refit, score = ended.get(site), scored.get(site)
        left, why = "", "not refitted: its gain is small"
        words = score.hypothesis.words if score else site
        if refit is not None and refit.hypothesis is not None:
            words, left = refit.hypothesis.words, f"{refit.chi_square**0.5:.3g}"
            why = _why(refit, found)
        elif site in begun:
            why = "a first refit gained much less than the best"
        table.add_row(words, f"{score.gain:.4g}" if score else "", left, why)
    return table


def _why(refit: Refit, found: Diagnosis) -> str:
    """Why a hypothesis fell that was refitted; empty of what is there."""
    if refit.hypothesis and refit.hypothesis.site in {one.site for one in found.present}:
        return ""
    best = min(one.cost for one in (*found.search.refits, *found.search.pairs))
    if refit.cost > best:
        return f"{refit.cost - best:.4g} nats worse"
    if found.judged.word == "none":
        return "what it gains is within tolerances and noise"
    return "it does not explain the gap"
