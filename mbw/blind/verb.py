"""``mbw blind``: the diagnosis's record on withheld truth, for one machine or for random ones."""

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
from mbw.blind.case import TREES, Played, Task, play
from mbw.blind.page import render
from mbw.files import check_json, write_json
from mbw.messages import SCREEN
from truth import TruthError, read_station
from truth.grade import Case, grade, tables, to_json
from tuning import files_of

ASKED = "asked.json"
GRADES, TABLES, PAGE = "grades.json", "grades.txt", "blind.html"


@dataclass(frozen=True)
class Wish:
    """What is asked.

    Args:
        model: MJCF, or ``trees``.
        cases: how many.
        seed: of the whole test; who knows it knows the answers.
        jobs: cases at a time.
        out: folder; <model>-blind if None.
        json: where the grades go beside it, or ``-``.
        band: of the verdicts [Hz]; the lines with coherence if None.
    """

    model: str
    cases: int
    seed: int
    jobs: int
    out: Path | None
    json: Path | None = None
    band: tuple[float, float] | None = None


def run(wish: Wish) -> Path:
    """Draw, judge and grade; go on where an interrupted test of the same wish stopped.

    Returns:
        The folder of the test.

    Raises:
        InputError: no such model, or the folder holds another test.
    """
    out = (wish.out or Path(f"{Path(wish.model).stem}-blind")).absolute()
    if wish.json is not None:
        check_json(wish.json)
    catalogue()  # an effect of another package that is none is refused before anything is drawn
    _prepare(wish, out)
    model = wish.model if wish.model == TREES else str(Path(wish.model).absolute())
    tasks = [Task(model, wish.seed, number, out, wish.band) for number in range(wish.cases)]
    failed = [played for played in _played(tasks, wish.jobs) if played.error]
    for played in failed:
        SCREEN.say(f"could not be played: {played.error} ({played.task.failure})")
    drawn = [task for task in tasks if task.sealed.is_file()]
    if not drawn:
        raise WorkbenchError(f"none of {len(tasks)} cases could be drawn: {failed[0].error}")
    report = grade([_case(task) for task in drawn])
    title = f"Blind test: {Path(wish.model).stem}"
    page = render(report, title, [f"could not be played: {one.error}" for one in failed])
    with files_of(out) as place:
        (place / GRADES).write_text(to_json(report) + "\n", encoding="utf-8")
        (place / TABLES).write_text(tables(report), encoding="utf-8")
        (place / PAGE).write_text(page, encoding="utf-8")
    if wish.json is not None:
        write_json(to_json(report), wish.json)
    if not SCREEN.quiet and str(wish.json) != "-":
        typer.echo(tables(report).rstrip())
    SCREEN.say(_discarded(drawn))
    SCREEN.say(f"grades in {out / GRADES}")
    SCREEN.say(f"pictures in {(out / PAGE).as_uri()}")
    return out


def _discarded(tasks: list[Task]) -> str:
    """How many draws of effects were thrown away, since no believable size gave the ratio."""
    answers = [tomllib.loads(task.sealed.read_text("utf-8")) for task in tasks]
    effects = sum(len(one.get("cause", [one])) for one in answers if one["effect"] != "none")
    thrown = sum(one["drawn"]["discarded"] for one in answers)
    if not effects:
        return "no effects were drawn"
    return (
        f"{effects} effects were drawn; {thrown} of {thrown + effects} draws "
        f"({thrown / (thrown + effects):.0%}) were discarded, as strong as was wanted nowhere"
    )


def _case(task: Task) -> Case:
    """Where the judge finds a case's files."""
    oracle = task.oracle if task.oracle.is_file() else None
    machine = "random trees" if task.model == TREES else ""
    return Case(
        task.name, task.campaign, task.verdict, task.sealed, task.refit, oracle, machine=machine
    )


def _played(tasks: list[Task], jobs: int) -> Iterator[Played]:
    """Play the cases, several at a time."""
    with SCREEN.progress() as progress:
        bar = progress.add_task("cases", total=len(tasks))
        work = Parallel(n_jobs=jobs, return_as="generator_unordered")(
            delayed(play)(task) for task in tasks
        )
        for done in work:
            progress.update(bar, advance=1, description=f"case {done.task.name}")
            yield done


def _prepare(wish: Wish, out: Path) -> None:
    """Keep what was asked, or check that a folder that is there was asked the same."""
    band = None if wish.band is None else list(wish.band)
    asked = {"model": _fingerprint(wish.model), "seed": wish.seed, "band": band}
    note = out / ASKED
    if note.is_file():
        try:
            known = json.loads(note.read_text("utf-8"))
        except ValueError:  # it was cut off while it was written: nothing was drawn yet
            known = asked
        if known != asked:
            raise InputError(
                f"{out} holds a blind test of another model, seed or band: name another folder "
                "with --out"
            )
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} holds something else: name another folder with --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        note.write_text(json.dumps(asked) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}): name another") from error


def _fingerprint(model: str) -> str:
    """Hash an MJCF and the meshes that it names; a model that includes files is refused."""
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
    whole = hashlib.sha256(text)
    for mesh in meshes:
        whole.update(hashlib.sha256(mesh.content).digest())
    return whole.hexdigest()
