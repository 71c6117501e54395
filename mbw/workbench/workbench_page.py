"""Answers of the server for the workbench: frames, actions, previews, jobs and tasks.

Data that the page loads once: parameters with intervals, channels, and the machine in 3-D.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from mbmodel import machine_geometry
from mbw.page.picture import picture_data
from mbw.workbench.desk import Desk
from mbw.workbench.edits import AddedDelay
from mbw.workbench.jobs import JobQueue
from mbw.workbench.requests import ActRequest, JobRequest, PreviewRequest
from mbw.workbench.server import PageAnswer, list_assets
from mbw.workbench.state import History, structure_hash
from mbw.workbench.state_study import StateStudy
from mbw.workbench.subject import WorkbenchSubject, port_labels
from tuning.files.parameter_rows import finite_or_none


def session_data(subject: WorkbenchSubject, plant: StateStudy) -> dict[str, Any]:
    """Return names, parameters, channels and lines of a subject, as JSON can hold them."""
    machine, campaign = subject.model.machine, subject.campaign
    diagnosed = plant.subject.diagnosed_x()
    labels = port_labels(machine.layout)
    measured = (
        {}
        if campaign is None
        else {
            name: [
                str(dof)
                for dof, seen in zip(
                    test.estimate.frf.outputs, test.estimate.measured[:, 0].tolist(), strict=True
                )
                if seen
            ]
            for name, test in zip(subject.tests, campaign.tests, strict=True)
        }
    )
    return {
        "name": subject.name,
        "model": machine.name,
        "path": str(subject.path),
        "measured": measured,
        "ports": {name: subject.find_port(name) for name in subject.tests},
        "inputs": [*machine.motors, *labels],
        "outputs": labels,
        "quantity": subject.quantity,
        "freq": [float(f"{value:.7g}") for value in subject.freq_hz.tolist()],
        "parameters": _parameter_rows(subject),
        "tuned": subject.tuned_x(),
        "diagnosed": diagnosed,
        "verdict": None if subject.verdict is None else subject.verdict.describe(diagnosed),
        "curves": [*(["measured"] if measured else []), "drawn", *subject.stored, "current"],
        "logarithmic": campaign is None,
        "has_page": subject.result is not None,
        "has_measured_modes": subject.measured_modes is not None,
        "remarks": list(subject.remarks),
        "masses": _list_masses(plant.subject),
        "names": _list_names(plant.subject),
        "structure": structure_hash(subject.edits),
        "loops": [loop.name for loop in plant.loops],
        "has_study": plant.is_wanted,
    }


def _list_names(plain: WorkbenchSubject) -> list[str]:
    """Return names that an addition cannot have."""
    machine = plain.model.machine
    springs = (spring.name for spring in machine.springs)
    return [*machine.layout.bodies, *machine.layout.points, *springs, *machine.coordinates]


def _list_masses(plain: WorkbenchSubject) -> dict[str, float]:
    """Return the mass of each body that edits may name [kg]."""
    machine = plain.model.machine
    masses = np.diag(machine.body_mass)[::6].tolist()
    return dict(zip(machine.layout.bodies, masses, strict=True))


def _parameter_rows(subject: WorkbenchSubject) -> list[dict[str, Any]]:
    """Return a row for each coordinate, in x: value = drawn exp(scale x) or drawn + scale x."""
    varies, model = subject.parametrisation, subject.model
    first = np.array([varies.coordinate_of.tolist().index(k) for k in range(varies.size)], int)
    rows = () if subject.tuned is None else subject.tuned.parameters
    determined = {row.name: row for row in rows if row.seen and row.low is not None}
    ends = [
        subject.coordinates({name: getattr(row, end) for name, row in determined.items()})
        for end in ("low", "high")
    ]
    return [
        {
            "name": name,
            "location": model.locations[index],
            "unit": varies.parameters[index].unit,
            "drawn": float(varies.fixed[index]),
            "scale": float(varies.scale[index]),
            "log": bool(varies.is_logarithmic[k]),
            "tolerance": bool(varies.is_tolerance[k]),
            "low": finite_or_none(varies.lower[k]),
            "high": finite_or_none(varies.upper[k]),
            "sd": float(varies.precision[k] ** -0.5) if varies.precision[k] > 0 else None,
            "interval": [end[name] for end in ends] if name in determined else None,
        }
        for k, (name, index) in enumerate(zip(varies.names, first.tolist(), strict=True))
    ]


def scene_data(subject: WorkbenchSubject, plain: WorkbenchSubject) -> dict[str, Any]:
    """Return the machine at rest in 3-D: surfaces, points and lines, and what is added to it.

    Args:
        subject: with the edits of a state.
        plain: without edits, from whose centres of mass the points of edits count.
    """
    machine, layout = subject.model.machine, plain.model.machine.layout
    at_rest = np.zeros((0, 6 * len(machine.layout.bodies)), complex)
    data: dict[str, Any] = picture_data(machine.layout, machine_geometry(machine), at_rest)
    for point, axes in zip(data["points"], machine.layout.axes, strict=True):
        point["axes"] = np.round(axes.T, 6).ravel().tolist()
    bodies = machine.layout.bodies
    marks = [
        {
            "name": edit.name,
            "stage": bodies.index(edit.name if edit.name in bodies else edit.body),
            "place": (layout.centres[layout.bodies.index(edit.body)] + edit.point).tolist(),
            "kind": "edit",
        }
        for edit in subject.edits
        if not isinstance(edit, AddedDelay)
    ]
    if subject.verdict is not None:
        marks += subject.verdict.list_marks(machine)
    return {**data, "marks": marks}


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
