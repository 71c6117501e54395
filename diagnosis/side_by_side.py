"""Work whose parts do not wait for each other, in processes.

Threads would: refits are many small steps of Python. What is sent may hold functions made in
functions, as users' effects do: joblib sends those where cloudpickle is installed.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

Call = tuple[Callable[..., Any], tuple[Any, ...]]


def side_by_side(calls: Sequence[Call], jobs: int) -> Iterator[Any]:
    """What functions return, in the order in which they are given; it does not depend on jobs.

    Args:
        calls: functions with their arguments.
        jobs: processes; a single call is made here.
    """
    # Arrays of megabytes cross over sooner than files are written and mapped.
    beside = Parallel(
        n_jobs=max(1, min(jobs, len(calls))), return_as="generator", max_nbytes=None, batch_size=1
    )
    made: Iterator[Any] = beside(delayed(_alone)(function, given) for function, given in calls)
    return made


def _alone(function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    with threadpool_limits(1):
        return function(*given)
