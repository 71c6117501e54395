"""``mbw open``: a server on this computer for the page of one campaign, model or result."""

import webbrowser
from importlib import import_module
from pathlib import Path

import numpy as np

from identification.readers.result_files import ResultFile
from identification.words.file_access import temporary_folder
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions, default_folder
from mbw.workbench.desk import Desk
from mbw.workbench.jobs import JobQueue
from mbw.workbench.opening import open_subject
from mbw.workbench.saving import save_state
from mbw.workbench.server import start_server
from mbw.workbench.state import SessionState
from mbw.workbench.state_log import log_path, open_log
from mbw.workbench.subject import WorkbenchSubject
from mbw.workbench.workbench_page import Workbench

_USUAL_STATE = "work"  # whose name the folder of a saved model leaves out


class OpenedState(ResultFile):
    """State of the workbench when it ended.

    Args:
        path: what was opened.
        state: name of the state.
        log: file of its actions.
        parameters: value of each parameter that is not as drawn [SI].
    """

    path: str
    state: str
    log: str
    parameters: dict[str, float]


def run(  # noqa: PLR0913  # one for each option
    path: Path,
    *,
    state: str,
    port: int,
    browser: bool,
    band: tuple[float, float] | None,
    key: str | None,
    budget: Path | None,
    out: Path | None,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.open.options`` describes them.

    Raises:
        InputError: the path cannot be opened, or the port is in use.
    """
    with SCREEN.status(f"opening {path}"):
        subject = open_subject(path, band, key)
    first = subject.first_state()
    with temporary_folder() as place, open_log(log_path(path, state, first), first) as log:
        if log.remark:
            SCREEN.say(log.remark)
        desk = Desk(subject, log, place, budget)
        if desk.remark:
            SCREEN.say(desk.remark)
        outputs = ResultOptions(out, overwrite=overwrite)
        suffix = "opened" if state == _USUAL_STATE else f"opened-{state}"
        tasks = {"save": lambda: save_state(desk.subject, desk.state, outputs, suffix)}
        if subject.result is not None:
            tasks["export"] = lambda: [_export(subject, out, overwrite=overwrite)]

        def announce(address: str) -> None:
            SCREEN.say(f"address for a further browser: {address}")

        jobs = JobQueue(log.path.with_suffix(".jobs"), desk.adopt)
        with start_server(Workbench(desk, jobs, tasks, announce), port) as server:
            jobs.show_again()
            jobs.begin()
            SCREEN.say(f"workbench of {subject.name}: {server.address}")
            SCREEN.say(f"actions are kept in {log.path}; Ctrl-C ends the workbench")
            if browser:
                webbrowser.open(server.address)
            try:
                server.serve_forever()
            except KeyboardInterrupt:
                SCREEN.say(f"the state {state} is kept: open {path} again to go on")
            finally:
                jobs.close()
        if json is not None:
            write_json(_summary(desk.subject, desk.state, state, log.path), json)


def _export(subject: WorkbenchSubject, out: Path | None, *, overwrite: bool) -> str:
    """Write the page of the result as one HTML file; return a sentence on where it is."""
    folder = out or default_folder(subject.source, "opened")
    # Loaded here: with what all pages need it would slow down every opening.
    page = import_module("mbw.report.verb").run(subject.path, folder, overwrite=overwrite)
    return f"the page of the result is {page}"


def _summary(subject: WorkbenchSubject, state: SessionState, name: str, log: Path) -> str:
    """Return the parameters at the end, as JSON."""
    varies = subject.parametrisation
    theta = varies.theta(state.x(varies.names))
    moved = np.flatnonzero(theta != varies.fixed)
    values = {varies.parameters[k].name: float(theta[k]) for k in moved.tolist()}
    summary = OpenedState(path=str(subject.path), state=name, log=str(log), parameters=values)
    return summary.model_dump_json(indent=1)
