"""Independent calls in processes.

Threads would wait for each other, because refits are many small steps of Python. Arguments may
contain local functions, as effects of users do; joblib sends those if cloudpickle is installed.
"""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

Call = tuple[Callable[..., Any], tuple[Any, ...]]


def run_in_parallel(calls: Sequence[Call], jobs: int) -> Iterator[Any]:
    """Yield the results of functions in the order of the calls, whatever the number of jobs.

    Args:
        calls: functions with their arguments.
        jobs: processes; a single call is made here.
    """
    # Arrays of megabytes are sent faster than files are written and mapped.
    run = Parallel(
        n_jobs=max(1, min(jobs, len(calls))), return_as="generator", max_nbytes=None, batch_size=1
    )
    with _ignore_interrupts():
        results: Iterator[Any] = run(
            delayed(_run_alone)(function, given) for function, given in calls
        )
    return results


@contextmanager
def _ignore_interrupts() -> Iterator[None]:
    """Let processes that start here ignore Ctrl-C; the parent process gets it too and ends them.

    Otherwise each process that waits or starts would print a traceback.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _run_alone(function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    with threadpool_limits(1):
        return function(*given)
