"""Jobs of the workbench: the verbs of the command line, run on a copy of what the page shows.

A job has a folder of its own, outside that of the campaign: ``input`` holds the model and a
campaign.toml that names the measurements, ``out`` the result, ``log.txt`` what the verb said. Fits
and comparisons begin at the drawing, with what was added to it: their priors are about it, and
their values those of the page. Without additions they read the campaign itself.
One job runs, the others wait. The process outlives its server: ``exit.txt`` holds its exit code,
from which the next server goes on. Jobs are no part of a state and are never undone.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Condition, Thread
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from identification.words import UsageError
from mbw.output_folder import ResultOptions
from mbw.remarks import list_reading_options
from mbw.workbench.saving import SAVED_MODEL, check_unchanged, save_state
from mbw.workbench.state import SessionState
from mbw.workbench.subject import WorkbenchSubject

Verb = Literal["tune", "diagnose", "identify", "predict", "blind", "compare"]
Status = Literal["waiting", "running", "done", "failed", "cancelled", "interrupted"]
PAGES: dict[Verb, str] = {
    **{"tune": "report.html", "diagnose": "report.html", "predict": "predict.html"},
    **{"identify": "identify.html", "compare": "page.html", "blind": "blind.html"},
}
_FITS = ("tune", "diagnose")  # they can resume; blind goes on by itself
_OF_CAMPAIGNS = ("tune", "diagnose", "identify", "compare")  # verbs that need measurements
_JOB, _SAID, _EXIT = "job.json", "log.txt", "exit.txt"
# Its exit code is written when it ends, whether or not the server is there to see it.
# The shell outlives Ctrl-C, which goes to all of its group.
_RUN = 'trap : INT; nice -n 10 "$@" > log.txt 2>&1; echo $? > exit.tmp; mv exit.tmp exit.txt'
_SHOWN_BYTES = 4000  # of the end of a log that the page shows
_OPENED_CODES = (0, 4)  # exit codes with a result: done, and done with a doubt
_POLL_S = 0.5


class Job(BaseModel):
    """One job, as its file holds it.

    Args:
        number: of the job, from 1.
        verb: of the command line.
        key: hash of the machine that it was made from.
        band: lowest and highest frequency line of the page [Hz].
        partner: second campaign of a comparison; empty for partner verbs.
        reading: options that say how models are read.
        status: what has become of it.
        code: exit code; None before its end.
        source: campaign that it reads in place of ``input``; empty for none.
        pid: process group; None before its start.
        began: when the system says that this process began; another one may get its number.
        remarks: what the MJCF of its input cannot hold.
        is_shown: whether its result is the one of its verb that the page shows.
    """

    number: int
    verb: Verb
    key: str
    band: tuple[float, float]
    partner: str = ""
    reading: tuple[str, ...] = ()
    status: Status = "waiting"
    code: int | None = None
    source: str = ""
    pid: int | None = None
    began: str = ""
    remarks: tuple[str, ...] = ()
    is_shown: bool = False


@dataclass(eq=False)
class JobQueue:
    """Jobs of one state's log, run one after the partner by a thread.

    Args:
        folder: of all jobs; created.
        finish: called with a job that has a result, and the folder of it.
    """

    folder: Path
    finish: Callable[[Job, Path], None] = field(default=lambda job, out: None)
    _changed: Condition = field(default_factory=Condition)
    _is_open: bool = True

    def __post_init__(self) -> None:
        """Read the jobs that there are."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._jobs = {job.number: job for job in self._read_all()}
        self._thread = Thread(target=self._work, daemon=True)

    def begin(self) -> "JobQueue":
        """Run the jobs that there are, and those to come; return the queue."""
        self._thread.start()
        return self

    def list_jobs(self) -> list[dict[str, object]]:
        """Return all jobs with the end of their log, the newest first."""
        with self._changed:
            jobs = sorted(self._jobs.values(), key=lambda job: -job.number)
        return [
            {
                **job.model_dump(exclude={"pid"}),
                "log": self._read_log(job),
                "has_page": self.page(job.number) is not None,
                "folder": str(self._place(job) / "out"),
            }
            for job in jobs
        ]

    def add(
        self, verb: Verb, subject: WorkbenchSubject, state: SessionState, partner: str = ""
    ) -> Job:
        """Write the input of a job from a state, and let it wait for its turn.

        Raises:
            UsageError: the verb needs measurements, or the campaign to compare with is missing.
            InputError: the input cannot be written.
        """
        if os.name == "nt":
            raise UsageError(f"jobs need Linux or macOS: save the model, and run mbw {verb} on it")
        if verb in _OF_CAMPAIGNS and subject.campaign is None:
            raise UsageError(f"mbw {verb} needs measurements: open a campaign")
        if verb == "compare" and not _exists(partner):
            raise UsageError(f"{partner or 'no campaign'} is not there: name the campaign after")
        check_unchanged(subject)
        with self._changed:
            taken = (int(path.name) for path in self.folder.iterdir() if path.name.isdecimal())
            number = max([0, *taken]) + 1
            lines = subject.freq_hz
            job = Job(
                number=number,
                verb=verb,
                key=state.machine_key,
                band=(float(lines[0]), float(lines[-1])),
                partner=partner,
                reading=tuple(list_reading_options()),
            )
            self._keep(job.model_copy(update=self._write_input(job, subject, state)))
        return job

    def _write_input(
        self, job: Job, subject: WorkbenchSubject, state: SessionState
    ) -> dict[str, Any]:
        """Write the input of a job; return what its file says of it."""
        is_from_drawing = job.verb in _OF_CAMPAIGNS
        if is_from_drawing and not subject.edits:
            return {"source": str(subject.source.absolute())}
        if is_from_drawing:
            state = replace(state, coordinates=())
        sentences = save_state(subject, state, ResultOptions(self._place(job) / "input"))
        return {"remarks": tuple(sentences[1:])}

    def cancel(self, number: int) -> None:
        """Take a waiting job off the queue, or interrupt the running one as Ctrl-C does.

        Raises:
            UsageError: there is no such job, or it has ended.
        """
        with self._changed:
            job = self._get(number, ("waiting", "running"))
            if job.status == "waiting":
                self._keep(job.model_copy(update={"status": "cancelled"}))
            elif job.pid is not None:
                self._keep(job.model_copy(update={"status": "cancelled"}))
                _send_interrupt(job)

    def resume(self, number: int) -> None:
        """Let a job that was cancelled, interrupted or failed wait for another turn.

        Raises:
            UsageError: there is no such job, or it waits, runs or is done.
        """
        with self._changed:
            job = self._get(number, ("cancelled", "interrupted", "failed"))
            if job.pid is not None and _is_running(job, self._place(job)):
                raise UsageError(f"job {number} has not ended yet: try again in a moment")
            (self._place(job) / _EXIT).unlink(missing_ok=True)
            self._keep(job.model_copy(update={"status": "waiting", "code": None, "pid": None}))

    def show(self, number: int) -> None:
        """Hand over the result of a job that is done.

        Raises:
            UsageError: there is no such job, or it has no result.
            InputError: the result cannot be read.
        """
        with self._changed:
            job = self._get(number, ("done",))
        self._finish(job)

    def show_again(self) -> None:
        """Hand over the results that a former server showed last, one of each verb."""
        for job in sorted(self._jobs.values(), key=lambda job: job.number):
            if job.is_shown:
                self._hand_over(job)

    def page(self, number: int) -> Path | None:
        """Return the page of a result; None if there is none."""
        job = self._jobs.get(number)
        file = None if job is None else PAGES.get(job.verb)
        if job is None or file is None or job.status != "done":
            return None
        path = self._place(job) / "out" / file
        return path if path.is_file() else None

    def close(self) -> None:
        """End with the server: the running job is interrupted, and can be resumed."""
        with self._changed:
            self._is_open = False
            for job in self._jobs.values():
                if job.status == "running" and job.pid is not None:
                    _send_interrupt(job)
                    self._keep(job.model_copy(update={"status": "interrupted"}))
            self._changed.notify_all()
        if self._thread.is_alive():
            self._thread.join(10)

    def _get(self, number: int, allowed: tuple[Status, ...]) -> Job:
        """Return a job of one of some statuses."""
        job = self._jobs.get(number)
        if job is None:
            raise UsageError(f"there is no job {number}: open the page again")
        if job.status not in allowed:
            raise UsageError(f"job {number} is {job.status}")
        return job

    def _work(self) -> None:
        """Run the jobs in turn until the queue closes."""
        while self._is_open:
            with self._changed:
                active = [job for job in self._jobs.values() if self._is_active(job)]
                waiting = [job for job in self._jobs.values() if job.status == "waiting"]
                if not active and not waiting:
                    self._changed.wait()
                    continue
                job = (active or waiting)[0]
            try:
                self._go_on(job)
            except Exception as error:  # of one job: the others go on
                failed = {"status": "failed", "remarks": (*job.remarks, str(error))}
                with self._changed:
                    self._jobs[job.number] = job.model_copy(update=failed)

    def _go_on(self, job: Job) -> None:
        """Start a job that waits, or look after the one that runs."""
        with self._changed:
            if job.status == "waiting":
                job = self._start(job)
            self._changed.wait_for(lambda: not self._is_open, _POLL_S)
            if not self._is_open or _is_running(job, self._place(job)):
                return
            job = self._end(self._jobs[job.number])
        if job.status == "done":
            self._hand_over(job)

    def _hand_over(self, job: Job) -> None:
        """Hand the result of a job over; what is wrong with it stands with the job."""
        try:
            self._finish(job)
        except Exception as error:  # whatever it is, the result itself is there
            sentence = f"its result is not shown: {error}"
            with self._changed:
                remarks = tuple(dict.fromkeys((*job.remarks, sentence)))
                self._keep(job.model_copy(update={"remarks": remarks}))

    def _finish(self, job: Job) -> None:
        """Hand the result of a job over, and keep that it is the one of its verb that is shown."""
        self.finish(job, self._place(job) / "out")
        with self._changed:
            for each in [each for each in self._jobs.values() if each.verb == job.verb]:
                if each.is_shown != (each.number == job.number):
                    self._keep(each.model_copy(update={"is_shown": not each.is_shown}))

    def _is_active(self, job: Job) -> bool:
        """Return whether the process of a job has not been seen to end."""
        return job.pid is not None and job.code is None and job.status in ("running", "cancelled")

    def _start(self, job: Job) -> Job:
        """Start the process of a job."""
        place = self._place(job)
        source = job.source or ("input" if job.verb in _OF_CAMPAIGNS else f"input/{SAVED_MODEL}")
        job = self._keep(job.model_copy(update={"status": "running"}))  # before its process
        words = [sys.executable, "-m", "mbw", job.verb, source]
        words += [str(Path(job.partner).expanduser().absolute())] if job.partner else []
        words += ["--out", "out", "--overwrite", *job.reading]
        if job.verb in _FITS:  # on the lines of the page, so that their curves fit into it
            words += ["--band", *map(str, job.band)]
        if job.verb in _FITS and any((place / "out").glob("*.checkpoint.json")):
            words.append("--resume")
        process = subprocess.Popen(
            ["sh", "-c", _RUN, "job", *words], cwd=place, start_new_session=True
        )
        Thread(target=process.wait, daemon=True).start()  # leaves no process without a parent
        process_row = {"pid": process.pid, "began": _read_beginning(process.pid)}
        try:
            return self._keep(job.model_copy(update=process_row))
        except OSError:
            _send_interrupt(job.model_copy(update=process_row))  # nobody could end it later
            raise

    def _end(self, job: Job) -> Job:
        """Return a job whose process has ended, with its exit code."""
        try:
            code = int((self._place(job) / _EXIT).read_text("utf-8"))
        except (OSError, ValueError):  # killed
            code = -1
        status: Status = "done" if code in _OPENED_CODES else "failed"
        if job.status == "cancelled":
            status = "cancelled"
        elif code in (-1, 130):
            status = "interrupted"
        return self._keep(job.model_copy(update={"status": status, "code": code}))

    def _keep(self, job: Job) -> Job:
        """Write a job's file, and tell the thread."""
        place = self._place(job)
        place.mkdir(parents=True, exist_ok=True)
        temporary = place / f"{_JOB}.tmp"
        temporary.write_text(job.model_dump_json(indent=1) + "\n", encoding="utf-8")
        temporary.replace(place / _JOB)
        self._jobs[job.number] = job
        self._changed.notify_all()
        return job

    def _read_all(self) -> list[Job]:
        """Return the jobs that a former server left; one that was killed is interrupted."""
        jobs = []
        for path in sorted(self.folder.glob(f"*/{_JOB}")):
            try:
                jobs.append(Job.model_validate_json(path.read_text("utf-8")))
            except (OSError, ValidationError):
                continue  # its folder stays for the user
        return jobs

    def _read_log(self, job: Job) -> str:
        """Return the end of what a job said."""
        try:
            with (self._place(job) / _SAID).open("rb") as file:
                file.seek(0, os.SEEK_END)
                file.seek(max(0, file.tell() - _SHOWN_BYTES))
                return file.read().decode("utf-8", "replace")
        except OSError:
            return ""

    def _place(self, job: Job) -> Path:
        return self.folder / f"{job.number:04}"


def _exists(path: str) -> bool:
    """Return whether something lies at a path that a user typed."""
    try:
        return bool(path.strip()) and Path(path).expanduser().exists()
    except (OSError, RuntimeError, ValueError):  # too long, another user's home, a null character
        return False


def _read_beginning(pid: int) -> str:
    """Return when a process began, as the system says it; empty if it is not there."""
    words = ["ps", "-o", "lstart=", "-p", str(pid)]
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        pass
    try:
        return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""


def _is_running(job: Job, place: Path) -> bool:
    """Return whether the process of a job has not ended; its number may be another's by now."""
    if (place / _EXIT).is_file() or job.pid is None:
        return False
    return bool(job.began) and _read_beginning(job.pid) == job.began


def _send_interrupt(job: Job) -> None:
    """Interrupt the process group of a job, if it is still there."""
    if job.pid is None or not job.began or _read_beginning(job.pid) != job.began:
        return
    try:
        os.killpg(job.pid, signal.SIGINT)
    except (ProcessLookupError, PermissionError):
        return
