"""One case of a blind test with the paths of its files, and what came of it."""

from dataclasses import dataclass
from pathlib import Path

from truth import WHOLE_DECK, Choice

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
    """

    model: str
    seed: int
    number: int
    out: Path
    band: tuple[float, float] | None = None
    choice: Choice = WHOLE_DECK
    further: str | None = None

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
