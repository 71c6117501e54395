"""Hypothesis: an effect at a place, ready to be fitted."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from diagnosis.labels import name_direction, name_place
from diagnosis.refit_record import RefitRecord
from identification.words import Campaign, Real
from mbmodel import Machine, Model, Part, RigidDirection
from tuning import Session

Value = float | tuple[float, ...]
Ends = tuple[float, float] | tuple[tuple[float, float], ...]  # of a vector one pair a component


class Vague(tuple[float, ...]):
    """A vector with a component that is a convention, of which nothing is known: no interval."""

    __slots__ = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """Fit from which hypotheses are proposed.

    Args:
        session: campaign, drawn model, what varies.
        theta: of a fit in which tolerances vary; (n_parameter,).
        held: directions that are rigid as drawn, each on a stiff spring in the session's model.
        pace: of the lines that fits count otherwise, every so manyth: where there are many data.
        jobs: processes for fits that do not wait for each other, threads of a single one.
        there: names of parameters of an effect that the session's model has already.
        independent: whether lines have noise of their own.
        record: finished refits, which are not repeated; None to keep none.
    """

    session: Session
    theta: Real
    rigid_directions: tuple[RigidDirection, ...] = ()
    stride_factor: int = 1
    jobs: int = 1
    there: frozenset[str] = frozenset()
    has_independent_lines: bool = False
    record: RefitRecord | None = None

    @property
    def model(self) -> Model:
        """The model that was fitted."""
        return self.session.model

    def find_stiffness(self, springs: tuple[str, ...]) -> Real:
        """Fitted stiffness of springs, the drawn one where it does not vary, in their order."""
        return self._along(springs, "stiffness")

    def find_damping(self, springs: tuple[str, ...]) -> Real:
        """Fitted damping of springs, the drawn one where it does not vary, in their order."""
        return self._along(springs, "damping")

    def _along(self, springs: tuple[str, ...], what: str) -> Real:
        fitted = dict(
            zip((parameter.name for parameter in self.model.parameters), self.theta, strict=True)
        )
        drawn = {spring.name: getattr(spring, what) for spring in self.model.machine.springs}
        return np.array([fitted.get(f"{name}.{what}", drawn[name]) for name in springs])


def state_nothing(fitted: Mapping[str, float]) -> dict[str, Value]:
    """No parameter to state."""
    del fitted
    return {}


def find_no_direction(fitted: Mapping[str, float]) -> str | None:
    """No direction."""
    del fitted
    return None


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One effect at one place.

    Args:
        effect, location, dof: as the verdict calls them.
        release: tolerances without prior and bounds.
        parts: what is added.
        begin: values at which parameters begin, by name.
        otherwise: other values at which parameters may begin, by name: what is far from the
            drawing may look wrong from there.
        correct: makes the measurement what it would be without the fault; None for no change.
        reform: makes the machine one that has coordinates for it; None for no change.
        scored: coordinates that are scored; all if empty. Others shape what these add.
        follow: parameters of Parts that have the value of a parameter of the model, by name.
        linear: sizes of the model that make up for what is added, term by term: they vary by
            themselves, not by their logarithms, for the line along which they do is straight then.
        alike: of shapes of one effect, place and direction whose scores are less than by this part
            below the best one's, the first that was proposed comes first.
        signed: whether those are sizes, none of which is less than zero.
        bounds: lowest and highest value of parameters of Parts, by name.
        believed: one standard deviation of parameters of Parts that are believed to be nearly as
            they begin, by name.
        is_modelled: whether its Parts, or the corrected measurement, hold all of it.
        members: of several at once, each; empty of a single one.
        state: parameters of the verdict from the fitted ones, by name.
        along: its direction from the fitted ones, where it has none before it is fitted.
    """

    effect: str
    location: str
    dof: str | None = None
    release: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    begin: Mapping[str, float] = field(default_factory=dict)
    otherwise: tuple[Mapping[str, float], ...] = ()
    correct: Callable[[Campaign], Campaign] | None = None
    reform: Callable[[Machine], Machine] | None = None
    scored: tuple[str, ...] = ()
    follow: Mapping[str, str] = field(default_factory=dict)
    linear: tuple[str, ...] = ()
    tie_share: float = 0.0
    signed: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    is_modelled: bool = True
    members: tuple["Hypothesis", ...] = ()
    state: Callable[[Mapping[str, float]], dict[str, Value]] = state_nothing
    along: Callable[[Mapping[str, float]], str | None] = find_no_direction

    @property
    def key(self) -> tuple[str, str, str | None]:
        """Effect, place and direction."""
        return self.effect, self.location, self.dof

    @property
    def site(self) -> str:
        """Such as ``appendage@body:ty``."""
        return f"{self.effect}@{self.location}"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of what is scored."""
        if self.scored:
            return self.scored
        added = (p.name for part in self.parts for p in part.parameters)
        return (*self.release, *(name for name in added if name not in self.follow))

    @property
    def names(self) -> frozenset[str]:
        """All parameters that it brings or releases."""
        return frozenset((*self.release, *(p.name for part in self.parts for p in part.parameters)))

    @property
    def identity(self) -> tuple[tuple[str, str, str | None], tuple[str, ...]]:
        """Key and coordinates: a gain and a sign share theirs, shapes of an effect their key."""
        return self.key, self.coordinates

    @property
    def words(self) -> str:
        """Such as ``sensor_gain@sensor:acc3 tx``."""
        return f"{self.site}{f' {self.dof}' if self.dof else ''}"


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue.

    Args:
        propose: its hypotheses for a scene.
        noun: what it is in a few words.
        means: what it is, in words; may name ``{place}``, such as ``tilt`` or ``acc1 and acc2``,
            ``{dof}`` as it is, ``{direction}``, such as ``along x`` or ``about z``, and
            ``{channel}``, such as ``acc1 along x``.
        confirm: what to do on the machine to confirm or refute it; likewise.
        undoes: whether that takes it out of the machine, which is repeated without it then.
    """

    propose: Callable[["Scene"], Iterable[Hypothesis]]
    noun: str
    means: str
    confirm: str
    undoes: bool = False

    def __call__(self, scene: "Scene") -> Iterable[Hypothesis]:
        """Its hypotheses for a scene."""
        return self.propose(scene)

    def describe(self, what: str, place: str, dof: str | None) -> str:
        """A sentence about it at a place."""
        towards = name_direction(dof)
        return what.format(
            place=name_place(place),
            dof=dof or "this direction",
            name_direction=towards or "in this direction",
            channel=f"{name_place(place)} {towards}".rstrip(),
        )


def release_tolerance(
    effect: str, location: str, dof: str | None, names: tuple[str, ...], stated: str
) -> Hypothesis:
    """A tolerance whose prior and bounds go, stated as one number or as a vector.

    Args:
        effect: as the verdict calls it.
        location: likewise.
        dof: likewise.
        names: of the parameters.
        stated: what the verdict calls their value.
    """

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        values = tuple(fitted[name] for name in names)
        return {stated: values if len(values) > 1 else values[0]}

    return Hypothesis(effect, location, dof, release=names, state=state)
