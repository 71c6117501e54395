"""One case of a blind test: a virtual campaign, its sealed answer and the verdict.

Each step leaves a file, so that an interrupted test can continue. A file that was altered since is
made anew: its hash no longer fits.
"""

import hashlib
import json
import tomllib
import traceback
from dataclasses import dataclass
from pathlib import Path

from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose, read_fault, refit_true_cause
from identification.words import InputError, WorkbenchError
from identification.words.file_access import write_text
from truth import TruthError, draw_case, read_station, write_answer, write_campaign
from tuning import open_session

TREES = "trees"
HASHES = "hashes.txt"  # SHA-256 of every answer, published before its verdict


@dataclass(frozen=True)
class BlindCase:
    """Case of a blind test with the paths of its files.

    Args:
        model: MJCF of the nominal machine, or ``trees`` for a random machine in every case.
        seed: seed of the whole test.
        number: number of the case.
        out: folder of the test.
        band: band of the verdict [Hz]; None for the frequency lines with coherence.
    """

    model: str
    seed: int
    number: int
    out: Path
    band: tuple[float, float] | None = None

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
    def checksum(self) -> Path:
        """File with the hash of the verdict and both residual gaps, written last."""
        return self.folder / "results.sha256"

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
    """

    case: BlindCase
    error: str = ""
    is_refused: bool = False


def run_case(case: BlindCase) -> CaseOutcome:
    """Draw a case and diagnose it; skip steps whose files exist.

    An exception becomes the case's failure, so that the other cases continue.

    Raises:
        InputError: a file of the case cannot be written, for example because the disk is full.
    """
    try:
        with threadpool_limits(1):
            answer_hash = _draw(case)
            _publish(case.out / HASHES, f"{case.name} {answer_hash}")
            _judge(case)
    except OSError as error:
        raise InputError(
            f"{error.filename or case.folder} cannot be read or written ({error.strerror}): make "
            "room on the disk, or name another folder with --out"
        ) from error
    except Exception as error:  # of any kind: the other cases continue
        case.folder.mkdir(parents=True, exist_ok=True)
        write_text(case.failure, traceback.format_exc())
        message = " ".join(str(error).split()) or type(error).__name__
        is_refused = isinstance(error, WorkbenchError | TruthError)
        return CaseOutcome(case, f"seed {case.seed}, case {case.number}: {message}", is_refused)
    case.failure.unlink(missing_ok=True)
    return CaseOutcome(case)


def _draw(case: BlindCase) -> str:
    """Write campaign and sealed answer; return the hash of the answer."""
    hash_file = case.folder / "sha256.txt"
    if hash_file.is_file() and hash_file.read_bytes().strip() == _hash_files(case.sealed).encode():
        return _hash_files(case.sealed)
    station = None if case.model == TREES else read_station(Path(case.model))
    campaign = draw_case(station, case.seed, case.number).campaign
    # The hash comes last: without it the case is drawn again, to the same bytes.
    write_campaign(campaign, case.campaign, overwrite=True, sealed=True)
    write_answer(campaign, case.sealed)
    _write(hash_file, campaign.answer_hash)
    return campaign.answer_hash


def _publish(path: Path, line: str) -> None:
    """Append a new line in one write, so that lines of several processes do not mix."""
    lines = path.read_text("utf-8", "replace").splitlines() if path.is_file() else []
    if line not in lines:
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def _judge(case: BlindCase) -> None:
    """Write the verdict, and then the residual gaps of refits without and with the true effect."""
    results = case.verdict, case.refit, case.oracle
    if (
        case.checksum.is_file()
        and case.checksum.read_bytes().strip() == _hash_files(*results).encode()
    ):
        return
    case.oracle.unlink(missing_ok=True)
    diagnosis = diagnose(open_session(case.campaign, case.band))
    _write(case.verdict, build_verdict(diagnosis).model_dump_json(indent=1))
    true_cause = read_fault(tomllib.loads(case.sealed.read_text("utf-8")))
    bound = None if true_cause is None else refit_true_cause(diagnosis, true_cause)
    if bound is not None:
        _write(case.oracle, json.dumps({"excess": bound.gap.excess}, allow_nan=False))
    _write(case.refit, json.dumps({"excess": diagnosis.retuned.gap.excess}, allow_nan=False))
    _write(case.checksum, _hash_files(*results))


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
