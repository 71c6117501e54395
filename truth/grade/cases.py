"""The files of a case, read once: answer, verdict, and the command's own refits.

A verdict that is missing or malformed is a failure of its case. An answer that cannot be read is
not the verdict's fault: such a case is named and not graded.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from truth.errors import TruthError
from truth.grade.answer import Truth, read_answer
from truth.grade.json_reading import number, read_json, table
from truth.grade.marks import Excess
from truth.grade.read_verdict import read_verdict
from truth.grade.verdict import NOTHING_SAID, StatedVerdict


@dataclass(frozen=True)
class CaseFiles:
    """Where the files of a case are.

    Args:
        name: by which it is reported; given once.
        campaign: folder with ``campaign.toml``.
        verdict: JSON of ``mbw diagnose``; a missing file is a failure.
        answer: the sealed TOML.
        refit: JSON with ``excess``, held out, of a refit that knows nothing of the effect; or None.
        oracle: the same of one that knows it; or None.
        machine: by which it is grouped; empty: as the answer says.
        tags: further groups; what the answer says of its drawing comes beside.
    """

    name: str
    campaign: Path
    verdict: Path
    answer: Path
    refit: Path | None = None
    oracle: Path | None = None
    machine: str = ""
    tags: tuple[str, ...] = ()


@dataclass(frozen=True)
class Read:
    """A case as read.

    Args:
        case: its files.
        truth: what its machine has.
        verdict: what is said; ``NOTHING_SAID`` after a failure.
        failure: why there is no verdict; empty if there is one.
        excess: of the refits.
        remarks: what of the refits could not be read.
    """

    case: CaseFiles
    truth: Truth
    verdict: StatedVerdict
    failure: str
    excess: Excess
    remarks: tuple[str, ...]

    @property
    def machine(self) -> str:
        """Name of the machine's group."""
        return self.case.machine or self.truth.machine or "unnamed"

    @property
    def tags(self) -> tuple[str, ...]:
        """All tags, each once."""
        return tuple(dict.fromkeys((*self.case.tags, *self.truth.tags)))


def read_cases(cases: Sequence[CaseFiles]) -> tuple[tuple[Read, ...], dict[str, str]]:
    """Read all cases.

    Returns:
        Those that can be graded, and of the others the reason by name.

    Raises:
        TruthError: a name is given twice.
    """
    names = [case.name for case in cases]
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise TruthError(f"cases: {', '.join(twice)} given twice; give each case its own name")
    read: list[Read] = []
    ungraded: dict[str, str] = {}
    for case in cases:
        try:
            truth = read_answer(case.answer)
        except TruthError as error:
            ungraded[case.name] = str(error)
            continue
        verdict, failure = NOTHING_SAID, ""
        try:
            verdict = read_verdict(case.verdict)
        except TruthError as error:
            failure = str(error)
        refit, oracle, remarks = _excess(case)
        read.append(Read(case, truth, verdict, failure, Excess(refit, oracle), remarks))
    return tuple(read), ungraded


def _excess(case: CaseFiles) -> tuple[float | None, float | None, tuple[str, ...]]:
    excesses: list[float | None] = []
    remarks = []
    for path in (case.refit, case.oracle):
        value = None
        if path is not None:
            try:
                given = table(read_json(path), path.name, "excess")
                value = number(given["excess"], f"{path.name}: excess", 0.0)
            except TruthError as error:
                remarks.append(str(error))
        excesses.append(value)
    return excesses[0], excesses[1], tuple(remarks)
