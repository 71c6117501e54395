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

_FARTHEST = 6.0  # of the logarithm of a time, from where it was scanned
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
        return _FARTHEST / self.step


def constant(laplace: Complex) -> Complex:
    """The law ``f = 1``."""
    return np.ones_like(laplace)


class Law:
    """A law of some springs.

    Args:
        scene: in whose model they are.
        location: of the joint.
        springs: their names.
        name: what the parameters' names begin with.
        law: f(s), with a time of its own or without.
        when: in which tests it holds; in all if None.
    """

    def __init__(
        self,
        scene: Scene,
        location: str,
        springs: tuple[str, ...],
        name: str,
        law: Shape | Timed,
        when: Callable[[Condition], bool] | None = None,
    ) -> None:
        tuned = {parameter.name for parameter in scene.model.parameters}
        own = tuple(one for one in springs if f"{one}.stiffness" in tuned)
        directions = {one.name: one.direction for one in scene.model.machine.springs}
        self._frame = np.array([directions[one] for one in own]).T.reshape(
            len(scene.model.machine.coordinates), len(own)
        )
        self._law, self._when, self._location = law, when, location
        self.size, self.time = f"{name}.size", f"{name}.time"
        self.follow = {f"{name}({one})": f"{one}.stiffness" for one in own}
        self._begin = scene.stiffness(own).tolist()

    @property
    def part(self) -> AddedPart:
        """As a Part."""
        names = [(self.size, "1")]
        if isinstance(self._law, Timed):
            names.append((self.time, f"{self._law.step:.0%}"))
        parameters = [Parameter(name, 0.0, unit, positive=False) for name, unit in names]
        for name, value in zip(self.follow, self._begin, strict=True):
            parameters.append(Parameter(name, value, "N/m or N m/rad"))
        finite, slopes = self._finite, self._derivatives
        return AddedPart(self._location, tuple(parameters), finite, slopes, self._when)

    def hypotheses(
        self,
        effect: str,
        dof: str | None,
        state: State,
        *,
        signed: bool = True,
        otherwise: tuple[float, ...] = (),
    ) -> Iterator[Hypothesis]:
        """The one that it holds; none where no spring has a stiffness.

        Args:
            effect: as the verdict calls it.
            dof: likewise.
            state: parameters of the verdict from the fitted ones.
            signed: whether its size is none below zero.
            otherwise: sizes at which it may begin as well.
        """
        if self.follow:
            yield Hypothesis(
                effect,
                self._location,
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
        law = self._law
        return {self.time: (-law.farthest, law.farthest)} if isinstance(law, Timed) else {}

    def tau(self, found: Mapping[str, float]) -> float:
        """The fitted time [s].

        Raises:
            TypeError: a law without one.
        """
        if not isinstance(self._law, Timed):
            raise TypeError("a law without a time")
        return self._law.at(found[self.time])

    def _change(self, core: Real, shape: Shape) -> Change:
        """Cores (.., n_spring, n_spring) of s^0."""
        whole = np.zeros((*core.shape[:-2], 3, *core.shape[-2:]))
        whole[..., 0, :, :] = core
        return Change("joint", self._frame, self._frame, whole, shape=shape)

    def _shape(self, theta: Real) -> Shape:
        law = self._law
        return law.shape(law.at(float(theta[1]))) if isinstance(law, Timed) else law

    def _stiffness(self, theta: Real) -> Real:
        return theta[len(theta) - len(self.follow) :]

    def _finite(self, theta: Real) -> tuple[Change, ...]:
        """What the law changes."""
        return (self._change(theta[0] * np.diag(self._stiffness(theta)), self._shape(theta)),)

    def _derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By the size, the time if there is one, and each stiffness."""
        count, n = len(theta), len(self.follow)
        stiffness = np.diag(self._stiffness(theta))
        core = np.zeros((count, n, n))
        core[0] = stiffness
        each = np.arange(n)
        core[count - n + each, each, each] = theta[0]
        changes = [self._change(core, self._shape(theta))]
        if isinstance(self._law, Timed):
            late = np.zeros((count, n, n))
            late[1] = theta[0] * self._law.step * stiffness
            changes.append(self._change(late, self._law.slope(self._law.at(float(theta[1])))))
        return tuple(changes)
