"""Springs that follow another law than a constant stiffness k: K += theta k f(s).

Each spring of a law has its stiffness as a parameter that follows that of the joint, so that k is
the fitted stiffness at every step of a fit.

A size r that cannot be negative may be fitted as theta = ln(1 + r) >= 0, the logarithm of the
largest stiffness over the static one. It is r where r is small, and a logarithm where it is large.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.effects.scales import LOG_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.stated_values import Value
from identification.words import Complex, Condition, Real
from mbmodel import AddedPart, Change, Parameter
from tuning.parametrisation.user_specification import FREE_RANGE_LOG

Shape = Callable[[Complex], Complex]
State = Callable[[Mapping[str, float]], dict[str, Value]]


@dataclass(frozen=True, eq=False)
class TimedLaw:
    """Law f(s; tau) of a time tau, whose logarithm is fitted from the tau of a scan.

    Args:
        tau: time of the scan [s].
        shape: returns f at a tau.
        slope: returns df / d ln tau at a tau.
    """

    tau: float
    shape: Callable[[float], Shape]
    slope: Callable[[float], Shape]

    def find_time(self, theta: float) -> float:
        """Return tau [s] at a value of its parameter."""
        return self.tau * float(np.exp(LOG_UNIT * theta))


def evaluate_constant(laplace: Complex) -> Complex:
    """Return f = 1; (n_freq,)."""
    return np.ones_like(laplace)


@dataclass(frozen=True, eq=False)
class Law:
    """Law of the springs of a joint.

    Args:
        location: joint of the springs.
        name: prefix of the names of the parameters.
        law: f(s), with a time to be fitted or without.
        when: whether the law applies to a test; to all tests if None.
        frame: directions of the springs; (nv, n_spring).
        follow: stiffness of the model that each parameter follows, by name.
        start: fitted stiffness of each spring.
        is_logarithmic: whether theta is ln(1 + r) of the size r; else it is r.
    """

    location: str
    name: str
    law: Shape | TimedLaw
    when: Callable[[Condition], bool] | None
    frame: Real
    follow: Mapping[str, str]
    start: tuple[float, ...]
    is_logarithmic: bool = False

    @classmethod
    def for_springs(
        cls,
        scene: Scene,
        location: str,
        springs: tuple[str, ...],
        name: str,
        law: Shape | TimedLaw,
        when: Callable[[Condition], bool] | None = None,
        *,
        is_logarithmic: bool = False,
    ) -> "Law":
        """Return the law of the springs whose stiffness is tuned.

        Args:
            scene: model with the springs.
            location: joint of the springs.
            springs: names of the springs.
            name: prefix of the names of the parameters.
            law: f(s), with a time to be fitted or without.
            when: whether the law applies to a test; to all tests if None.
            is_logarithmic: whether theta is ln(1 + r) of the size r; else it is r.
        """
        tuned = {parameter.name for parameter in scene.model.parameters}
        sprung = tuple(spring for spring in springs if f"{spring}.stiffness" in tuned)
        directions = {spring.name: spring.direction for spring in scene.model.machine.springs}
        frame = np.array([directions[spring] for spring in sprung]).T.reshape(
            len(scene.model.machine.coordinates), len(sprung)
        )
        follow = {f"{name}({spring})": f"{spring}.stiffness" for spring in sprung}
        start = tuple(scene.find_stiffness(sprung).tolist())
        return cls(location, name, law, when, frame, follow, start, is_logarithmic)

    @property
    def size_name(self) -> str:
        """Name of the size theta."""
        return f"{self.name}.size"

    @property
    def time_name(self) -> str:
        """Name of the parameter of the time."""
        return f"{self.name}.time"

    @property
    def part(self) -> AddedPart:
        """Part with the law."""
        names = [(self.size_name, "1")]
        if isinstance(self.law, TimedLaw):
            names.append((self.time_name, f"{LOG_UNIT:.0%}"))
        parameters = [Parameter(name, 0.0, unit, positive=False) for name, unit in names]
        for name, value in zip(self.follow, self.start, strict=True):
            parameters.append(Parameter(name, value, "N/m or N m/rad"))
        change, slopes = self._compute_change, self._compute_slopes
        return AddedPart(self.location, tuple(parameters), change, slopes, self.when)

    def propose(
        self,
        effect: str,
        dof: str | None,
        state: State,
        *,
        signed: bool = True,
        otherwise: tuple[float, ...] = (),
    ) -> Iterator[Hypothesis]:
        """Yield the hypothesis of the law; none if no spring has a stiffness.

        Args:
            effect: name of the effect in the verdict.
            dof: direction or test in the verdict.
            state: parameters of the verdict from the fitted ones.
            signed: whether the size cannot be negative.
            otherwise: alternative start values of the size.
        """
        if self.follow:
            yield Hypothesis(
                effect,
                self.location,
                dof,
                parts=(self.part,),
                scored=(self.size_name,),
                follow=self.follow,
                signed=signed,
                bounds=self._bounds,
                otherwise=tuple({self.size_name: self._find_theta(size)} for size in otherwise),
                state=state,
            )

    @property
    def _bounds(self) -> dict[str, tuple[float, float]]:
        ends = {self.size_name: (0.0, FREE_RANGE_LOG)} if self.is_logarithmic else {}
        if isinstance(self.law, TimedLaw):
            ends[self.time_name] = -MAX_LOG_STEPS, MAX_LOG_STEPS
        return ends

    def _find_theta(self, size: float) -> float:
        """Return the parameter of a size r."""
        return float(np.log1p(size)) if self.is_logarithmic else size

    def _find_size(self, theta: float) -> tuple[float, float]:
        """Return the size r at a value of its parameter, and its slope."""
        if self.is_logarithmic:
            return float(np.expm1(theta)), float(np.exp(theta))
        return theta, 1.0

    def read_size(self, fitted: Mapping[str, float]) -> float:
        """Return the fitted size r of a law whose size cannot be negative."""
        return max(self._find_size(fitted[self.size_name])[0], 0.0)

    def read_time(self, fitted: Mapping[str, float]) -> float:
        """Return the fitted time [s].

        Raises:
            TypeError: the law has no time.
        """
        if not isinstance(self.law, TimedLaw):
            raise TypeError("a law without a time")
        return self.law.find_time(fitted[self.time_name])

    def _build_change(self, core: Real, shape: Shape) -> Change:
        """Return the change by cores of s^0; (.., n_spring, n_spring)."""
        whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
        whole[..., 0, :, :] = core
        return Change("joint", self.frame, self.frame, whole, shape=shape)

    def _find_shape(self, theta: Real) -> Shape:
        law = self.law
        return law.shape(law.find_time(float(theta[1]))) if isinstance(law, TimedLaw) else law

    def _select_stiffness(self, theta: Real) -> Real:
        return theta[len(theta) - len(self.follow) :]

    def _compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change of the law."""
        size, _ = self._find_size(float(theta[0]))
        core = size * np.diag(self._select_stiffness(theta))
        return (self._build_change(core, self._find_shape(theta)),)

    def _compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return slopes by the size, the time if there is one, and each stiffness."""
        count, n = len(theta), len(self.follow)
        stiffness = np.diag(self._select_stiffness(theta))
        size, slope = self._find_size(float(theta[0]))
        core = np.zeros((count, n, n))
        core[0] = slope * stiffness
        each = np.arange(n)
        core[count - n + each, each, each] = size
        changes = [self._build_change(core, self._find_shape(theta))]
        if isinstance(self.law, TimedLaw):
            late = np.zeros((count, n, n))
            late[1] = size * LOG_UNIT * stiffness
            changes.append(
                self._build_change(late, self.law.slope(self.law.find_time(float(theta[1]))))
            )
        return tuple(changes)
