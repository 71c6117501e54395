"""Answers of the server for the workbench: frames, actions, previews, jobs and tasks."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from mbw.workbench.desk import Desk
from mbw.workbench.jobs import JobQueue
from mbw.workbench.requests import ActRequest, JobRequest, PreviewRequest
from mbw.workbench.server import PageAnswer, list_assets
from mbw.workbench.session_data import scene_data, session_data
from mbw.workbench.state import History

_SCRIPTS = [
    f"workbench/{name}.js"
    for name in ("main", "curves", "scene", "sliders", "edits", "jobs", "exchange")
]


@dataclass(frozen=True, eq=False)
class Workbench:
    """State, frames and tasks that the server offers to the page.

    Args:
        desk: state and frames.
        jobs: verbs of the command line that run on what the page shows.
        tasks: what the page's buttons ask for, by name: each returns sentences.
        announce: told each new address; the first one is not announced.
    """

    desk: Desk
    jobs: JobQueue
    tasks: dict[str, Callable[[], list[str]]]
    announce: Callable[[str], None] = field(default=lambda address: None)
    assets: ClassVar[Mapping[str, tuple[str, str]]] = list_assets("workbench/index.html", *_SCRIPTS)

    def read(self, path: str, query: Mapping[str, str]) -> PageAnswer | None:
        """Return data of the page; None if there is no such address."""
        del query
        if path == "/frame":
            return _describe_frame(*self.desk.frame())
        if number := re.fullmatch(r"/result/(\d{1,6})", path):
            return self._read_result(int(number[1]))
        return PageAnswer.of(_DATA[path](self)) if path in _DATA else None

    def perform(self, task: str, content: bytes) -> PageAnswer | None:
        """Do an action, show a preview of one, or run a task; None if there is no such task."""
        if task == "act":
            act = ActRequest.model_validate_json(content)
            return _describe_frame(*self.desk.act(act.revision, act.action))
        if task == "preview":
            preview = PreviewRequest.model_validate_json(content)
            return PageAnswer(self.desk.preview(preview.values, preview.edit))
        if task == "jobs":
            request = JobRequest.model_validate_json(content)
            return PageAnswer.of({"sentences": request.run(self.jobs, self.desk)})
        return PageAnswer.of({"sentences": self.tasks[task]()}) if task in self.tasks else None

    def wait(self, versions: tuple[int, ...], timeout_s: float) -> tuple[int, ...]:
        """Wait for another revision, or further results of jobs."""
        return self.desk.wait(versions, timeout_s)

    def _read_result(self, number: int) -> PageAnswer | None:
        """Return the page of a job's result, whose scripts get no access to this server.

        It has a policy of its own, which allows its scripts by their hashes.
        """
        page = self.jobs.page(number)
        if page is None:
            return None
        alone = {
            "Content-Security-Policy": "sandbox allow-scripts; frame-ancestors 'none'",
            "Cross-Origin-Opener-Policy": "unsafe-none",
        }
        return PageAnswer(page.read_bytes(), "text/html; charset=utf-8", alone)


_DATA: dict[str, Callable[[Workbench], dict[str, Any]]] = {
    "/session": lambda shown: session_data(shown.desk.subject, shown.desk.plant),
    "/scene": lambda shown: scene_data(shown.desk.subject, shown.desk.plant.subject),
    "/study": lambda shown: shown.desk.study(),
    "/jobs": lambda shown: {"jobs": shown.jobs.list_jobs()},
}


def _describe_frame(history: History, frame: bytes) -> PageAnswer:
    """Return a frame with its revision and whether there is something to undo and redo."""
    header = {
        "Revision": str(history.revision),
        "Undo-Steps": str(len(history.past)),
        "Redo-Steps": str(len(history.future)),
    }
    return PageAnswer(frame, header=header)
