"""Frames of the machines that edits give: one subject and one maker for each set of edits."""

import shutil
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from identification.words import Tolerance
from mbmodel import Model, machine_model, with_loops
from mbw.workbench.edits import MachineEdit, delay_loops, edit_machine
from mbw.workbench.frames import FrameMaker
from mbw.workbench.state import SessionState, structure_hash
from mbw.workbench.subject import WorkbenchSubject
from tuning import Session, change_machine, parametrise

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
