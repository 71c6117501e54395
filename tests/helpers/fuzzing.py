"""Fuzz of readers: mutated files must give ``InputError`` or a result, quickly and in silence.

Mutations run in a forked child process, so that a crash or a hang costs one mutation. Each fault
names the seed that makes it again.
"""

import faulthandler
import json
import os
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from identification.words import WorkbenchError
from tests.helpers.mutations import mutate

_MAX_CPU_SECONDS = 5.0  # a longer reading is a fault
_MAX_WALL_SECONDS = 30.0  # a reading that lasts longer hangs, and its process is ended
_MAX_EXTRA_MEMORY_BYTES = 3 << 30  # of a child beyond what its parent has


@dataclass(frozen=True)
class FuzzTarget:
    """A reader and healthy files for it.

    Args:
        name: of the reader.
        write: writes healthy examples into a folder and returns them: a file, or a file among
            others that the reader needs as well.
        read: reads one file.
        share: part of the usual number of mutations that a test makes; below 1 where each takes
            a process of its own.
    """

    name: str
    write: Callable[[Path], Sequence[Path]]
    read: Callable[[Path], object]
    share: float = 1.0

    def seeds(self, mutations: int) -> range:
        """Return the seeds of a test of so many mutations."""
        return range(round(self.share * mutations))


def find_faults(target: FuzzTarget, folder: Path, seeds: Iterable[int]) -> dict[int, str]:
    """Mutate the examples of a target, one mutation for each seed, and read them.

    Args:
        target: the reader.
        folder: an empty folder.
        seeds: of the mutations; seed k changes example k modulo their number.

    Returns:
        What was wrong, by seed: an exception other than ``WorkbenchError``, a signal that ended the
        process, output on stdout, or too long a time.
    """
    examples = [(path, path.read_bytes()) for path in target.write(folder)]
    for path, _ in examples:
        target.read(path)
    waiting, faults = list(seeds), {}
    log = folder / "fuzz.log"
    while waiting:
        log.write_text("")
        status = _fork(partial(_read_mutations, target, examples, waiting, log))
        entries = [json.loads(line) for line in log.read_text().splitlines()]
        faults |= {seed: fault for seed, fault in entries if fault not in (None, "begun")}
        read = {seed for seed, fault in entries if fault != "begun"}
        last = entries[-1][0] if entries else waiting[0]
        if last not in read:
            faults[last] = _describe_end(status)
        waiting = waiting[waiting.index(last) + 1 :]
    for path, content in examples:
        path.write_bytes(content)
    return faults


def _fork(work: Callable[[], None]) -> int:
    """Do work in a child process and return its wait status."""
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1]


def _read_mutations(
    target: FuzzTarget, examples: list[tuple[Path, bytes]], seeds: list[int], log: Path
) -> None:
    """Read one mutation for each seed and write a line before and after each."""
    faulthandler.disable()
    warnings.simplefilter("error", RuntimeWarning)  # a command would print it
    _limit_memory()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    output = os.open(log.with_suffix(".stdout"), os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    # A capture of pytest is another object than the stream of the process.
    sys.stdout = os.fdopen(os.dup(output), "w", buffering=1)
    sys.stderr = os.fdopen(os.dup(2), "w")
    with log.open("a", buffering=1) as lines:
        for seed in seeds:
            path, content = examples[seed % len(examples)]
            path.write_bytes(mutate(content, seed))
            print(json.dumps([seed, "begun"]), file=lines)
            signal.setitimer(signal.ITIMER_REAL, _MAX_WALL_SECONDS)
            fault = _read_in_silence(target, path, output)
            signal.setitimer(signal.ITIMER_REAL, 0)
            path.write_bytes(content)
            print(json.dumps([seed, fault]), file=lines)


def _read_in_silence(target: FuzzTarget, path: Path, output: int) -> str | None:
    """Return what is wrong with the reading of a file, or None."""
    fault, begin = None, time.process_time()
    try:
        target.read(path)
    except WorkbenchError as error:
        if error.exit_code == 1 or not str(error).strip() or "\x00" in str(error):
            fault = f"message {str(error)[:200]!r}"
    except BaseException as error:
        fault = f"{type(error).__name__}: {str(error)[:200]}{_place(error)}"
    seconds = time.process_time() - begin
    sys.stdout.flush()
    if os.fstat(output).st_size:
        printed = os.pread(output, 200, 0)
        os.ftruncate(output, 0)
        os.lseek(output, 0, os.SEEK_SET)
        fault = fault or f"stdout {printed!r}"
    return fault or (f"{seconds:.1f} s" if seconds > _MAX_CPU_SECONDS else None)


def _place(error: BaseException) -> str:
    """Return the innermost place of an exception as text."""
    places = list(_places(error))
    return f" ({places[-1]})" if places else ""


def _places(error: BaseException) -> Iterator[str]:
    """Yield file and line of each call that an exception passed."""
    trace = error.__traceback__
    while trace is not None:
        yield f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next


def _describe_end(status: int) -> str:
    """Return how a process ended that did not finish a mutation."""
    if not os.WIFSIGNALED(status):
        return f"exit {os.waitstatus_to_exitcode(status)}"
    number = os.WTERMSIG(status)
    is_hang = number == signal.SIGALRM
    return f"hang beyond {_MAX_WALL_SECONDS:g} s" if is_hang else signal.Signals(number).name


def _limit_memory() -> None:
    """Limit the address space of this process, so that a huge allocation fails at once."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + _MAX_EXTRA_MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
