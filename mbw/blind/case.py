"""One case of a blind test: drawn, sealed, judged. Each step leaves its file, so it can go on."""

import json
import tomllib
import traceback
from dataclasses import dataclass
from pathlib import Path

from threadpoolctl import threadpool_limits

from diagnosis import diagnose, oracle, told_of, verdict_of
from truth import draw_case, read_station, write_answer, write_campaign
from tuning import open_session

TREES = "trees"
HASHES = "hashes.txt"  # of the answers, each before its verdict


@dataclass(frozen=True)
class Task:
    """A case to be played.

    Args:
        model: MJCF of the nominal machine, or ``trees``: a random one for every case.
        seed: of the whole test.
        number: of the case.
        out: folder of the test.
        band: of the verdict [Hz]; the lines with coherence if None.
    """

    model: str
    seed: int
    number: int
    out: Path
    band: tuple[float, float] | None = None

    @property
    def name(self) -> str:
        """Such as 0007."""
        return f"{self.number:04d}"

    @property
    def folder(self) -> Path:
        """Its campaign and what was said of it."""
        return self.out / "cases" / self.name

    @property
    def campaign(self) -> Path:
        """The campaign's folder."""
        return self.folder / "campaign"

    @property
    def verdict(self) -> Path:
        """What the diagnosis said."""
        return self.folder / "verdict.json"

    @property
    def refit(self) -> Path:
        """What a refit without knowledge of the effect leaves, written after the verdict."""
        return self.folder / "refit.json"

    @property
    def oracle(self) -> Path:
        """What a refit that knows the effect leaves, where there is one."""
        return self.folder / "oracle.json"

    @property
    def sealed(self) -> Path:
        """The answer, out of the diagnosis's way."""
        return self.out / "sealed" / f"{self.name}.toml"

    @property
    def failure(self) -> Path:
        """Why the case could not be played, if it could not."""
        return self.folder / "failed.txt"


@dataclass(frozen=True)
class Played:
    """How a case went.

    Args:
        task: which.
        error: what stopped it; empty if nothing did.
    """

    task: Task
    error: str = ""


def play(task: Task) -> Played:
    """Draw a case, unless that is done, and judge it, unless that is done.

    An exception becomes the case's failure: the others go on.
    """
    try:
        with threadpool_limits(1):
            answer = _draw(task)
            _publish(task.out / HASHES, f"{task.name} {answer}")
            _judge(task)
    except Exception as error:  # whatever it is, the other cases go on
        task.folder.mkdir(parents=True, exist_ok=True)
        task.failure.write_text(traceback.format_exc(), encoding="utf-8")
        said = " ".join(str(error).split()) or type(error).__name__
        return Played(task, f"seed {task.seed}, case {task.number}: {said}")
    task.failure.unlink(missing_ok=True)
    return Played(task)


def _draw(task: Task) -> str:
    """Write campaign and sealed answer; the answer's hash."""
    hash_file = task.folder / "sha256.txt"
    if hash_file.is_file() and task.sealed.is_file():
        return hash_file.read_text("utf-8").strip()
    station = None if task.model == TREES else read_station(Path(task.model))
    campaign = draw_case(station, task.seed, task.number).campaign
    # The hash comes last: without it the case is drawn again, to the same bytes.
    write_campaign(campaign, task.campaign, overwrite=True, sealed=True)
    write_answer(campaign, task.sealed)
    _write(hash_file, campaign.answer_hash)
    return campaign.answer_hash


def _publish(path: Path, line: str) -> None:
    """Append a line that is not there yet, in one write, so that no other process's is torn."""
    known = path.read_text("utf-8").splitlines() if path.is_file() else []
    if line not in known:
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def _judge(task: Task) -> None:
    """Write the verdict, and then the figures of a refit."""
    if task.verdict.is_file() and task.refit.is_file():
        return
    found = diagnose(open_session(task.campaign, task.band))
    _write(task.verdict, verdict_of(found).model_dump_json(indent=1))
    told = told_of(tomllib.loads(task.sealed.read_text("utf-8")))
    known = None if told is None else oracle(found, told)
    if known is not None:
        _write(task.oracle, json.dumps({"excess": known.gap.excess}, allow_nan=False))
    _write(task.refit, json.dumps({"excess": found.retuned.gap.excess}, allow_nan=False))


def _write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    new = path.with_name(path.name + ".new")
    new.write_text(text + "\n", encoding="utf-8")
    new.replace(path)
