"""BLAS on one thread while calls run, however many of them run in one process.

``threadpool_limits`` restores at its end what it met at its start. Of two calls in threads the
first to end would lift the limit of the other, whose sums would then round otherwise.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from threadpoolctl import threadpool_limits


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
