"""Where independent calls run: here, in processes, on a Dask cluster, or in an executor of a user.

All of them are executors of ``concurrent.futures``: a call is submitted and gives a future. Threads
would wait for each other, because refits are many small steps of Python. Calls may contain local
functions, as effects of users do: processes and Dask send those by cloudpickle.
"""

import signal
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any
from urllib.parse import urlsplit

from joblib.externals.loky import get_reusable_executor

from identification.words import InputError, UsageError

# A process loads this project in about 3 s, so that it stays for the next calls of a diagnosis.
_MAX_IDLE_S = 300
# A scheduler answers in milliseconds; a queueing system may need a minute for its first worker.
_MAX_CONNECT_S, _MAX_FIRST_WORKER_S = 10, 120

Submit = Callable[..., "Future[Any]"]


@dataclass(frozen=True)
class Workers:
    """Workers for independent calls.

    Args:
        open: opens an executor, yields its ``submit``, and closes it; what still runs at that
            time is ended or cancelled.
        at_once: calls that are submitted at a time; None: all, and the executor distributes them.
        pool_deaths: exceptions of a future that say that all workers are lost.
        call_deaths: exceptions of a future that say that only this call has lost its workers.
        are_elsewhere: whether workers can have other versions of the libraries.
    """

    open: Callable[[], AbstractContextManager[Submit]]
    at_once: int | None
    pool_deaths: tuple[type[BaseException], ...] = (BrokenExecutor,)
    call_deaths: tuple[type[BaseException], ...] = ()
    are_elsewhere: bool = False


def use_processes(jobs: int) -> Workers:
    """Return processes of this computer; a single one is this process."""
    if jobs <= 1:
        return Workers(_open_here, at_once=1)
    return Workers(partial(_open_processes, jobs), at_once=jobs)


def use_executor(name: str) -> Workers:
    """Return the workers of a user's executor.

    Args:
        name: ``package:factory``; the factory is called without arguments and returns an executor
            of ``concurrent.futures``.

    Raises:
        UsageError: there is no such factory.
    """
    package, _, factory_name = name.partition(":")
    if not (package and factory_name):
        raise UsageError(f"--executor {name}: give package:factory, such as my_cluster:executor")
    try:
        factory = getattr(import_module(package), factory_name)
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"--executor {name} cannot be loaded ({error}): install the package beside mbworkbench"
        ) from error
    return Workers(partial(_open_factory, name, factory), at_once=None, are_elsewhere=True)


def use_cluster(address: str) -> Workers:
    """Return the workers of a Dask cluster, which makes calls of a lost worker again elsewhere.

    Args:
        address: of the scheduler, such as ``tcp://node1:8786``.

    Raises:
        UsageError: Dask is not installed, or the address has no port.
    """
    if _find_port(address) is None:
        raise UsageError(
            f"--cluster {address}: give the scheduler with its port, such as tcp://node1:8786"
        )
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise UsageError(
            f"--cluster {address} needs Dask: install mbworkbench[cluster] here and on all workers"
        ) from error
    return Workers(
        partial(_open_cluster, distributed, address),
        at_once=None,
        call_deaths=(distributed.KilledWorker,),
        are_elsewhere=True,
    )


def _find_port(address: str) -> tuple[str, int] | None:
    """Return host and port of an address; None if it lacks one of them."""
    try:
        parts = urlsplit(address if "://" in address else f"tcp://{address}")
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    return None if host is None or port is None else (host, port)


@contextmanager
def _open_here() -> Iterator[Submit]:
    yield _run_now


def _run_now(function: Callable[..., Any], *given: Any) -> "Future[Any]":
    future: Future[Any] = Future()
    future.set_result(function(*given))
    return future


@contextmanager
def _open_processes(jobs: int) -> Iterator[Submit]:
    """Yield the submission to processes; those that still work at the end are killed."""
    executor = get_reusable_executor(max_workers=jobs, timeout=_MAX_IDLE_S)
    futures: list[Future[Any]] = []

    def submit(function: Callable[..., Any], *given: Any) -> "Future[Any]":
        with _ignore_interrupts():
            futures.append(executor.submit(function, *given))
        return futures[-1]

    try:
        yield submit
    finally:
        if not all(future.done() for future in futures):
            executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def _open_factory(name: str, factory: Callable[[], Executor]) -> Iterator[Submit]:
    executor = factory()
    if not (hasattr(executor, "submit") and hasattr(executor, "shutdown")):
        raise UsageError(
            f"--executor {name} returns a {type(executor).__name__}: return an executor of "
            "concurrent.futures"
        )
    is_finished = False
    try:
        yield executor.submit
        is_finished = True
    finally:
        executor.shutdown(wait=is_finished, cancel_futures=True)


@contextmanager
def _open_cluster(distributed: Any, address: str) -> Iterator[Submit]:
    try:
        # Without a scheduler a client tries on for long, and fails again when it is deleted.
        socket.create_connection(_find_port(address) or ("", 0), timeout=_MAX_CONNECT_S).close()
        client = distributed.Client(address, timeout=_MAX_CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address}: start one with dask scheduler, or correct "
            "the address"
        ) from error
    with client:  # its end cancels calls that have not begun
        try:
            client.wait_for_workers(1, timeout=_MAX_FIRST_WORKER_S)
        except TimeoutError as error:
            raise InputError(
                f"the Dask cluster at {address} has no worker: start some with "
                f"dask worker {address} --nthreads 1"
            ) from error
        yield partial(_submit_to_cluster, client)


def _submit_to_cluster(client: Any, function: Callable[..., Any], *given: Any) -> "Future[Any]":
    """Return a future that passes on what the cluster answers.

    Dask's own executor judges an answer by the state of its task at that time. A worker that dies
    after its answer has changed this state, and a right answer becomes a ``TypeError``.
    """
    future: Future[Any] = Future()
    task = client.submit(function, *given, pure=False)  # impure: an equal call is made again

    async def pass_on() -> None:
        try:
            answer = await client.gather(task, asynchronous=True)
        except CancelledError:
            future.cancel()
            future.set_running_or_notify_cancel()  # wakes those who wait
        except Exception as error:
            future.set_exception(error)
        else:
            future.set_result(answer)

    client.loop.add_callback(pass_on)
    return future


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
