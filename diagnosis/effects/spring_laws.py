"""Springs that follow another law than k: K += theta k f(s), k as it is fitted.

Every spring of a law brings its own stiffness as a parameter that follows the joint's: while both
are fitted, the law stays one of the stiffness there is.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.hypothesis import Hypothesis, Scene, Value
from identification.words import Complex, Condition, Real
from mbmodel import AddedPart, Change, Parameter

_MAX_LOG_TIME = 6.0  # of the logarithm of a time, from where it was scanned
Shape = Callable[[Complex], Complex]
State = Callable[[Mapping[str, float]], dict[str, Value]]


@dataclass(frozen=True, eq=False)
class Timed:
    """f(s; tau) of a time tau that is fitted by its logarithm, from where it was scanned.

    Args:
        tau: where it begins [s].
        step: of its logarithm per unit of the parameter.
        shape: f at tau.
        slope: df / d ln tau at tau.
    """

    tau: float
    step: float
    shape: Callable[[float], Shape]
    slope: Callable[[float], Shape]

    def at(self, theta: float) -> float:
        """Tau [s]."""
        return self.tau * float(np.exp(self.step * theta))

    @property
    def farthest(self) -> float:
        """The parameter, where it ends."""
        return _MAX_LOG_TIME / self.step


def evaluate_constant(laplace: Complex) -> Complex:
    """The law ``f = 1``."""
    return np.ones_like(laplace)


@dataclass(frozen=True, eq=False)
class Law:
    """A law of some springs.

    Args:
        location: joint of the springs.
        name: beginning of the parameters' names.
        law: f(s), with a time to be fitted or without.
        when: whether it holds in a test; in all if None.
        frame: directions of the springs; (nv, n_spring).
        follow: the model's stiffness that each parameter follows, by name.
        start: fitted stiffness of each spring.
    """

    location: str
    name: str
    law: Shape | Timed
    when: Callable[[Condition], bool] | None
    frame: Real
    follow: Mapping[str, str]
    start: tuple[float, ...]

    @classmethod
    def for_springs(
        cls,
        scene: Scene,
        location: str,
        springs: tuple[str, ...],
        name: str,
        law: Shape | Timed,
        when: Callable[[Condition], bool] | None = None,
    ) -> "Law":
        """Return the law of those springs whose stiffness is tuned.

        Args:
            scene: model with the springs.
            location: their joint.
            springs: their names.
            name: beginning of the parameters' names.
            law: f(s), with a time to be fitted or without.
            when: whether it holds in a test; in all if None.
        """
        tuned = {parameter.name for parameter in scene.model.parameters}
        sprung = tuple(spring for spring in springs if f"{spring}.stiffness" in tuned)
        directions = {spring.name: spring.direction for spring in scene.model.machine.springs}
        frame = np.array([directions[spring] for spring in sprung]).T.reshape(
            len(scene.model.machine.coordinates), len(sprung)
        )
        follow = {f"{name}({spring})": f"{spring}.stiffness" for spring in sprung}
        start = tuple(scene.find_stiffness(sprung).tolist())
        return cls(location, name, law, when, frame, follow, start)

    @property
    def size(self) -> str:
        """Name of theta."""
        return f"{self.name}.size"

    @property
    def time(self) -> str:
        """Name of the time's parameter."""
        return f"{self.name}.time"

    @property
    def part(self) -> AddedPart:
        """Part with the law."""
        names = [(self.size, "1")]
        if isinstance(self.law, Timed):
            names.append((self.time, f"{self.law.step:.0%}"))
        parameters = [Parameter(name, 0.0, unit, positive=False) for name, unit in names]
        for name, value in zip(self.follow, self.start, strict=True):
            parameters.append(Parameter(name, value, "N/m or N m/rad"))
        finite, slopes = self._finite, self._derivatives
        return AddedPart(self.location, tuple(parameters), finite, slopes, self.when)

    def propose(
        self,
        effect: str,
        dof: str | None,
        state: State,
        *,
        signed: bool = True,
        otherwise: tuple[float, ...] = (),
    ) -> Iterator[Hypothesis]:
        """Yield the hypothesis of the law; none where no spring has a stiffness.

        Args:
            effect: as the verdict calls it.
            dof: direction or test, as the verdict calls it.
            state: parameters of the verdict from the fitted ones.
            signed: whether its size is not below zero.
            otherwise: further sizes at which it may begin.
        """
        if self.follow:
            yield Hypothesis(
                effect,
                self.location,
                dof,
                parts=(self.part,),
                scored=(self.size,),
                follow=self.follow,
                signed=signed,
                bounds=self._bounds,
                otherwise=tuple({self.size: size} for size in otherwise),
                state=state,
            )

    @property
    def _bounds(self) -> dict[str, tuple[float, float]]:
        law = self.law
        return {self.time: (-law.farthest, law.farthest)} if isinstance(law, Timed) else {}

    def tau(self, fitted: Mapping[str, float]) -> float:
        """Return the fitted time [s].

        Raises:
            TypeError: a law without one.
        """
        if not isinstance(self.law, Timed):
            raise TypeError("a law without a time")
        return self.law.at(fitted[self.time])

    def _change(self, core: Real, shape: Shape) -> Change:
        """Return a change with cores (.., n_spring, n_spring) of s^0."""
        whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
        whole[..., 0, :, :] = core
        return Change("joint", self.frame, self.frame, whole, shape=shape)

    def _shape(self, theta: Real) -> Shape:
        law = self.law
        return law.shape(law.at(float(theta[1]))) if isinstance(law, Timed) else law

    def _stiffness(self, theta: Real) -> Real:
        return theta[len(theta) - len(self.follow) :]

    def _finite(self, theta: Real) -> tuple[Change, ...]:
        """Return the change of the law."""
        return (self._change(theta[0] * np.diag(self._stiffness(theta)), self._shape(theta)),)

    def _derivatives(self, theta: Real) -> tuple[Change, ...]:
        """Return slopes by the size, the time if there is one, and each stiffness."""
        count, n = len(theta), len(self.follow)
        stiffness = np.diag(self._stiffness(theta))
        core = np.zeros((count, n, n))
        core[0] = stiffness
        each = np.arange(n)
        core[count - n + each, each, each] = theta[0]
        changes = [self._change(core, self._shape(theta))]
        if isinstance(self.law, Timed):
            late = np.zeros((count, n, n))
            late[1] = theta[0] * self.law.step * stiffness
            changes.append(self._change(late, self.law.slope(self.law.at(float(theta[1])))))
        return tuple(changes)
