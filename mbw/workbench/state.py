"""State of the workbench, and the named actions that alone change it.

A state is a frozen value. Every picture and number of the page is a function of it, so that no two
of them can come from different states. Undo and redo walk through states that an action left; what
the page looks at (channel, mode) is no step of that walk.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from identification.readers.result_files import FORMAT
from identification.words import Real, UsageError
from mbw.workbench.edits import MachineEdit

_MAX_UNDO_STEPS = 1000  # a state is small; a day of work by hand has fewer


class _Action(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Move(_Action):
    """Give some coordinates of the parametrisation new values.

    Args:
        values: x of each coordinate, by name.
    """

    do: Literal["move"] = "move"
    values: dict[str, FiniteFloat]


class Look(_Action):
    """Look at another FRF or mode; None keeps what is looked at.

    Args:
        reference: label of the input, with its file if it was measured.
        channel: label of the output.
        mode: number of the mode that is animated; 0 for the machine at rest.
    """

    do: Literal["look"] = "look"
    reference: str | None = None
    channel: str | None = None
    mode: Annotated[int, Field(ge=0)] | None = None


class Put(_Action):
    """Add something to the machine, or give what has its name other sizes.

    Args:
        edit: what is added.
    """

    do: Literal["put"] = "put"
    edit: MachineEdit


class Remove(_Action):
    """Take something that was added off the machine.

    Args:
        name: of what was added.
    """

    do: Literal["remove"] = "remove"
    name: str


class Undo(_Action):
    """Take the last move back."""

    do: Literal["undo"] = "undo"


class Redo(_Action):
    """Make the move again that was taken back last."""

    do: Literal["redo"] = "redo"


Action = Annotated[Move | Look | Put | Remove | Undo | Redo, Field(discriminator="do")]


@dataclass(frozen=True)
class View:
    """Frequency response and mode that the page shows.

    Args:
        reference: label of the input, with its file if it was measured.
        channel: label of the output.
        mode: number of the mode that is animated; 0 for the machine at rest.
    """

    reference: str
    channel: str
    mode: int = 1


@dataclass(frozen=True)
class SessionState:
    """Everything that the page is a function of.

    Args:
        campaign: hash of the files of the campaign; empty without one.
        model: hash of the files of the model.
        view: what the page looks at.
        coordinates: name and x of every coordinate that is not zero, by name; at zero a parameter
            is as drawn.
        edits: what is added to the machine.
        format: version of this layout.
    """

    campaign: str
    model: str
    view: View
    coordinates: tuple[tuple[str, float], ...] = ()
    edits: tuple[MachineEdit, ...] = ()
    format: int = FORMAT

    def x(self, names: tuple[str, ...]) -> Real:
        """Return the coordinates in the order of their names; (n_x,)."""
        values = dict(self.coordinates)
        return np.array([values.get(name, 0.0) for name in names])

    def move(self, values: Mapping[str, float]) -> "SessionState":
        """Return the state with new values of some coordinates."""
        moved = {**dict(self.coordinates), **values}
        kept = tuple((name, float(x)) for name, x in sorted(moved.items()) if x != 0)
        return replace(self, coordinates=kept)

    def add(self, edit: MachineEdit) -> "SessionState":
        """Return the state with an edit in the place of the one of its name, or as the last."""
        bare = self.remove(edit.name)
        if len(bare.edits) == len(self.edits):
            return replace(self, edits=(*self.edits, edit))
        edits = tuple(edit if each.name == edit.name else each for each in self.edits)
        return replace(bare, edits=edits)

    def remove(self, name: str) -> "SessionState":
        """Return the state without an edit; its springs are as stated if it comes back."""
        beginnings = tuple(f"{name}{end}." for end in ("", "_x", "_y", "_z"))  # of its parameters
        return replace(
            self,
            edits=tuple(edit for edit in self.edits if edit.name != name),
            coordinates=tuple(
                pair for pair in self.coordinates if not pair[0].startswith(beginnings)
            ),
        )

    @property
    def structure(self) -> str:
        """Hash of what is added, on which parameters and ports depend."""
        return structure_hash(self.edits)

    @property
    def machine_key(self) -> str:
        """Hash of the machine and its tests, whatever the page looks at."""
        return _hash([self.format, self.campaign, self.model, self.coordinates, self.structure])

    @property
    def key(self) -> str:
        """Hash of everything that the page's numbers depend on."""
        view = self.view
        return _hash([self.machine_key, view.reference, view.channel, view.mode])


def structure_hash(edits: Sequence[MachineEdit]) -> str:
    """Return a hash of edits."""
    return _hash([edit.model_dump() for edit in edits])


def _hash(content: object) -> str:
    """Return a hash of what JSON can hold."""
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


@dataclass(frozen=True)
class History:
    """A state, those before and after it, and the number of actions that led here.

    Args:
        state: the state that the page shows.
        past: states to which undo returns, the nearest last.
        future: states to which redo returns, the nearest last.
        revision: number of actions since the session began.
    """

    state: SessionState
    past: tuple[SessionState, ...] = ()
    future: tuple[SessionState, ...] = ()
    revision: int = 0


def apply(history: History, action: Action) -> History:
    """Return the history after an action; without a past, undo changes nothing but the revision.

    Args:
        history: state with its past and future.
        action: what a user did.
    """
    state, past, future = history.state, history.past, history.future
    match action:
        case Move():
            past, future, state = (*past, state), (), state.move(action.values)
        case Put():
            past, future, state = (*past, state), (), state.add(action.edit)
        case Remove():
            past, future, state = (*past, state), (), state.remove(action.name)
        case Look():
            chosen = action.model_dump(exclude={"do"}, exclude_none=True)
            state = replace(state, view=replace(state.view, **chosen))
        case Undo() if past:
            past, future, state = past[:-1], (*future, state), replace(past[-1], view=state.view)
        case Redo() if future:
            past, future, state = (*past, state), future[:-1], replace(future[-1], view=state.view)
    return History(state, past[-_MAX_UNDO_STEPS:], future, history.revision + 1)


def check_move(values: Mapping[str, float], limits: Mapping[str, tuple[float, float]]) -> None:
    """Refuse coordinates that do not exist or lie beyond their bounds.

    Args:
        values: x of each coordinate, by name.
        limits: bounds of every coordinate.

    Raises:
        UsageError: the sentence names the coordinate and what it may be.
    """
    for name, x in values.items():
        if not x:
            continue  # as drawn, also of a parameter that is no more
        if name not in limits:
            raise UsageError(f"{name} is no parameter of this model: open the page again")
        low, high = limits[name]
        if not low <= x <= high:
            raise UsageError(
                f"{name} lies outside its bounds: its coordinate {x:.4g} is not in "
                f"{low:.4g} .. {high:.4g}; state other bounds under [tuning] of campaign.toml"
            )
