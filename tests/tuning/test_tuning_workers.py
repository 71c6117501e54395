"""Independent calls on workers: order, deaths, interrupts, executors of users, a Dask cluster."""

import contextlib
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from identification.words import InputError, UsageError
from tuning.workers import independent_calls
from tuning.workers.executors import use_cluster, use_executor, use_processes
from tuning.workers.independent_calls import (
    WorkerDiedError,
    limit_blas_threads,
    run_calls,
    run_in_parallel,
)

HERE = "tests.tuning.test_tuning_workers"
INTERRUPTED = """
import signal, sys, time
from pathlib import Path
from tuning.workers.independent_calls import run_in_parallel

def work(number, folder):
    Path(folder, f"begun{number}").touch()
    time.sleep(60)

signal.signal(signal.SIGINT, signal.default_int_handler)  # in a shell's background it is ignored
try:
    results = run_in_parallel([(work, (k, sys.argv[1])) for k in (0, 1)], 2)
    Path(sys.argv[1], "asked").touch()
    list(results)
except KeyboardInterrupt:
    sys.exit(130)
"""

threads = functools.partial(ThreadPoolExecutor, 3)
process_pool = functools.partial(ProcessPoolExecutor, 2)


def square(number):
    return number**2, os.getpid()


def die_at_first(number, folder, deadly, count=1):
    """Square a number; the workers of the deadly number are killed so many times."""
    attempts = folder / f"{number}.attempts"
    with attempts.open("a") as file:
        file.write("x")
    if number == deadly and len(attempts.read_text()) <= count:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.05)
    return number**2


def refuse(number):
    if number == 1:
        raise KeyError("one")
    return number


def numbers(results):
    return {result.index: result.unwrap() for result in results}


def test_results_have_the_order_of_the_calls_in_other_processes():
    power = 3
    calls = [(lambda x: (x**power, os.getpid()), (k,)) for k in range(7)]
    values, places = zip(*run_in_parallel(calls, 2), strict=True)
    assert values == tuple(k**3 for k in range(7))
    assert os.getpid() not in places
    alone, here = zip(*run_in_parallel(calls, 1), strict=True)
    assert alone == values
    assert set(here) == {os.getpid()}
    assert list(run_in_parallel([], 2)) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_exception_belongs_to_its_call_and_the_others_are_finished(jobs):
    calls = [(refuse, (k,)) for k in range(4)]
    results = {result.index: result for result in run_calls(calls, use_processes(jobs))}
    assert [results[k].value for k in (0, 2, 3)] == [0, 2, 3]
    with pytest.raises(KeyError, match="one"):
        results[1].unwrap()
    with pytest.raises(KeyError):
        list(run_in_parallel(calls, jobs))


def test_the_call_of_a_worker_that_died_is_made_again(tmp_path):
    calls = [(die_at_first, (k, tmp_path, 2)) for k in range(6)]
    assert numbers(run_calls(calls, use_processes(2))) == {k: k**2 for k in range(6)}
    assert (tmp_path / "2.attempts").read_text() == "xx"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of a fork beside threads: quick here
@pytest.mark.parametrize("at_once", [2, None])
def test_a_call_that_kills_every_worker_is_named_and_all_others_are_finished(tmp_path, at_once):
    calls = [(die_at_first, (k, tmp_path, 1, 99)) for k in range(5)]
    workers = replace(use_executor(f"{HERE}:process_pool"), at_once=at_once)
    results = {result.index: result for result in run_calls(calls, workers)}
    assert isinstance(results.pop(1).error, WorkerDiedError)
    assert numbers(results.values()) == {k: k**2 for k in (0, 2, 3, 4)}
    assert len((tmp_path / "1.attempts").read_text()) == 2


def test_calls_run_in_the_executor_of_a_user():
    values = numbers(run_calls([(square, (k,)) for k in range(9)], use_executor(f"{HERE}:threads")))
    assert values == {k: (k**2, os.getpid()) for k in range(9)}


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("threads", "package:factory"),
        ("no_such_package:threads", "no_such_package"),
        (f"{HERE}:no_such_factory", "no_such_factory"),
        (f"{HERE}:dict", "dict"),
    ],
)
def test_a_name_that_gives_no_executor_is_refused(name, sentence):
    with pytest.raises(UsageError, match=sentence):
        list(run_calls([(square, (1,))], use_executor(name)))


def dict():  # noqa: A001  # what a factory might return by mistake
    return {}


def test_a_worker_with_other_versions_is_refused_with_one_sentence(monkeypatch):
    here = independent_calls.list_versions()
    monkeypatch.setattr(independent_calls, "list_versions", lambda: here | {"numpy": "1.0"})
    with pytest.raises(InputError, match=rf"has numpy 1\.0, and the command has {here['numpy']}"):
        independent_calls.make_call(square, (1,), here)
    assert independent_calls.make_call(square, (1,), None)[0] == 1


def test_blas_stays_on_one_thread_until_the_last_of_overlapping_calls_ends():
    def blas_threads():
        return {row["num_threads"] for row in threadpool_info() if row["user_api"] == "blas"}

    before, is_inside, may_end = blas_threads(), threading.Event(), threading.Event()

    def stay():
        with limit_blas_threads():
            is_inside.set()
            may_end.wait(10)

    thread = threading.Thread(target=stay)
    with limit_blas_threads():
        thread.start()
        is_inside.wait(10)
    assert blas_threads() == {1}
    may_end.set()
    thread.join()
    assert blas_threads() == before


@pytest.mark.parametrize("sign", ["asked", "begun1"])  # while they begin, and at work
def test_an_interrupt_ends_other_processes_in_silence(tmp_path, sign):
    script = tmp_path / "asks.py"
    script.write_text(INTERRUPTED)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, str(script), str(tmp_path)]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    ) as process:
        while not (tmp_path / sign).is_file() and process.poll() is None:
            time.sleep(0.05)
        said = None
        while said is None:  # while processes start, an instant of deafness is allowed
            time.sleep(0.3)
            os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                _, said = process.communicate(timeout=10)
    assert process.returncode == 130, said
    assert said == ""


@pytest.fixture(scope="module")
def cluster():
    """A Dask scheduler and two workers of one thread, each a process."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(processes=True, silence_logs=50, **options) as cluster:
        yield cluster.scheduler_address


@pytest.mark.filterwarnings("ignore")  # of Dask itself
def test_a_killed_worker_of_a_cluster_loses_no_call(cluster, tmp_path):
    calls = [(die_at_first, (k, tmp_path, 2)) for k in range(8)]
    assert numbers(run_calls(calls, use_cluster(cluster))) == {k: k**2 for k in range(8)}
    assert (tmp_path / "2.attempts").read_text() == "xx"
    power = 3  # local functions are sent, exceptions belong to their calls
    assert numbers(run_calls([(lambda x: x**power, (2,))], use_cluster(cluster))) == {0: 8}
    failed = list(run_calls([(refuse, (k,)) for k in range(3)], use_cluster(cluster)))
    assert [result.index for result in failed if isinstance(result.error, KeyError)] == [1]


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_dies_after_its_answer_does_not_spoil_it(cluster, monkeypatch):
    client_class = pytest.importorskip("distributed").Client
    gather = client_class._gather

    async def gather_and_lose(client, *given, **options):
        answers = await gather(client, *given, **options)
        for state in client.futures.values():
            state.lose()
        return answers

    monkeypatch.setattr(client_class, "_gather", gather_and_lose)
    calls = [(pow, (k, 2)) for k in range(4)]
    assert numbers(run_calls(calls, use_cluster(cluster))) == {k: k**2 for k in range(4)}


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_does_not_answer_is_refused_with_one_sentence(monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed")
    monkeypatch.setattr("tuning.workers.executors._MAX_CONNECT_S", 0.2)
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(run_calls([(square, (1,))], use_cluster("tcp://127.0.0.1:9")))
    for address in ("node1", "tcp://node1", "tcp://node1:port"):
        with pytest.raises(UsageError, match="with its port, such as tcp://node1:8786"):
            use_cluster(address)


def test_without_dask_a_cluster_names_the_extra_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"mbworkbench\[cluster\]"):
        use_cluster("tcp://127.0.0.1:8786")
