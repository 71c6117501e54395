"""``mbw blind``: scores of the diagnosis on withheld truth, for one machine or random ones."""

import hashlib
import json
import os
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import typer
from joblib import Parallel, delayed

from diagnosis import catalogue
from identification.words import InputError, WorkbenchError
from mbw.band import check_band
from mbw.blind.case import TREES, BlindCase, CaseOutcome, run_case
from mbw.blind.page import render
from mbw.files import check_json_target, write_json
from mbw.messages import SCREEN
from truth import TruthError, read_station
from truth.grade import Case, grade, tables, to_json
from tuning import write_atomically

REQUEST_JSON = "asked.json"
GRADES, TABLES, PAGE = "grades.json", "grades.txt", "blind.html"


@dataclass(frozen=True)
class BlindOptions:
    """Options of a blind test.

    Args:
        model: MJCF of a machine, or ``trees`` for random machines.
        cases: number of cases.
        seed: seed of the whole test; it determines all answers.
        jobs: number of cases that run at once.
        out: folder of the test; None for <model>-blind.
        json: further JSON file of the grades, or ``-`` for stdout; None for none.
        band: band of the verdicts [Hz]; None for the frequency lines with coherence.
    """

    model: str
    cases: int
    seed: int
    jobs: int
    out: Path | None
    json: Path | None = None
    band: tuple[float, float] | None = None


def run_options(  # one for each option
    model: str,
    *,
    cases: int,
    out: Path | None,
    seed: int,
    jobs: int,
    band: tuple[float, float] | None,
    json: Path | None,
) -> None:
    """Run the verb with the values of its options, as ``mbw.blind.options`` describes them."""
    check_band(band)
    run(BlindOptions(model, cases, seed, jobs, out, json, band))


def run(options: BlindOptions) -> Path:
    """Draw, diagnose and grade all cases; continue an interrupted test with the same options.

    Returns:
        The folder of the test.

    Raises:
        InputError: the model cannot be read, or the folder holds another test.
        WorkbenchError: no case could be drawn.
    """
    out = (options.out or Path(f"{Path(options.model).stem}-blind")).absolute()
    if options.json is not None:
        check_json_target(options.json)
    catalogue()  # refuses an invalid effect of another package before anything is drawn
    _prepare(options, out)
    model = options.model if options.model == TREES else str(Path(options.model).absolute())
    cases = [
        BlindCase(model, options.seed, number, out, options.band) for number in range(options.cases)
    ]
    failed = [outcome for outcome in _run_cases(cases, options.jobs) if outcome.error]
    for outcome in failed:
        SCREEN.say(f"could not be run: {outcome.error} ({outcome.case.failure})")
    drawn = [case for case in cases if case.sealed.is_file()]
    if not drawn:
        raise WorkbenchError(f"none of {len(cases)} cases could be drawn: {failed[0].error}")
    report = grade([_graded_case(case) for case in drawn])
    title = f"Blind test: {Path(options.model).stem}"
    page = render(report, title, [f"could not be run: {outcome.error}" for outcome in failed])
    with write_atomically(out) as place:
        (place / GRADES).write_text(to_json(report) + "\n", encoding="utf-8")
        (place / TABLES).write_text(tables(report), encoding="utf-8")
        (place / PAGE).write_text(page, encoding="utf-8")
    if options.json is not None:
        write_json(to_json(report), options.json)
    if not SCREEN.quiet and str(options.json) != "-":
        typer.echo(tables(report).rstrip())
    SCREEN.say(_describe_discarded_draws(drawn))
    SCREEN.say(f"grades in {out / GRADES}")
    SCREEN.say(f"pictures in {(out / PAGE).as_uri()}")
    return out


def _describe_discarded_draws(cases: list[BlindCase]) -> str:
    """Return a sentence on draws that no plausible size of the effect made strong enough."""
    answers = [tomllib.loads(case.sealed.read_text("utf-8")) for case in cases]
    effects = sum(
        len(answer.get("cause", [answer])) for answer in answers if answer["effect"] != "none"
    )
    discarded = sum(answer["drawn"]["discarded"] for answer in answers)
    if not effects:
        return "no effects were drawn"
    return (
        f"{effects} effects were drawn; {discarded} of {discarded + effects} draws "
        f"({discarded / (discarded + effects):.0%}) were discarded: no plausible size of the "
        "effect had the wanted strength"
    )


def _graded_case(case: BlindCase) -> Case:
    """Return the paths of a case's files for the grading."""
    oracle = case.oracle if case.oracle.is_file() else None
    machine = "random trees" if case.model == TREES else ""
    return Case(
        case.name, case.campaign, case.verdict, case.sealed, case.refit, oracle, machine=machine
    )


def _run_cases(cases: list[BlindCase], jobs: int) -> Iterator[CaseOutcome]:
    """Run the cases, several at once, and yield their outcomes."""
    with SCREEN.progress() as progress:
        bar = progress.add_task("cases", total=len(cases))
        outcomes = Parallel(n_jobs=jobs, return_as="generator_unordered")(
            delayed(run_case)(case) for case in cases
        )
        for outcome in outcomes:
            progress.update(bar, advance=1, description=f"case {outcome.case.name}")
            yield outcome


def _prepare(options: BlindOptions, out: Path) -> None:
    """Write the options into a new folder, or check that an existing folder has the same ones."""
    band = None if options.band is None else list(options.band)
    request = {"model": _fingerprint(options.model), "seed": options.seed, "band": band}
    note = out / REQUEST_JSON
    if note.is_file():
        try:
            stored = json.loads(note.read_text("utf-8"))
        except ValueError:  # its writing was interrupted: no case was drawn yet
            stored = request
        if stored != request:
            raise InputError(
                f"{out} holds a blind test of another model, seed or band: name another folder "
                "with --out"
            )
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(
            f"{out} exists and is not the folder of a blind test: name another one with --out"
        )
    try:
        out.mkdir(parents=True, exist_ok=True)
        note.write_text(json.dumps(request) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}): name another") from error


def _fingerprint(model: str) -> str:
    """Return the hash of an MJCF and of its meshes; refuse a model that includes other MJCF files.

    Raises:
        InputError: the model cannot be read.
    """
    if model == TREES:
        return TREES
    try:
        text = Path(model).read_bytes()
        meshes = read_station(Path(model)).meshes
    except OSError as error:
        raise InputError(
            f"{model} cannot be read ({os.strerror(error.errno or 0)}): name an MJCF file, or "
            f"{TREES!r} for random machines"
        ) from error
    except TruthError as error:
        raise InputError(str(error)) from error
    combined = hashlib.sha256(text)
    for mesh in meshes:
        combined.update(hashlib.sha256(mesh.content).digest())
    return combined.hexdigest()
