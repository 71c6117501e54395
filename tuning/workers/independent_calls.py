"""Independent calls on workers: same results for any workers, and calls of dead workers repeated.

A pool of processes breaks as a whole if one of them dies, for example because memory is short.
Calls that ran at that time are then made again, each of them alone, so that a second death tells
which call it was. All other calls continue.

BLAS on one thread while calls run, however many of them run in one process.

``threadpool_limits`` restores at its end what it met at its start. Of two calls in threads the
first to end would lift the limit of the other, whose sums would then round otherwise.
"""

import platform
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

from threadpoolctl import threadpool_limits

from identification.words import InputError, WorkbenchError
from tuning.workers.executors import Submit, Workers, use_processes

_LIBRARIES = ("mbworkbench", "mujoco", "numpy", "scipy")  # they determine all digits of a result
_MAX_DEATHS = 2  # of workers, until a call that ran alone fails

Call = tuple[Callable[..., Any], tuple[Any, ...]]


class WorkerDiedError(WorkbenchError):
    """Repeated death of the workers that made one call."""


@dataclass(frozen=True)
class CallResult:
    """Result of a call.

    Args:
        index: place of the call among all calls.
        value: what the call returned.
        error: what it raised instead; None if it returned.
    """

    index: int
    value: Any = None
    error: Exception | None = None

    def unwrap(self) -> Any:
        """Return the value, or raise the error."""
        if self.error is not None:
            raise self.error
        return self.value


@dataclass
class _Schedule:
    """Calls that are not finished: which of them runs next.

    Attributes:
        waiting: calls that were never submitted.
        suspects: calls that ran when a pool broke; each of them runs alone.
        at_once: calls that may run at a time; None for all.
        deaths: how often workers of a call died.
        is_alone: whether a suspect runs now.
    """

    waiting: deque[int]
    at_once: int | None
    suspects: deque[int] = field(default_factory=deque)
    deaths: Counter[int] = field(default_factory=Counter)
    is_alone: bool = False

    def take(self, running: int) -> int | None:
        """Return the next call to submit while others run; None if none may be submitted now."""
        if running == 0:
            self.is_alone = False
        if self.is_alone or (self.suspects and running):
            return None
        if self.suspects:
            self.is_alone = True
            return self.suspects.popleft()
        has_room = self.at_once is None or running < self.at_once
        return self.waiting.popleft() if self.waiting and has_room else None

    def note_deaths(self, calls: Sequence[int]) -> int | None:
        """Note the calls that ran when a pool broke; return the one that must not be repeated."""
        self.deaths.update(calls)
        if len(calls) == 1 and self.deaths[calls[0]] >= _MAX_DEATHS:
            return calls[0]
        self.suspects.extend(sorted(calls))
        return None


def run_in_parallel(calls: Sequence[Call], jobs: int) -> Iterator[Any]:
    """Yield the results of functions in the order of the calls, whatever the number of jobs.

    Args:
        jobs: processes; a single call is made here.

    Raises:
        Exception: that of the first call that raised one.
    """
    finished: dict[int, CallResult] = {}
    results = run_calls(calls, use_processes(min(jobs, len(calls))))
    for index in range(len(calls)):
        while index not in finished:
            result = next(results)
            finished[result.index] = result
        yield finished.pop(index).unwrap()


def run_calls(calls: Sequence[Call], workers: Workers) -> Iterator[CallResult]:
    """Yield the result of each call as soon as it is finished; the first calls start first.

    Raises:
        InputError: a worker has other versions of the libraries, or the connection was lost.
    """
    schedule = _Schedule(deque(range(len(calls))), workers.at_once)
    while schedule.waiting or schedule.suspects:
        with workers.open() as submit:
            yield from _run_until_break(calls, workers, schedule, submit)


def _run_until_break(
    calls: Sequence[Call], workers: Workers, schedule: _Schedule, submit: Submit
) -> Iterator[CallResult]:
    """Yield results until all calls are finished or the pool of workers breaks."""
    versions = list_versions() if workers.are_elsewhere else None
    running: dict[Future[Any], int] = {}
    dead: list[int] = []
    while not dead:
        while (index := schedule.take(len(running))) is not None:
            try:
                running[submit(make_call, *calls[index], versions)] = index
            except workers.pool_deaths:
                schedule.waiting.appendleft(index)
                break
        if not running:
            return
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield from _collect(running.pop(future), future, workers, dead)
    wait(running)  # in a broken pool all of them have ended
    for future, index in running.items():
        yield from _collect(index, future, workers, dead)
    culprit = schedule.note_deaths(dead)
    if culprit is not None:
        yield CallResult(culprit, error=_describe_death())


def _collect(
    index: int, future: "Future[Any]", workers: Workers, dead: list[int]
) -> Iterator[CallResult]:
    """Yield the result of a future, or note its call among those whose worker died."""
    try:
        outcome = future.result()
    except workers.pool_deaths:
        dead.append(index)
    except workers.call_deaths:
        yield CallResult(index, error=_describe_death())
    except CancelledError as error:
        raise InputError(
            "the connection to the workers was lost: start the same call again, which continues"
        ) from error
    else:
        if isinstance(outcome, _Failure):
            yield CallResult(index, error=outcome.restore())
        else:
            yield CallResult(index, outcome)


def _describe_death() -> WorkerDiedError:
    return WorkerDiedError(
        "its worker process died again and again, for example because memory is short: use fewer "
        "--jobs, or more memory"
    )


@dataclass(frozen=True)
class _Failure:
    """Exception of a call, sent as a value: exceptions of a future are those of its worker.

    Args:
        error: the exception.
        trace: its traceback as text, for an exception does not bring it from another process.
    """

    error: Exception
    trace: str

    def restore(self) -> Exception:
        """Return the exception, with its traceback as a note if it has lost it."""
        if self.error.__traceback__ is None:
            self.error.add_note(f"in a worker: {self.trace}")
        return self.error


def list_versions() -> dict[str, str]:
    """Return the versions that determine the digits of a result."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: version(name) for name in _LIBRARIES}}


def make_call(
    function: Callable[..., Any], given: tuple[Any, ...], versions: dict[str, str] | None
) -> Any:
    """Make a call in a worker, with BLAS on one thread.

    Args:
        function: the function.
        given: its arguments.
        versions: versions that the worker must have; None if they need no check.

    Returns:
        What the function returns, or its exception as a value.

    Raises:
        InputError: the worker has other versions.
    """
    if versions is not None:
        _check_versions(versions)
    with limit_blas_threads():
        try:
            return function(*given)
        except Exception as error:  # of any kind: it is raised where the result is used
            return _Failure(error, traceback.format_exc())


def _check_versions(expected: dict[str, str]) -> None:
    """Refuse to work with other versions: the same case would give other digits.

    Raises:
        InputError: a version differs.
    """
    for name, present in list_versions().items():
        if present != expected[name]:
            raise InputError(
                f"the worker on {platform.node()} has {name} {present}, and the command has "
                f"{expected[name]}: install the same versions on all workers"
            )


@dataclass
class _SharedLimit:
    """Limit that begins with the first call and ends with the last one.

    Attributes:
        lock: guard of both other attributes.
        count: calls that run now.
        limit: limit that the first of them set; None if none runs.
    """

    lock: threading.Lock = field(default_factory=threading.Lock)
    count: int = 0
    limit: threadpool_limits | None = None


_SHARED = _SharedLimit()


@contextmanager
def limit_blas_threads() -> Iterator[None]:
    """Keep BLAS on one thread until the last call of this process has left the block."""
    with _SHARED.lock:
        _SHARED.count += 1
        if _SHARED.limit is None:
            _SHARED.limit = threadpool_limits(1)
    try:
        yield
    finally:
        with _SHARED.lock:
            _SHARED.count -= 1
            if _SHARED.count == 0 and _SHARED.limit is not None:
                _SHARED.limit.restore_original_limits()
                _SHARED.limit = None
