"""One case of a blind test: a virtual campaign, its sealed answer and the verdict.

Each step leaves a file, so that an interrupted test can continue. A file that was altered since is
made anew: its hash no longer fits.

One case of a blind test with the paths of its files, and what came of it.
"""

import hashlib
import json
import os
import platform
import tomllib
import traceback
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose, hash_inputs, read_fault, refit_true_cause
from identification.words import InputError, WorkbenchError
from identification.words.file_access import write_text
from mbmodel import Reading, read_as
from mbw.blind.user_test import is_campaign, read_test, read_user_test
from truth import (
    WHOLE_DECK,
    Choice,
    DrawnCase,
    TruthError,
    draw_case,
    find_further_test,
    read_station,
    write_answer,
    write_campaign,
)
from tuning import Checkpoint, open_session

TREES = "trees"
REQUEST_JSON = "asked.json"
HASHES = "hashes.txt"  # SHA-256 of every answer, published before its verdict


@dataclass(frozen=True)
class BlindCase:
    """Case of a blind test with the paths of its files.

    Args:
        model: MJCF of the nominal machine, ``trees`` for a random machine in every case, or the
            user's campaign, whose test is repeated.
        seed: seed of the whole test.
        number: number of the case.
        out: folder of the test.
        band: band of the verdict [Hz]; None for the frequency lines with coherence.
        choice: effects, places and sizes that are drawn.
        further: name of the further test that is added to the test as it is; empty for none; None
            for a test that is drawn, or the user's own.
        without: kinds that are left out of models, such as ``gravity``.
    """

    model: str
    seed: int
    number: int
    out: Path
    band: tuple[float, float] | None = None
    choice: Choice = WHOLE_DECK
    further: str | None = None
    without: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the case, such as 0007."""
        return f"{self.number:04d}"

    @property
    def folder(self) -> Path:
        """Folder of campaign and verdict."""
        return self.out / "cases" / self.name

    @property
    def campaign(self) -> Path:
        """Folder of the campaign."""
        return self.folder / "campaign"

    @property
    def verdict(self) -> Path:
        """File of the verdict."""
        return self.folder / "verdict.json"

    @property
    def refit(self) -> Path:
        """File of the residual gap of a refit without the effect, written after the verdict."""
        return self.folder / "refit.json"

    @property
    def oracle(self) -> Path:
        """File of the residual gap of a refit with the true effect, if there is one."""
        return self.folder / "oracle.json"

    @property
    def sealed(self) -> Path:
        """File of the answer, outside the folders that the diagnosis reads."""
        return self.out / "sealed" / f"{self.name}.toml"

    @property
    def results(self) -> tuple[Path, ...]:
        """Files of verdict and residual gaps."""
        return self.verdict, self.refit, self.oracle

    @property
    def answer_hash(self) -> Path:
        """File with the hash of the answer, written once the case is drawn."""
        return self.folder / "sha256.txt"

    @property
    def checksum(self) -> Path:
        """File with the hash of the verdict and both residual gaps, written last."""
        return self.folder / "results.sha256"

    @property
    def checkpoint(self) -> Path:
        """File of the finished refits, while the case is diagnosed."""
        return self.folder / "diagnose.checkpoint.json"

    @property
    def worker_note(self) -> Path:
        """File that names the worker, while the case is run."""
        return self.folder / "worker.txt"

    @property
    def failure(self) -> Path:
        """File with the traceback of a failed case."""
        return self.folder / "failed.txt"


@dataclass(frozen=True)
class CaseOutcome:
    """Outcome of a case.

    Args:
        case: the case.
        error: error that stopped it; empty if none did.
        is_refused: whether that error is a sentence on the model, and not a fault of the program.
        lost_workers: workers that ended before they had finished the case.
    """

    case: BlindCase
    error: str = ""
    is_refused: bool = False
    lost_workers: tuple[str, ...] = ()


def run_case(case: BlindCase) -> CaseOutcome:
    """Draw a case and diagnose it; skip steps whose files exist.

    An exception becomes the case's failure, so that the other cases continue.

    Raises:
        InputError: the worker does not see the folder of the test, or a file of the case cannot be
            written, for example because the disk is full.
    """
    if not (case.out / REQUEST_JSON).is_file():
        raise InputError(
            f"the worker on {platform.node()} does not see {case.out}: name a folder with --out "
            "that all workers share under one path, or run shards with --shard"
        )
    try:
        lost_workers = _note_worker(case)
        outcome = replace(_run_steps(case), lost_workers=lost_workers)
        case.worker_note.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"{error.filename or case.folder} cannot be read or written ({error.strerror}): make "
            "room on the disk, or name another folder with --out"
        ) from error
    return outcome


def _note_worker(case: BlindCase) -> tuple[str, ...]:
    """Note who runs the case; return the workers of this run that began it and did not end it."""
    case.folder.mkdir(parents=True, exist_ok=True)
    lines = case.worker_note.read_text("utf-8").splitlines() if case.worker_note.is_file() else []
    worker = f"{platform.node()}, process {os.getpid()}"
    _write(case.worker_note, "\n".join([*lines, worker]))
    return tuple(lines)


def _run_steps(case: BlindCase) -> CaseOutcome:
    """Draw the case, publish the hash of its answer, and diagnose it."""
    try:
        with threadpool_limits(1), read_as(Reading(case.without)):
            answer_hash = _draw(case)
            _publish(case.out / HASHES, f"{case.name} {answer_hash}")
            _judge(case)
    except OSError:
        raise
    except Exception as error:  # of any kind: the other cases continue
        write_text(case.failure, traceback.format_exc())
        message = " ".join(str(error).split()) or type(error).__name__
        is_refused = isinstance(error, WorkbenchError | TruthError)
        return CaseOutcome(case, f"seed {case.seed}, case {case.number}: {message}", is_refused)
    case.failure.unlink(missing_ok=True)
    return CaseOutcome(case)


def is_finished(case: BlindCase) -> bool:
    """Return whether a case has its verdict or a failure, and no file was altered since."""
    return case.failure.is_file() or (_is_drawn(case) and _is_judged(case))


def _is_drawn(case: BlindCase) -> bool:
    """Return whether the sealed answer is the one whose hash was kept."""
    kept = case.answer_hash.read_bytes().strip() if case.answer_hash.is_file() else b""
    return kept == _hash_files(case.sealed).encode()


def _is_judged(case: BlindCase) -> bool:
    """Return whether the verdict and both residual gaps are those whose hash was kept."""
    kept = case.checksum.read_bytes().strip() if case.checksum.is_file() else b""
    return kept == _hash_files(*case.results).encode()


def _draw(case: BlindCase) -> str:
    """Write campaign and sealed answer; return the hash of the answer."""
    if _is_drawn(case):
        return _hash_files(case.sealed)
    campaign = _draw_case(case).campaign
    # The hash comes last: without it the case is drawn again, to the same bytes.
    write_campaign(campaign, case.campaign, overwrite=True, sealed=True)
    write_answer(campaign, case.sealed)
    _write(case.answer_hash, campaign.answer_hash)
    return campaign.answer_hash


def _draw_case(case: BlindCase) -> DrawnCase:
    """Draw a random machine, one about a model, or one about the model of the user's campaign."""
    if case.model == TREES:
        return draw_case(None, case.seed, case.number, case.choice)
    if case.further is not None:
        test = read_test(Path(case.model), case.band)
        if case.further:
            protocol = test.repeated.protocol
            test = test.with_protocol(
                find_further_test(test.station, protocol, case.further).protocol
            )
        return draw_case(test.station, case.seed, case.number, case.choice, test.repeated)
    if is_campaign(Path(case.model)):
        test = read_user_test(Path(case.model), case.band)
        return draw_case(test.station, case.seed, case.number, case.choice, test.repeated)
    station = read_station(Path(case.model), case.without)
    return draw_case(station, case.seed, case.number, case.choice)


def _publish(path: Path, line: str) -> None:
    """Append a new line in one write, so that lines of several processes do not mix."""
    lines = path.read_text("utf-8", "replace").splitlines() if path.is_file() else []
    if line not in lines:
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def _judge(case: BlindCase) -> None:
    """Write the verdict, and then the residual gaps of refits without and with the true effect."""
    if _is_judged(case):
        return
    case.oracle.unlink(missing_ok=True)
    session = open_session(case.campaign, case.band)
    checkpoint = _open_checkpoint(case.checkpoint, hash_inputs(session))
    diagnosis = diagnose(session, checkpoint=checkpoint)
    _write(case.verdict, build_verdict(diagnosis).model_dump_json(indent=1))
    true_cause = read_fault(tomllib.loads(case.sealed.read_text("utf-8")))
    bound = None if true_cause is None else refit_true_cause(diagnosis, true_cause)
    if bound is not None:
        _write(case.oracle, json.dumps({"excess": bound.gap.excess}, allow_nan=False))
    _write(case.refit, json.dumps({"excess": diagnosis.retuned.gap.excess}, allow_nan=False))
    _write(case.checksum, _hash_files(*case.results))
    checkpoint.close()


def _open_checkpoint(file: Path, key: str) -> Checkpoint:
    """Open the finished refits of an interrupted case; those of other inputs are dropped."""
    try:
        return Checkpoint(file, key, resume=True)
    except InputError:
        return Checkpoint(file, key)


def _hash_files(*paths: Path) -> str:
    """Return the SHA-256 of the contents of files; one that is missing counts as empty."""
    combined = hashlib.sha256()
    for path in paths:
        content = path.read_bytes() if path.is_file() else b""
        combined.update(content if len(paths) == 1 else hashlib.sha256(content).digest())
    return combined.hexdigest()


def _write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    write_text(path, text + "\n")
