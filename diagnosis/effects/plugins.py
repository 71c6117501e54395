"""Effects of other packages: they are loaded by entry points and checked as they propose.

Effects of this project have tests instead. If a function of a plug-in fails later, at fitted
values, the error names its entry point.
"""

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import Any

from diagnosis.effects.plugin_checks import find_fault, list_start_values, read_numbers
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.stated_values import Value
from identification.words import InputError, Real
from mbmodel import AddedPart, Addition, MjcfLack, NotInMjcf, Part

GROUP = "mbw.effects"
_MEND = "mend it or uninstall its package"
_LOG = logging.getLogger(__name__)


def load_effect(point: EntryPoint) -> Effect:
    """Return the effect of an entry point, whose proposals are checked.

    Raises:
        InputError: the entry point cannot be loaded, is no Effect, or has invalid words.
    """
    label = describe_entry_point(point.name)
    with _blame(f"{label}: loading {point.value}"):
        effect = point.load()
    if not isinstance(effect, Effect):
        raise InputError(f"{label}: {point.value} is no Effect: name one, or uninstall its package")
    for name in ("noun", "means", "confirm"):
        text = getattr(effect, name)
        if not isinstance(text, str):
            raise InputError(f"{label}: its {name} is {text!r}, expected words: {_MEND}")
        keys = "{place}, {dof}, {direction} and {channel}"
        with _blame(f"{label}: filling in {name}, which may name {keys},"):
            effect.describe(text, "joint:stage", "tx")
    return replace(effect, propose=CheckedProposal(point.name, effect.propose))


def describe_entry_point(name: str) -> str:
    """Return an entry point's name for errors."""
    return f"entry point {name} of {GROUP}"


@contextmanager
def _blame(what: str) -> Iterator[None]:
    """Raise any exception of a plug-in as an error that names the plug-in."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{what} fails ({type(error).__name__}: {error}): {_MEND}") from error


@dataclass(frozen=True, eq=False)
class CheckedProposal:
    """Proposal whose hypotheses are checked.

    Args:
        name: name of the entry point.
        propose: proposal of the effect.
    """

    name: str
    propose: Callable[[Scene], Any]

    def __call__(self, scene: Scene) -> tuple[Hypothesis, ...]:
        """Return the hypotheses for a scene.

        Raises:
            InputError: the proposal fails, or a hypothesis cannot be fitted.
        """
        label = describe_entry_point(self.name)
        with _blame(f"{label}: propose, which takes a Scene and yields Hypothesis objects,"):
            proposed = tuple(self.propose(scene))
        checked, seen = [], dict[str, Part]()
        for hypothesis in proposed:
            if not isinstance(hypothesis, Hypothesis):
                raise InputError(f"{label}: it proposes {hypothesis!r}: yield Hypothesis objects")
            owner = f"{label}, {hypothesis.words}"
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
    """Return a Part whose later errors, at other values than checked, name the plug-in."""
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
    """Function of a plug-in, whose errors name the plug-in."""

    owner: str
    call: Callable[..., Any]

    def __call__(self, *given: Any) -> Any:
        with _blame(self.owner):
            return self.call(*given)


@dataclass(frozen=True, eq=False)
class _GuardedWriter:
    """Writer of MJCF elements; its error is the reason why the file lacks them."""

    owner: str
    call: Callable[..., Any]

    def __call__(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        try:
            return tuple(self.call(theta))
        except Exception as error:
            name = f"{self.owner}, where written fails with {type(error).__name__}: {error}"
            return (NotInMjcf(name, MjcfLack.OTHER_PACKAGE),)


@dataclass(eq=False)
class _GuardedStatement:
    """Statement of parameters; if it fails, none are stated, and one warning is logged.

    The diagnosis goes on, because a cause without its size is still a result.

    Args:
        owner: entry point and hypothesis.
        state: statement of the hypothesis.
        has_failed: whether it failed before.
    """

    owner: str
    state: Callable[[Mapping[str, float]], Any]
    has_failed: bool = False

    def __call__(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return parameters of the verdict."""
        try:
            return read_numbers(self.state(fitted))
        except Exception as error:
            if not self.has_failed:
                _LOG.warning(
                    "%s: state fails at fitted values (%s: %s): sizes of this cause, or their "
                    "intervals, are not stated or too narrow; mend state",
                    self.owner,
                    type(error).__name__,
                    error,
                )
            self.has_failed = True
            return {}
