"""Hypothesis: an effect at a place, ready to be fitted."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from diagnosis.labels import name_direction, name_place
from diagnosis.movable import Movable
from diagnosis.refit_record import RefitRecord
from diagnosis.settings import SETTINGS, DiagnosisSettings
from diagnosis.stated_values import Value
from identification.words import Campaign, Real
from mbmodel import Machine, Model, Part, RigidDirection
from tuning import Session


@dataclass(frozen=True, eq=False)
class Scene:
    """Fit about which hypotheses are proposed.

    Args:
        session: campaign, nominal model, parametrisation.
        theta: parameters of the fit; (n_parameter,).
        rigid_directions: directions that are rigid as drawn, each on a stiff spring of the model.
        stride_factor: factor on the strides of frequency lines, above 1 for large campaigns.
        jobs: processes for independent fits, threads for a single fit.
        has_independent_lines: whether the noise of neighbouring lines is independent.
        record: finished refits, which are not repeated; None to keep none.
        settings: thresholds and sizes of the search.
    """

    session: Session
    theta: Real
    rigid_directions: tuple[RigidDirection, ...] = ()
    stride_factor: int = 1
    jobs: int = 1
    has_independent_lines: bool = False
    record: RefitRecord | None = None
    settings: DiagnosisSettings = SETTINGS

    @property
    def model(self) -> Model:
        """Model of the fit."""
        return self.session.model

    def find_stiffness(self, springs: tuple[str, ...]) -> Real:
        """Return the stiffness of springs: the fitted one, or the drawn one if it does not vary."""
        return self._find_along(springs, "stiffness")

    def find_damping(self, springs: tuple[str, ...]) -> Real:
        """Return the damping of springs: the fitted one, or the drawn one if it does not vary."""
        return self._find_along(springs, "damping")

    def _find_along(self, springs: tuple[str, ...], kind: str) -> Real:
        names = (parameter.name for parameter in self.model.parameters)
        fitted = dict(zip(names, self.theta, strict=True))
        drawn = {spring.name: getattr(spring, kind) for spring in self.model.machine.springs}
        return np.array([fitted.get(f"{name}.{kind}", drawn[name]) for name in springs])


def state_nothing(fitted: Mapping[str, float]) -> dict[str, Value]:
    """Return no parameter."""
    del fitted
    return {}


def find_no_direction(fitted: Mapping[str, float]) -> str | None:
    """Return no direction."""
    del fitted
    return None


@dataclass(frozen=True)
class JointDirection:
    """One sprung direction of a joint.

    Args:
        stage: child body of the joint.
        dof: as the verdict calls it.
        spring: its name.
    """

    stage: str
    dof: str
    spring: str


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One effect at one place.

    Args:
        effect: name of the effect in the verdict.
        location: place in the verdict.
        dof: direction or test in the verdict; None if it has none.
        release: names of tolerances that lose prior and bounds.
        parts: Parts that are added.
        begin: start values of parameters, by name.
        otherwise: alternative start values: a strong effect may look wrong from the null model.
        correct: returns the campaign without the fault; None for no change.
        reform: returns a machine that has coordinates for the effect; None for no change.
        scored: coordinates of the score test; all if empty. The others shape what these add.
        follow: parameter of the model that each parameter of a Part equals, by name.
        linear: sizes of the model that vary linearly, not by their logarithms. They make up for the
            Part term by term, so that the valley along which both vary is straight.
        tie_share: of the best score of this effect, place and direction: shapes whose scores are
            closer to it rank in the order of their proposal.
        signed: whether the scored sizes cannot be negative.
        is_slope_informative: whether the slope at size zero tells what the effect explains; else
            each round refits it from the alternative start values too, whatever its score.
        bounds: lowest and highest values of parameters of Parts, and of released tolerances [SI],
            by name. A parameter whose two bounds are equal stays there.
        believed: standard deviations of the priors of parameters of Parts, by name.
        valid_below_bound: parameters that describe the effect only below their upper bound. A fit
            that ends at the bound describes another effect, such as a mass for an appendage.
        is_modelled: whether a fit with the Parts, or the corrected campaign, contains the effect.
        spring: joint direction of a law that depends on the level: its Parts are scored, but a
            refit fits the law itself (``diagnosis.levels``).
        member: of a family of hypotheses that are scored together, returns the one to refit, which
            begins where the step of the score ends; None if there is none. It is scored by its
            family's gain.
        movable: how its fitted values start the same effect at other bodies; None if they do not.
        state: returns the parameters of the verdict from the fitted ones.
        along: returns the direction of the verdict from the fitted parameters, if a fit finds it.
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
    is_slope_informative: bool = True
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    valid_below_bound: tuple[str, ...] = ()
    is_modelled: bool = True
    spring: "JointDirection | None" = None
    member: "Callable[[Real], Hypothesis | None] | None" = None
    movable: Movable | None = None
    state: Callable[[Mapping[str, float]], dict[str, Value]] = state_nothing
    along: Callable[[Mapping[str, float]], str | None] = find_no_direction

    @property
    def key(self) -> tuple[str, str, str | None]:
        """Effect, place and direction."""
        return self.effect, self.location, self.dof

    @property
    def site(self) -> str:
        """Effect and place, such as ``appendage@body:ty``."""
        return f"{self.effect}@{self.location}"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of the score test."""
        if self.scored:
            return self.scored
        added = (p.name for part in self.parts for p in part.parameters)
        stays = {*self.follow, *self.held}
        return (*self.release, *(name for name in added if name not in stays))

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the parameters that stay at their only value."""
        return tuple(name for name, (low, high) in self.bounds.items() if low == high)

    @property
    def identity(self) -> tuple[tuple[str, str, str | None], tuple[str, ...]]:
        """Key and coordinates: shapes of an effect share a key, a gain and a sign coordinates."""
        return self.key, self.coordinates

    @property
    def words(self) -> str:
        """Effect, place and direction, such as ``sensor_gain@sensor:acc3 tx``."""
        return f"{self.site}{f' {self.dof}' if self.dof else ''}"


@dataclass(frozen=True)
class Effect:
    """Effect of the catalogue.

    Args:
        propose: returns the hypotheses for a scene.
        noun: the effect in a few words.
        means: sentence that says what the effect is. It may name ``{place}``, such as ``tilt`` or
            ``acc1 and acc2``, ``{dof}``, ``{direction}``, such as ``along x`` or ``about z``, and
            ``{channel}``, such as ``acc1 along x``.
        confirm: experiment that confirms or refutes the effect; it may name the words of ``means``.
        undoes: whether that experiment takes the effect out of the machine.
        laws: laws that the effect stands for, since FRFs at a few levels do not tell them apart.
    """

    propose: Callable[["Scene"], Iterable[Hypothesis]]
    noun: str
    means: str
    confirm: str
    undoes: bool = False
    laws: tuple[str, ...] = ()

    def __call__(self, scene: "Scene") -> Iterable[Hypothesis]:
        """Return the hypotheses for a scene."""
        return self.propose(scene)

    def describe(self, text: str, place: str, dof: str | None) -> str:
        """Return a sentence about the effect at a place.

        Args:
            text: ``means`` or ``confirm``.
            place: location.
            dof: direction or test.
        """
        towards = name_direction(dof)
        return text.format(
            place=name_place(place),
            dof=dof or "this direction",
            direction=towards or "in this direction",
            channel=f"{name_place(place)} {towards}".rstrip(),
        )


def release_tolerance(
    effect: str, location: str, dof: str | None, names: tuple[str, ...], stated: str
) -> Hypothesis:
    """Return the release of a tolerance, stated as one number or as a vector.

    Args:
        effect: name of the effect in the verdict.
        location: place in the verdict.
        dof: direction in the verdict.
        stated: name of their value in the verdict.
    """

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        values = tuple(fitted[name] for name in names)
        return {stated: values if len(values) > 1 else values[0]}

    return Hypothesis(effect, location, dof, release=names, state=state)
