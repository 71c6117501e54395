"""Provisional findings about the accepted hits, computed in another process at low priority.

Campaign of the accepted hits, which every verb reads: one block for each of them.

Full diagnosis of the accepted hits at the stop, as a job of the workbench.
"""

import os
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from diagnosis import Verdict
from diagnosis.next_test.provisional import ProvisionalCause, find_provisionally
from identification.readers.array_records import write_array_records
from identification.words import Dof, HitEstimate, Records, WorkbenchError
from mbmodel import Reading, read_as
from mbmodel.mjcf.read import current_reading
from mbw.live.test import LiveTest, Place, Sheet
from mbw.workbench.jobs import Job, JobQueue
from mbw.workbench.opening import open_subject
from tuning import open_session, write_atomically
from tuning.files.plant_folder import VERDICT
from tuning.files.states_campaign import write_campaign_with_tests

_NICE = 10  # hits are judged meanwhile


@dataclass(frozen=True)
class Findings:
    """Provisional findings.

    Args:
        places: places and directions whose hits they are about.
        hits: number of these hits.
        error: relative error of the tuned model; None if no channel is clear of its noise.
        excess: error over noise; None without noise.
        is_gap_visible: whether the tuned model leaves more than noise.
        causes: the most promising effects, the best first.
        next_hits: labels of planned places, the most informative first.
        theta: values of the tuned model's parameters, by name [SI].
        since: when the last of the hits came [s].
    """

    places: tuple[Place, ...]
    hits: int
    error: float | None
    excess: float | None
    is_gap_visible: bool
    causes: tuple[ProvisionalCause, ...]
    next_hits: tuple[str, ...]
    theta: dict[str, float]
    since: float = 0.0


def compute_findings(
    folder: Path,
    places: Sequence[Place],
    hits: int,
    planned: Sequence[Dof],
    band: tuple[float, float] | None = None,
    reading: Reading | None = None,
) -> Findings:
    """Tune the model of a campaign of accepted hits, score effects, and rank planned hits.

    Args:
        folder: the campaign.
        places: places of its hits.
        hits: their number.
        planned: as for ``find_provisionally``.
        band: band of the lines that count [Hz]; None for those with coherence.
        reading: how the model is read; None for as it is.
    """
    with read_as(reading or Reading()):
        result = find_provisionally(open_session(folder, band), planned)
    names = [parameter.name for parameter in result.model.parameters]
    return Findings(
        tuple(places),
        hits,
        result.gap.error,
        result.gap.excess,
        result.is_gap_visible,
        result.causes,
        tuple(row.place for row in result.next_hits),
        dict(zip(names, result.theta.tolist(), strict=True)),
    )


@dataclass(eq=False)
class FindingsWorker:
    """Process that computes findings, one request at a time; the newest hits count.

    Args:
        folder: where campaigns of accepted hits are written.
    """

    folder: Path
    band: tuple[float, float] | None = None
    _pool: ProcessPoolExecutor | None = None
    _running: "Future[Findings] | None" = None
    _since: float = 0.0
    _asked: tuple[Any, ...] = field(default=())

    def ask(self, test: LiveTest, sheet: Sheet) -> None:
        """Compute findings about the places with enough hits, unless this is done or under way."""
        places = [place for place in sheet.complete if place in sheet.estimates]
        keys = tuple(hit.key for place in places for hit in sheet.list_accepted(place))
        if not keys or self._running is not None or keys == self._asked:
            return
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"), initializer=_lower_priority)
        self._asked, self._since = keys, time.monotonic()
        with write_atomically(self.folder) as staging:
            write_accepted(test, sheet, places, staging, self.folder)
        planned = [place[1] for place in sheet.places if place not in places]
        dofs = [dof for dof in planned if isinstance(dof, Dof)]
        self._running = self._pool.submit(
            compute_findings, self.folder, places, len(keys), dofs, self.band, current_reading()
        )

    def collect(self) -> "Findings | str | None":
        """Return findings that are done, or the sentence with which they failed."""
        if self._running is None or not self._running.done():
            return None
        running, self._running = self._running, None
        try:
            return replace(running.result(), since=self._since)
        except WorkbenchError as error:
            return f"no provisional findings: {error}"
        except Exception as error:  # of the process: hits are judged nevertheless
            self._pool = None
            return f"no provisional findings: {type(error).__name__}: {error}"

    def close(self) -> None:
        """End the process."""
        if self._pool is not None:
            for process in list(getattr(self._pool, "_processes", {}).values()):
                process.terminate()
            self._pool.shutdown(wait=False, cancel_futures=True)


def _lower_priority() -> None:
    """Leave the processor to the judgement of hits, and Ctrl-C to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICE)


# What the records that are written have in SI, or what has been done with them.
_SETTLED_KEYS = {"file", "unit", "columns", "averages", "time_sign", "references", "channels"}
_BLOCK_KEYS = {"block_s", "pretrigger_s"}


def write_accepted(
    test: LiveTest, sheet: Sheet, places: Sequence[Place], staging: Path, folder: Path
) -> None:
    """Write the accepted hits of some places as a campaign.

    Args:
        test: with campaign.toml, which states all else.
        sheet: hits, as they are judged.
        places: those whose hits are written.
        staging: existing folder into which the files are written.
        folder: where they are in the end.
    """
    blocks = []
    for number, place in enumerate(places, start=1):
        records = cut_accepted(sheet.records[place], sheet.estimates[place])
        name = f"hits_{number:02}.npz"
        write_array_records(staging / name, [records])
        stated = test.settings.test[place[0]].model_dump(exclude_unset=True, exclude=_SETTLED_KEYS)
        blocks.append(_describe(stated, name, records))
    write_campaign_with_tests(test.source, blocks, staging, folder)


def cut_accepted(records: Records, estimate: HitEstimate) -> Records:
    """Return one record for the block of each accepted hit.

    Args:
        records: records of a place.
        estimate: its FRFs, with the hits that were kept.
    """
    rate = records.rate_hz
    size = round(estimate.block_s * rate)
    starts = [
        (hit.record - 1, round((hit.time_s - estimate.pretrigger_s) * rate))
        for hit in estimate.kept
    ]
    last = records.force.shape[1] - size
    parts = [(row, slice(max(min(start, last), 0), None)) for row, start in starts]
    return replace(
        records,
        force=np.stack([records.force[row, part][:size] for row, part in parts]),
        motion=np.stack([records.motion[row, :, part][:, :size] for row, part in parts]),
    )


def _describe(stated: dict[str, Any], name: str, records: Records) -> dict[str, Any]:
    """Return the ``[[test]]`` of a file of accepted hits, which no verb is to judge again."""
    return {
        "file": name,
        **{key: value for key, value in stated.items() if key not in _BLOCK_KEYS},
        "references": [str(records.reference)],
        "channels": [str(dof) for dof in records.outputs],
        "quantity": records.quantity,
        "averages": len(records.force),
        "reject": False,
    }


@dataclass(eq=False)
class FullRefits:
    """Diagnoses of campaigns that do not change any more, in the background.

    Args:
        folder: where campaigns and jobs are kept.
    """

    folder: Path
    say: Callable[[str], None]
    _queue: JobQueue | None = None
    _asked: tuple[str, ...] = ()

    def ask(self, test: LiveTest, sheet: Sheet) -> None:
        """Diagnose the places with enough hits, unless this was asked for; jobs need no Windows."""
        places = [place for place in sheet.complete if place in sheet.estimates]
        keys = tuple(hit.key for place in places for hit in sheet.list_accepted(place))
        if os.name == "nt" or keys == self._asked:
            return
        self._asked = keys
        if self._queue is None:
            self._queue = JobQueue(self.folder / "jobs", self._finish).begin()
        number = len(list(self.folder.glob("stop*"))) + 1
        snapshot = self.folder / f"stop{number}"
        with write_atomically(snapshot) as staging:
            write_accepted(test, sheet, places, staging, snapshot)
        self.say(f"full diagnosis of {len(keys)} hits has begun; its input is {snapshot}")
        add = (copy_context().run, self._add, self._queue, snapshot)  # models are read as here
        Thread(target=add[0], args=add[1:], daemon=True).start()

    def close(self) -> None:
        """Interrupt what runs."""
        if self._queue is not None:
            self._queue.close()

    def _add(self, queue: JobQueue, snapshot: Path) -> None:
        """Open a campaign, and put its diagnosis into the queue."""
        try:
            subject = open_subject(snapshot, None, None)
            queue.add("diagnose", subject, subject.first_state())
        except WorkbenchError as error:
            self.say(f"no full diagnosis: {error}")

    def _finish(self, job: Job, out: Path) -> None:
        """Say what a diagnosis has found."""
        del job
        verdict = Verdict.model_validate_json((out / VERDICT).read_text("utf-8"))
        causes = ", ".join(
            f"{cause.effect}@{cause.location} {cause.probability:.2f}" for cause in verdict.causes
        )
        further = f"; next: {verdict.next_experiment}" if verdict.next_experiment else ""
        word = "nothing is missing" if verdict.verdict == "none" else verdict.verdict
        self.say(f"full diagnosis: {word}{f', {causes}' if causes else ''}{further}")
        self.say(f"its page is {out / 'report.html'}")
