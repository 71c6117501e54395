"""Full diagnosis of the accepted hits at the stop, as a job of the workbench."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

from diagnosis import Verdict
from identification.words import WorkbenchError
from mbw.live.findings import write_accepted
from mbw.live.test import LiveTest, Sheet
from mbw.workbench.jobs import Job, JobQueue
from mbw.workbench.opening import open_subject
from tuning import write_atomically
from tuning.files.plant_folder import VERDICT


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
        places = sheet.complete
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
        Thread(target=self._add, args=(self._queue, snapshot), daemon=True).start()

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
