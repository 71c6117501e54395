"""``mbw blind``: scores of the diagnosis on withheld truth, for one machine or random ones."""

import hashlib
import json
import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import typer
from joblib import Parallel, delayed

from diagnosis import load_catalogue
from identification.words import InputError, WorkbenchError
from identification.words.file_access import read_bytes
from mbw.band import check_band
from mbw.blind.case import HASHES, TREES, BlindCase, CaseOutcome, run_case
from mbw.blind.page import GRADES, PAGE, TABLES, render
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import RECORD, OutputFolder, ResultOptions
from truth import TruthError, read_station
from truth.grade import Case, Report, grade, tables, to_json

REQUEST_JSON = "asked.json"
_CASE_FILES = ("cases", "sealed", HASHES)  # what an interrupted test continues from


@dataclass(frozen=True)
class BlindOptions:
    """Options of a blind test.

    Args:
        model: MJCF of a machine, or ``trees`` for random machines.
        cases: number of cases.
        seed: seed of the whole test; it determines all answers.
        jobs: number of cases that run at once.
        outputs: where the test and its grades are written.
        band: band of the verdicts [Hz]; None for the frequency lines with coherence.
    """

    model: str
    cases: int
    seed: int
    jobs: int
    outputs: ResultOptions
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
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.blind.options`` describes them."""
    check_band(band)
    run(BlindOptions(model, cases, seed, jobs, ResultOptions(out, json, overwrite), band))


def run(options: BlindOptions) -> Path:
    """Draw, diagnose and grade all cases; continue an interrupted test with the same options.

    Returns:
        The folder of the test.

    Raises:
        InputError: the model cannot be read, or the folder holds another test.
        WorkbenchError: no case could be drawn; InputError if the model is the reason.
    """
    load_catalogue()  # refuses an invalid effect of another package before anything is drawn
    request = _request(options)
    with options.outputs.open("blind", Path(options.model), "blind", ()) as output:
        out = output.path.absolute()
        _prepare(request, out, overwrite=options.outputs.overwrite)
        drawn, failed = _run(options, out)
        report = _grade(options, output, drawn, failed)
    if options.outputs.json is not None:
        write_json(to_json(report), options.outputs.json)
    if not (SCREEN.quiet or options.outputs.has_json_on_stdout):
        typer.echo(tables(report).rstrip())
    SCREEN.say(_describe_discarded_draws(drawn))
    SCREEN.say(f"grades in {out / GRADES}")
    SCREEN.say(f"pictures in {(out / PAGE).as_uri()}")
    return out


def _run(options: BlindOptions, out: Path) -> tuple[list[BlindCase], list[str]]:
    """Run all cases; return those that were drawn, and sentences on those that failed."""
    model = options.model if options.model == TREES else str(Path(options.model).absolute())
    cases = [
        BlindCase(model, options.seed, number, out, options.band) for number in range(options.cases)
    ]
    failed = [outcome for outcome in _run_cases(cases, options.jobs) if outcome.error]
    for outcome in failed:
        SCREEN.say(f"could not be run: {outcome.error} ({outcome.case.failure})")
    drawn = [case for case in cases if case.sealed.is_file()]
    if not drawn:
        sentence = f"none of {len(cases)} cases could be drawn: {failed[0].error}"
        raise InputError(sentence) if failed[0].is_refused else WorkbenchError(sentence)
    return drawn, [f"could not be run: {outcome.error}" for outcome in failed]


def _grade(
    options: BlindOptions, output: OutputFolder, drawn: list[BlindCase], failed: list[str]
) -> Report:
    """Grade the cases, and write the grades with their page."""
    report = grade([_graded_case(case) for case in drawn])
    page = render(json.loads(to_json(report)), tables(report), Path(options.model).stem, failed)
    with output.write() as place:
        (place / GRADES).write_text(to_json(report) + "\n", encoding="utf-8")
        (place / TABLES).write_text(tables(report), encoding="utf-8")
        (place / PAGE).write_text(page, encoding="utf-8")
    return report


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


def _request(options: BlindOptions) -> dict[str, object]:
    """Return what determines the cases of a test.

    Raises:
        InputError: the model cannot be read.
    """
    band = None if options.band is None else list(options.band)
    return {"model": _fingerprint(options.model), "seed": options.seed, "band": band}


def _prepare(request: dict[str, object], out: Path, *, overwrite: bool) -> None:
    """Write the request into a new folder, or check that an existing folder has the same one."""
    note = out / REQUEST_JSON
    if note.is_file() and not _is_of_another_test(note, request):
        return
    if any(path.name != RECORD for path in out.iterdir()):
        if not overwrite:
            what = "exists and is not the folder of a blind test"
            if note.is_file():
                what = "holds a blind test of another model, seed or band"
            raise InputError(
                f"{out} {what}: name another folder with --out, or start anew with --overwrite"
            )
        for name in _CASE_FILES:
            path = out / name
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    try:
        note.write_text(json.dumps(request) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}): name another") from error


def _is_of_another_test(note: Path, request: dict[str, object]) -> bool:
    try:
        return bool(json.loads(note.read_text("utf-8")) != request)
    except (OSError, ValueError, RecursionError):  # its writing was interrupted: no case exists yet
        return False


def _fingerprint(model: str) -> str:
    """Return the hash of an MJCF and of its meshes; refuse a model that includes other MJCF files.

    Raises:
        InputError: the model cannot be read.
    """
    if model == TREES:
        return TREES
    text = read_bytes(Path(model), f"name an MJCF file, or {TREES!r} for random machines")
    try:
        meshes = read_station(Path(model)).meshes
    except TruthError as error:
        raise InputError(str(error)) from error
    combined = hashlib.sha256(text)
    for mesh in meshes:
        combined.update(hashlib.sha256(mesh.content).digest())
    return combined.hexdigest()
