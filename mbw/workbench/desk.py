"""The desk: one subject, its state and its log, on which all browsers work in one order."""

from threading import Condition

from identification.words import UsageError
from mbw.workbench.frames import FrameMaker
from mbw.workbench.state import Action, History, Move, SessionState, apply, check_move
from mbw.workbench.state_log import StateLog


class StaleRevisionError(UsageError):
    """An action of a browser that has not seen the newest state."""


class Desk:
    """State of one subject, changed by actions in one order.

    Args:
        maker: maker of the frames.
        log: log of the actions, open for appending.
    """

    def __init__(self, maker: FrameMaker, log: StateLog) -> None:
        self.maker, self._log = maker, log
        self._history, self._changed = log.history, Condition()
        self.maker.make(self._history.state)  # refuses a log that looks at what is no more

    @property
    def history(self) -> History:
        """State with its past and future."""
        return self._history

    def frame(self) -> tuple[History, bytes]:
        """Return the state and its frame."""
        with self._changed:
            return self._history, self.maker.make(self._history.state)

    def preview(self, values: dict[str, float]) -> bytes:
        """Return the frame with some coordinates moved, as a slider shows it before it rests.

        Raises:
            UsageError: a coordinate does not exist or lies beyond its bounds.
        """
        check_move(values, self.maker.subject.limits)
        with self._changed:
            return self.maker.make(self._history.state.move(values))

    def act(self, revision: int, action: Action) -> tuple[History, bytes]:
        """Do an action, log it, and return the new state and its frame.

        Args:
            revision: revision of the state that the browser shows.
            action: what a user did.

        Raises:
            StaleRevisionError: another browser acted meanwhile.
            UsageError: the action names what does not exist, or lies beyond bounds.
        """
        if isinstance(action, Move):
            check_move(action.values, self.maker.subject.limits)
        with self._changed:
            if revision != self._history.revision:
                raise StaleRevisionError("another window changed the state: this one shows it now")
            history = apply(self._history, action)
            frame = self.maker.make(history.state)  # before it counts: it may be impossible
            self._log.append(action)
            self._history = history
            self._changed.notify_all()
            return history, frame

    def wait(self, revision: int, timeout_s: float) -> int:
        """Wait until the revision is another one; return it, also after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._history.revision != revision, timeout_s)
            return self._history.revision

    @property
    def state(self) -> SessionState:
        """State that the page shows."""
        return self._history.state
