"""Cases of a blind test on workers: longest first, and each kept as soon as it is finished.

Every case has its own seed and its own folder, so that its numbers depend neither on the workers
nor on the order. A case whose worker dies continues on another worker from its finished refits.
"""

from collections.abc import Iterator, Sequence
from itertools import islice

from identification.words import UsageError
from identification.words.file_access import write_text
from mbw.blind.case import HASHES, BlindCase, CaseOutcome, run_case
from mbw.messages import SCREEN
from truth import Card, deal_cards
from tuning.workers.executors import Workers, use_cluster, use_executor, use_processes
from tuning.workers.independent_calls import Call, WorkerDiedError, run_calls

# Median core seconds of a case, from 325 cases of the station (seeds 220000 and up) and 304 of the
# catalogue (seeds 290000 and up). Only their order counts here.
_KIND_SECONDS = {
    "nothing": 11, "mistuned": 12, "one": 40, "twin": 40, "two": 86, "outside": 87, "many": 120,
}  # fmt: skip
_NONLINEAR_SECONDS = 140  # integrated in time, at several levels
_NONLINEAR = {"backlash", "friction", "hardening"}


def choose_workers(jobs: int, cluster: str | None, executor: str | None) -> Workers:
    """Return the workers that the options name.

    Args:
        jobs: number of processes; used without the other two.
        cluster: address of a Dask scheduler.
        executor: ``package:factory`` of an executor.

    Raises:
        UsageError: both are named, or one of them cannot be loaded.
    """
    if cluster is not None and executor is not None:
        raise UsageError("--cluster and --executor exclude each other: name one of them")
    if cluster is not None:
        return use_cluster(cluster)
    return use_processes(jobs) if executor is None else use_executor(executor)


def run_cases(cases: Sequence[BlindCase], workers: Workers) -> list[CaseOutcome]:
    """Run all cases and return their outcomes, in the order of the cases.

    Messages name each case that was done again and each case that failed.

    Args:
        cases: cases of one test.

    Raises:
        InputError: a case cannot be written, or a worker does not see its folder.
    """
    for case in cases:
        case.worker_note.unlink(missing_ok=True)  # of an earlier run
    outcomes = {}
    with SCREEN.progress() as progress:
        bar = progress.add_task("cases", total=len(cases))
        for outcome in _run(sort_longest_first(cases), workers):
            outcomes[outcome.case.number] = outcome
            progress.update(bar, advance=1, description=f"case {outcome.case.name}")
            if outcome.lost_workers:
                SCREEN.say(
                    f"case {outcome.case.name} was done again: it was not finished when its "
                    f"worker ended ({', '.join(outcome.lost_workers)})"
                )
            if outcome.error:
                SCREEN.say(f"could not be run: {outcome.error} ({outcome.case.failure})")
    write_hashes(cases)
    return [outcomes[case.number] for case in cases]


def sort_longest_first(cases: Sequence[BlindCase]) -> list[BlindCase]:
    """Return the cases by falling expected duration: no worker begins a long case at the end."""
    if not cases:
        return []
    last = max(case.number for case in cases)
    cards = list(islice(deal_cards(cases[0].seed, cases[0].choice), last + 1))
    return sorted(cases, key=lambda case: (-_expect_seconds(cards[case.number]), case.number))


def _expect_seconds(card: Card) -> float:
    """Return roughly how many core seconds a case takes, relative to others of its test."""
    is_nonlinear = not _NONLINEAR.isdisjoint(card.names)
    return _KIND_SECONDS[card.kind] + (_NONLINEAR_SECONDS if is_nonlinear else 0)


def write_hashes(cases: Sequence[BlindCase]) -> None:
    """Write the published hashes in the order of their cases.

    Workers on several computers append to that file, and a shared file system may lose a line.
    """
    published = cases[0].out / HASHES
    lines = set(published.read_text("utf-8").splitlines()) if published.is_file() else set()
    for case in cases:
        if case.answer_hash.is_file():
            lines.add(f"{case.name} {case.answer_hash.read_text('utf-8').strip()}")
    write_text(published, "".join(f"{line}\n" for line in sorted(lines)))


def _run(cases: Sequence[BlindCase], workers: Workers) -> Iterator[CaseOutcome]:
    calls: list[Call] = [(run_case, (case,)) for case in cases]
    for result in run_calls(calls, workers):
        case = cases[result.index]
        if isinstance(result.error, WorkerDiedError):
            case.folder.mkdir(parents=True, exist_ok=True)
            write_text(case.failure, f"{WorkerDiedError.__name__}: {result.error}\n")
            yield CaseOutcome(case, f"seed {case.seed}, case {case.number}: {result.error}")
        else:
            yield result.unwrap()
