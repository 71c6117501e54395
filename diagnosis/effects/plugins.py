"""Effects of other packages: refused by name where they cannot be fitted, checked as they propose.

Ours are tested instead. What is asked of every hypothesis: it is called like its entry point, it
frees something, parameters are named once and nothing on the drawing, frames and cores of its Parts
fit the machine, all numbers are finite, slopes are those of the change, and ``state`` gives numbers
where the fit begins. What fails later says whose it is.
"""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Complex, InputError, Real
from mbmodel import AddedPart, Addition, Change, Machine, NotInMjcf, Part, PartContext

GROUP = "mbw.effects"
_KINDS = "joint", "body", "sensor", "hammer", "pair"
_MEND = "mend it or uninstall its package"
_STEP = 1e-3  # beside the beginning: where Parts begin they change nothing
_SMALL, _OFF, _ROUNDING = 1e-4, 1e-2, 1e-9  # of slopes, which are compared with differences
_LINES = 5
_LOG = logging.getLogger(__name__)


def loaded(point: EntryPoint) -> Effect:
    """The effect of an entry point, whose proposals are checked.

    Raises:
        InputError: it cannot be loaded, is no Effect, or does not speak.
    """
    who = named(point.name)
    with _blamed(f"{who}: loading {point.value}"):
        effect = point.load()
    if not isinstance(effect, Effect):
        raise InputError(f"{who}: {point.value} is no Effect: name one, or uninstall its package")
    for name in ("noun", "means", "confirm"):
        text = getattr(effect, name)
        if not isinstance(text, str):
            raise InputError(f"{who}: its {name} is {text!r}, expected words: {_MEND}")
        keys = "{place}, {dof}, {direction} and {channel}"
        with _blamed(f"{who}: filling in {name}, which may name {keys},"):
            effect.said(text, "joint:stage", "tx")
    return replace(effect, propose=_Guarded(point.name, effect.propose))


def named(name: str) -> str:
    """An entry point, as errors call it."""
    return f"entry point {name} of {GROUP}"


@contextmanager
def _blamed(what: str) -> Iterator[None]:
    """Whatever others' code raises, with who raised it."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{what} fails ({type(error).__name__}: {error}): {_MEND}") from error


@dataclass(frozen=True, eq=False)
class _Guarded:
    """A proposal whose hypotheses are checked.

    Args:
        name: of the entry point.
        propose: the effect's own.
    """

    name: str
    propose: Callable[[Scene], Any]

    def __call__(self, scene: Scene) -> tuple[Hypothesis, ...]:
        """All its hypotheses.

        Raises:
            InputError: it fails, or one of them cannot be fitted.
        """
        who = named(self.name)
        with _blamed(f"{who}: propose, which takes a Scene and yields Hypothesis objects,"):
            made = tuple(self.propose(scene))
        found, seen = [], dict[str, Part]()
        for one in made:
            if not isinstance(one, Hypothesis):
                raise InputError(f"{who}: it proposes {one!r}: yield Hypothesis objects")
            told = f"{who}, {one.words}"
            if one.effect != self.name:
                raise InputError(
                    f"{told}: its effect is called {one.effect!r}: call both alike, it and the "
                    "entry point"
                )
            with _blamed(f"{told}: checking it"):
                fault = _fault(one, scene, seen) or _misfit(one, scene)
            if fault:
                raise InputError(f"{told}: {fault}")
            with _blamed(f"{told}: state, at the values where the fit begins,"):
                _numbers(one.state(_beginning(one, scene)))
            guarded = tuple(_guarded(part, told) for part in one.parts)
            found.append(replace(one, parts=guarded, state=_Stated(told, one.state)))
        return tuple(found)


def _guarded(part: Part, told: str) -> Part:
    """The same Part, that says whose it is where it fails far from where it was checked."""
    if not isinstance(part, AddedPart):
        return part
    finite, slopes = (
        _Blaming(f"{told}: {name}, away from zero,", call)
        for name, call in (("finite", part.finite), ("derivatives", part.derivatives))
    )
    written = None if part.written is None else _Written(told, part.written)
    return replace(part, finite=finite, derivatives=slopes, written=written)


@dataclass(frozen=True, eq=False)
class _Blaming:
    """A function of others, that says whose it is where it fails."""

    told: str
    call: Callable[..., Any]

    def __call__(self, *given: Any) -> Any:
        with _blamed(self.told):
            return self.call(*given)


@dataclass(frozen=True, eq=False)
class _Written:
    """How a Part is written into an MJCF; where that fails, why the file does not hold it."""

    told: str
    call: Callable[..., Any]

    def __call__(self, theta: Real) -> tuple[Addition | NotInMjcf, ...]:
        try:
            return tuple(self.call(theta))
        except Exception as error:
            return (NotInMjcf(self.told, f"written fails ({type(error).__name__}: {error})"),)


def _fault(one: Hypothesis, scene: Scene, seen: dict[str, Part]) -> str | None:
    """What is wrong with what a hypothesis says of itself.

    Args:
        one: the hypothesis.
        scene: for which it was proposed.
        seen: Parts of those before, by the names of their parameters; grows.
    """
    if not (one.dof is None or isinstance(one.dof, str)):
        return f"its dof is {one.dof!r}: say a word, such as tx, or None"
    if one.location.partition(":")[0] not in _KINDS:
        return f"it is at {one.location!r}: begin with one of {', '.join(_KINDS)}, and a colon"
    if not (one.coordinates or one.correct):
        return "it frees nothing: give it parts, or tolerances to release"
    return _misnamed(one, scene, seen)


def _misnamed(one: Hypothesis, scene: Scene, seen: dict[str, Part]) -> str | None:
    """What is wrong with the names of parameters; arguments as of ``_fault``."""
    own = set()
    for part in one.parts:
        for parameter in part.parameters:
            name = parameter.name
            if name in own or seen.setdefault(name, part) is not part:
                return f"its parameter {name} is named twice: name each of every Part differently"
            own.add(name)
            if name not in one.follow and (parameter.drawn != 0 or parameter.positive):
                return (
                    f"its parameter {name} is drawn as {parameter.drawn:g}, as something on the "
                    "drawing: say drawn 0.0 and positive=False"
                )
    varies = set(scene.session.parametrisation.names)
    there = {parameter.name for parameter in scene.model.parameters}
    begun = {name for values in (one.begin, *one.otherwise) for name in values}
    unknown = {*one.release, *one.scored} - own - varies
    unknown |= {*one.follow, *one.bounds, *one.believed} - own
    unknown |= {*begun, *one.follow.values()} - own - there
    if unknown:
        return f"it names {', '.join(sorted(unknown))}: say parameters that are there and vary"
    return None


def _misfit(one: Hypothesis, scene: Scene) -> str | None:
    """What is wrong with the changes of its Parts and their slopes, where the fit begins."""
    machine, campaign = scene.model.machine, scene.session.campaign
    laplace = np.asarray(2j * np.pi * campaign.freq_hz[campaign.freq_hz > 0], complex)
    begins = _beginning(one, scene)
    for part in one.parts:
        names = [parameter.name for parameter in part.parameters]
        theta = np.array([begins[name] for name in names])
        beside = [np.clip(begins[n] + _STEP, *one.bounds.get(n, (-np.inf, np.inf))) for n in names]
        step = _SMALL * np.ones(len(names))
        for condition in {test.condition: None for test in campaign.tests}:
            at = PartContext(machine, condition)
            for slope in part.slopes(theta, at):
                if fault := _unfit(slope, (len(names),), machine, laplace):
                    return f"of a slope {fault}"
            for change in part.changes(np.array(beside), at):
                if fault := _unfit(change, (), machine, laplace):
                    return f"of a change {fault}"
            middle, few = np.array(beside), laplace[:: max(1, len(laplace) // _LINES)]
            ahead, behind = (part.changes(middle + sign * step, at) for sign in (1, -1))
            moved = [
                replace(slope, core=np.tensordot(step, slope.core, 1))
                for slope in part.slopes(middle, at)
            ]
            if _differ(_stiffness(ahead, few), _stiffness(behind, few), _stiffness(moved, few)):
                return "its slopes are not those of its change: derive them anew"
    return None


def _stiffness(changes: Sequence[Change], laplace: Complex) -> dict[tuple[str, str], Complex]:
    """Dynamic stiffness of all changes of a slot and point; (n_line, n, m) each."""
    found: dict[tuple[str, str], Complex] = {}
    for change in changes:
        powers = laplace[:, None] ** np.arange(3)
        if change.shape is not None:
            powers = powers * change.shape(laplace)[:, None]
        core = np.einsum("fk,krt->frt", powers, change.core)
        key = change.slot, str(change.point)
        found[key] = found.get(key, 0.0) + change.left @ core @ change.right.T
    return found


def _differ(
    ahead: dict[tuple[str, str], Complex],
    behind: dict[tuple[str, str], Complex],
    moved: dict[tuple[str, str], Complex],
) -> bool:
    """Whether half the way from behind to ahead is not what the slopes say."""
    for key in {*ahead, *behind, *moved}:
        one, other, slope = (at.get(key, np.zeros(1)) for at in (ahead, behind, moved))
        off = np.abs((one - other) / 2 - slope).max()
        if off > _OFF * np.abs(slope).max() + _ROUNDING * np.abs(one).max():
            return True
    return False


def _unfit(change: Change, lead: tuple[int, ...], machine: Machine, laplace: Complex) -> str | None:
    """What is wrong with a change; ``lead`` are the axes of its core before those of a change."""
    bodies, joints = len(machine.body_mass), len(machine.coordinates)
    sizes = {
        "body": (bodies, bodies),
        "joint": (joints, joints),
        "path": (bodies, joints),
        "sensor": (6, bodies),
        "hammer": (6, bodies),
        "input": (1, 1),
        "output": (6, 1),
    }
    is_known = (
        change.slot not in ("sensor", "hammer", "output") or change.point in machine.layout.points
    )
    if change.slot not in sizes or not is_known:
        return (
            f"the slot is {change.slot!r} and the point {change.point!r}: say one of "
            f"{', '.join(sizes)}, of a sensor, hammer or output with a point of the machine"
        )
    left, right, core = (
        np.asarray(each, float) for each in (change.left, change.right, change.core)
    )
    rows, columns = sizes[change.slot]
    if left.ndim != 2 or right.ndim != 2 or (len(left), len(right)) != (rows, columns):
        return (
            f"the frames are {left.shape} and {right.shape}, expected ({rows}, r) and "
            f"({columns}, t) in the slot {change.slot} of this machine"
        )
    expected = (*lead, 3, left.shape[1], right.shape[1])
    if core.shape != expected:
        return f"the core is {core.shape}, expected {expected}"
    if not all(np.isfinite(each).all() for each in (left, right, core)):
        return "a frame or the core holds nan or infinity: all must be finite"
    if change.shape is not None:
        values = np.asarray(change.shape(laplace))
        if values.shape != laplace.shape or not np.isfinite(values).all():
            return f"the shape gives {values.shape} values, expected {laplace.shape} finite ones"
    return None


def _beginning(one: Hypothesis, scene: Scene) -> dict[str, float]:
    """All parameters in SI by name, where a fit of the hypothesis begins."""
    there = zip(scene.model.parameters, scene.theta.tolist(), strict=True)
    begins = {parameter.name: value for parameter, value in there}
    begins |= {parameter.name: 0.0 for part in one.parts for parameter in part.parameters}
    begins |= one.begin
    return begins | {name: begins[other] for name, other in one.follow.items()}


@dataclass(eq=False)
class _Stated:
    """What a hypothesis states; where that fails, nothing, which is said once.

    A cause is worth more than its size: a diagnosis of minutes is not lost with it.

    Args:
        told: entry point and hypothesis.
        state: the hypothesis' own.
        failed: whether it did.
    """

    told: str
    state: Callable[[Mapping[str, float]], Any]
    failed: bool = False

    def __call__(self, found: Mapping[str, float]) -> dict[str, Value]:
        """Parameters of the verdict."""
        try:
            return _numbers(self.state(found))
        except Exception as error:
            if not self.failed:
                _LOG.warning(
                    "%s: state fails at fitted values (%s: %s): sizes of this cause, or their "
                    "intervals, are not stated or too narrow; mend state",
                    self.told,
                    type(error).__name__,
                    error,
                )
            self.failed = True
            return {}


def _numbers(stated: Any) -> dict[str, Value]:
    """Finite numbers and vectors by name.

    Raises:
        ValueError: something else.
    """
    found: dict[str, Value] = {}
    for name, value in dict(stated).items():
        array = np.asarray(value, float)
        if not (isinstance(name, str) and array.ndim < 2 and np.isfinite(array).all()):
            raise ValueError(f"{name!r} is {value!r}, expected a finite number or a vector of them")
        vector = value if isinstance(value, tuple) else tuple(np.ravel(array).tolist())
        found[name] = vector if array.ndim else float(array)
    return found
