"""The desk: one subject, its state and its log, on which all browsers work in one order.

Frames of the machines that edits give: one subject and one maker for each set of edits.
"""

import shutil
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from threading import Condition, Lock, RLock
from typing import Any

from identification.words import Tolerance, UsageError, shorten_names
from mbmodel import Model, machine_model, with_loops
from mbw.workbench.edits import MachineEdit, added_delays, check_delays, delay_loops, edit_machine
from mbw.workbench.frames import FrameMaker
from mbw.workbench.jobs import Job
from mbw.workbench.opening import show_results
from mbw.workbench.state import (
    Action,
    History,
    Look,
    Move,
    Put,
    SessionState,
    View,
    apply,
    check_move,
    structure_hash,
)
from mbw.workbench.state_log import StateLog
from mbw.workbench.state_study import StateStudy
from mbw.workbench.subject import WorkbenchSubject
from tuning import Session, change_machine, parametrise

_SHOWN = {"tune": "tuned", "diagnose": "diagnosed", "identify": "modes"}  # results by verb


class StaleRevisionError(UsageError):
    """An action of a browser that has not seen the newest state."""


class Desk:
    """State of one subject, changed by actions in one order.

    Args:
        subject: model and tests, without edits.
        log: log of the actions, open for appending.
        folder: of machines with edits; it exists.
        budget: budget.toml; None for no budget.
    """

    def __init__(
        self, subject: WorkbenchSubject, log: StateLog, folder: Path, budget: Path | None = None
    ) -> None:
        self._log, self._folder, self._budget = log, folder, budget
        self._results, self._studies = 0, Lock()
        self._use(subject)
        self._history, self._changed = log.history, Condition(RLock())
        self._make(self._history.state)  # refuses a log that looks at what is no more

    def _use(self, subject: WorkbenchSubject) -> None:
        """Make frames and studies of a subject from now on."""
        self._makers = EditedMakers(subject, self._folder)
        self.plant = StateStudy(subject, self._budget)

    def adopt(self, job: Job, out: Path) -> None:
        """Show the result of a job, if it is curves or modes.

        Args:
            job: that is done.
            out: folder of its result.

        Raises:
            InputError: the result cannot be read.
        """
        name = _SHOWN.get(job.verb)
        if name is None:
            return
        subject = show_results(self.plant.subject, {name: out})
        with self._changed:
            self._use(subject)
            self._results += 1
            self._changed.notify_all()

    def _make(self, state: SessionState) -> bytes:
        """Return the frame of a state."""
        return self._makers.of(state).make(state)

    @property
    def remark(self) -> str:
        """Sentence on what of the state this machine does not have; empty if nothing."""
        state, names = self._history.state, self.subject.parametrisation.names
        gone = [name for name, _ in state.coordinates if name not in names]
        loops = {loop.name for loop in self.plant.loops}
        gone += [f"the delay of {name}" for name in added_delays(state.edits).keys() - loops]
        if not gone:
            return ""
        return f"the state moves what is not there now, and does without it: {shorten_names(gone)}"

    @property
    def subject(self) -> WorkbenchSubject:
        """Model and tests, with the edits of the state."""
        with self._changed:
            return self._makers.of(self._history.state).subject

    @property
    def history(self) -> History:
        """State with its past and future."""
        return self._history

    def frame(self) -> tuple[History, bytes]:
        """Return the state and its frame."""
        with self._changed:
            return self._history, self._make(self._history.state)

    def preview(self, values: dict[str, float], edit: MachineEdit | None = None) -> bytes:
        """Return the frame with some changes, as a slider shows it before it rests.

        Args:
            values: coordinates that move, by name.
            edit: what is added, or gets other sizes; None for nothing.

        Raises:
            UsageError: a coordinate does not exist or lies beyond its bounds, or an edit cannot be.
            InputError: the machine with an edit cannot be read.
            ConvergenceError: it has no static equilibrium.
        """
        with self._changed:
            check_move(values, self.subject.limits)
            state = self._history.state.move(values)
            return self._make(state if edit is None else state.add(edit))

    def act(self, revision: int, action: Action) -> tuple[History, bytes]:
        """Do an action, log it, and return the new state and its frame.

        Args:
            revision: revision of the state that the browser shows.
            action: what a user did.

        Raises:
            StaleRevisionError: another browser acted meanwhile.
            UsageError: the action names what does not exist, or lies beyond bounds.
            InputError: the machine with an edit cannot be read.
            ConvergenceError: it has no static equilibrium.
        """
        with self._changed:
            if revision != self._history.revision:
                raise StaleRevisionError("another window changed the state: this one shows it now")
            if isinstance(action, Move):
                check_move(action.values, self.subject.limits)
            actions = [action]
            history = apply(self._history, action)
            if history.state.edits != self._history.state.edits:
                actions += self._look_at_what_stays(history.state)
                history = reduce(apply, actions, self._history)
            if isinstance(action, Put):
                check_delays(self.plant.loops, (action.edit,))
            frame = self._make(history.state)  # before it counts: it may be impossible
            for each in actions:
                self._log.append(each)
            self._history = history
            self._changed.notify_all()
            return history, frame

    def _look_at_what_stays(self, state: SessionState) -> list[Action]:
        """Return a look at the first FRF where an end of the present one is no more."""
        maker, view = self._makers.of(state), state.view
        if maker.has_ports(view):
            return []
        first: View = maker.subject.first_state().view
        return [Look(reference=first.reference, channel=first.channel)]

    @property
    def _versions(self) -> tuple[int, int]:
        """Revision of the state, and number of results that jobs have brought."""
        return self._history.revision, self._results

    def wait(self, versions: tuple[int, ...], timeout_s: float) -> tuple[int, int]:
        """Wait until revision or results are other ones; return both, also after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._versions != versions, timeout_s)
            return self._versions

    def study(self) -> dict[str, Any]:
        """Return margins and budget of the present state; others may act meanwhile."""
        with self._changed:
            subject, state = self.subject, self._history.state
        with self._studies:
            return self.plant.study(subject, state)

    @property
    def state(self) -> SessionState:
        """State that the page shows."""
        return self._history.state


_MAX_MAKERS = 4  # undo and redo between a few machines read no file


class EditedMakers:
    """Makers of one subject by what is added to its machine.

    Args:
        subject: without edits.
        folder: of the MJCFs with edits; it exists.
    """

    def __init__(self, subject: WorkbenchSubject, folder: Path) -> None:
        self._subject, self._folder = subject, folder
        self.plain = FrameMaker(subject.with_causes())
        self._kept: OrderedDict[tuple[MachineEdit, ...], FrameMaker] = OrderedDict()

    def of(self, state: SessionState) -> FrameMaker:
        """Return the maker for the edits of a state.

        Raises:
            InputError: an edit names a body that is not there, or the machine cannot be read.
            ConvergenceError: the machine has no static equilibrium.
            UsageError: an end or an axis of a spring that cannot be, or a loop that is not there.
        """
        edits = state.edits
        if not edits:
            return self.plain
        if edits not in self._kept:
            folder = self._place(edits)
            folder.mkdir(exist_ok=True)
            subject = edit_subject(self._subject, edits, folder)
            self._kept[edits] = FrameMaker(subject.with_causes(), nominal=self.plain)
            while len(self._kept) > _MAX_MAKERS:
                oldest, _ = self._kept.popitem(last=False)
                shutil.rmtree(self._place(oldest), ignore_errors=True)
        self._kept.move_to_end(edits)
        return self._kept[edits]

    def _place(self, edits: Sequence[MachineEdit]) -> Path:
        """Return the folder of the MJCF with some edits."""
        return self._folder / structure_hash(edits)


def edit_subject(
    subject: WorkbenchSubject, edits: Sequence[MachineEdit], folder: Path
) -> WorkbenchSubject:
    """Return a subject whose machine has what edits add.

    Args:
        subject: without edits.
        edits: what is added.
        folder: of the MJCF with them; it exists as long as the subject is used.
    """
    machine, campaign = subject.model.machine, subject.campaign
    edited = edit_machine(machine, edits, folder)
    if campaign is None:
        model = machine_model(edited)
        varies = parametrise(model, Tolerance())
    else:
        session = Session(subject.source, subject.model, campaign, subject.parametrisation)
        if edited is not machine:
            session = change_machine(session, edited)
        model, varies = session.model, session.parametrisation
    if model.loops:
        loops = delay_loops(model.machine.loops, edits)
        model = Model(with_loops(model.machine, loops), model.parts)
    return replace(
        subject,
        model=model,
        parametrisation=varies,
        edits=tuple(edits),
        unedited=subject.model,
    )
