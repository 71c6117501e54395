"""Effects of other packages: loaded by entry points, refused by name, checked as they propose.

Effects of this project are tested instead. A function of a plug-in that fails later, at fitted
values, names its entry point.
"""

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import Any

from diagnosis.effects.plugin_checks import find_fault, list_start_values, read_numbers
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import InputError, Real
from mbmodel import AddedPart, Addition, NotInMjcf, Part

GROUP = "mbw.effects"
_MEND = "mend it or uninstall its package"
_LOG = logging.getLogger(__name__)


def load_effect(point: EntryPoint) -> Effect:
    """Return the effect of an entry point, whose proposals are checked.

    Raises:
        InputError: it cannot be loaded, is no Effect, or its words cannot be filled in.
    """
    who = describe_entry_point(point.name)
    with _blame(f"{who}: loading {point.value}"):
        effect = point.load()
    if not isinstance(effect, Effect):
        raise InputError(f"{who}: {point.value} is no Effect: name one, or uninstall its package")
    for name in ("noun", "means", "confirm"):
        text = getattr(effect, name)
        if not isinstance(text, str):
            raise InputError(f"{who}: its {name} is {text!r}, expected words: {_MEND}")
        keys = "{place}, {dof}, {direction} and {channel}"
        with _blame(f"{who}: filling in {name}, which may name {keys},"):
            effect.describe(text, "joint:stage", "tx")
    return replace(effect, propose=_CheckedProposal(point.name, effect.propose))


def describe_entry_point(name: str) -> str:
    """Return an entry point's name for errors."""
    return f"entry point {name} of {GROUP}"


@contextmanager
def _blame(what: str) -> Iterator[None]:
    """Raise whatever code of a plug-in raises as an error that names the plug-in."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{what} fails ({type(error).__name__}: {error}): {_MEND}") from error


@dataclass(frozen=True, eq=False)
class _CheckedProposal:
    """A proposal whose hypotheses are checked.

    Args:
        name: of the entry point.
        propose: proposal of the effect.
    """

    name: str
    propose: Callable[[Scene], Any]

    def __call__(self, scene: Scene) -> tuple[Hypothesis, ...]:
        """Return its hypotheses.

        Raises:
            InputError: it fails, or one of them cannot be fitted.
        """
        who = describe_entry_point(self.name)
        with _blame(f"{who}: propose, which takes a Scene and yields Hypothesis objects,"):
            proposed = tuple(self.propose(scene))
        checked, seen = [], dict[str, Part]()
        for hypothesis in proposed:
            if not isinstance(hypothesis, Hypothesis):
                raise InputError(f"{who}: it proposes {hypothesis!r}: yield Hypothesis objects")
            owner = f"{who}, {hypothesis.words}"
            if hypothesis.effect != self.name:
                raise InputError(
                    f"{owner}: its effect is called {hypothesis.effect!r}: call both alike, it "
                    "and the entry point"
                )
            with _blame(f"{owner}: checking it"):
                fault = find_fault(hypothesis, scene, seen)
            if fault:
                raise InputError(f"{owner}: {fault}")
            with _blame(f"{owner}: state, at the values where the fit begins,"):
                read_numbers(hypothesis.state(list_start_values(hypothesis, scene)))
            guarded = tuple(_guard_part(part, owner) for part in hypothesis.parts)
            checked.append(
                replace(hypothesis, parts=guarded, state=_GuardedStatement(owner, hypothesis.state))
            )
        return tuple(checked)


def _guard_part(part: Part, owner: str) -> Part:
    """Return a Part whose errors, far from where it was checked, name the plug-in."""
    if not isinstance(part, AddedPart):
        return part
    finite, slopes = (
        _BlamingCall(f"{owner}: {name}, away from zero,", call)
        for name, call in (("finite", part.finite), ("derivatives", part.derivatives))
    )
    written = None if part.written is None else _GuardedWriter(owner, part.written)
    return replace(part, finite=finite, derivatives=slopes, written=written)


@dataclass(frozen=True, eq=False)
class _BlamingCall:
    """A function of a plug-in, whose errors name it."""

    owner: str
    call: Callable[..., Any]

    def __call__(self, *given: Any) -> Any:
        with _blame(self.owner):
            return self.call(*given)


@dataclass(frozen=True, eq=False)
class _GuardedWriter:
    """A writer of MJCF elements; where it fails, its error is why the file lacks them."""

    owner: str
    call: Callable[..., Any]

    def __call__(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        try:
            return tuple(self.call(theta))
        except Exception as error:
            return (NotInMjcf(self.owner, f"written fails ({type(error).__name__}: {error})"),)


@dataclass(eq=False)
class _GuardedStatement:
    """A statement of parameters; where it fails, none are stated, and one warning is logged.

    A cause is worth more than its size, so the diagnosis goes on.

    Args:
        owner: entry point and hypothesis.
        state: statement of the hypothesis.
        failed: whether it failed before.
    """

    owner: str
    state: Callable[[Mapping[str, float]], Any]
    failed: bool = False

    def __call__(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return parameters of the verdict."""
        try:
            return read_numbers(self.state(fitted))
        except Exception as error:
            if not self.failed:
                _LOG.warning(
                    "%s: state fails at fitted values (%s: %s): sizes of this cause, or their "
                    "intervals, are not stated or too narrow; mend state",
                    self.owner,
                    type(error).__name__,
                    error,
                )
            self.failed = True
            return {}
