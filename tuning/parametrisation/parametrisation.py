r"""Which parameters of a model vary, and as which coordinates x.

A size (stiffness, mass, gain) is tuned by its logarithm, anything else along a line:

    theta = drawn exp(scale x)    or    theta = drawn + scale x.

A parameter that the drawing knows within a tolerance has that as its scale, so that x counts
standard deviations, the prior is exp(-x^2 / 2), and x is the pull. It is kept within 2.5 of them:
left unbounded, tolerances swallow a fault (a sensor turned by 20 degrees leaves no excess at all).
What the drawing does not know has scale 1 and no prior, only bounds a factor of 100 away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.words import Integers, Mask, Real
from mbmodel import Parameter

_NEAR = 1e-6
BOUND = 2.5  # standard deviations within which a tolerance is kept


@dataclass(frozen=True, eq=False)
class Freedom:
    """Coordinates x of a model's parameters theta.

    Args:
        parameters: of the model.
        member: coordinate of each parameter, -1 where it is fixed; (n_parameter,).
        scale: of each parameter; (n_parameter,).
        fixed: value in SI of those without a coordinate, of the others the drawn one.
        has_prior: which coordinates count standard deviations; (n_x,).
        lower, upper: bounds of x; (n_x,).
    """

    parameters: tuple[Parameter, ...]
    member: Integers
    scale: Real
    fixed: Real
    has_prior: Mask
    lower: Real
    upper: Real

    @property
    def size(self) -> int:
        """How many coordinates there are."""
        return len(self.lower)

    @cached_property
    def free(self) -> Mask:
        """Which parameters vary; (n_parameter,)."""
        return self.member >= 0

    @cached_property
    def _logarithmic(self) -> Mask:
        return np.array([parameter.positive for parameter in self.parameters], bool)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of each coordinate: of its first parameter."""
        first = [int(np.flatnonzero(self.member == k)[0]) for k in range(self.size)]
        return tuple(self.parameters[place].name for place in first)

    def _moved(self, x: Real) -> Real:
        """Scale x of each parameter, zero where it is fixed."""
        moved: Real = np.where(self.free, self.scale * np.append(x, 0.0)[self.member], 0.0)
        return moved

    def theta(self, x: Real) -> Real:
        """Parameters in SI; (n_parameter,)."""
        moved, log = self._moved(x), self._logarithmic
        theta: Real = np.where(log, self.fixed * np.exp(np.where(log, moved, 0.0)), self.fixed)
        return theta + np.where(log, 0.0, moved)

    def rates(self, x: Real) -> Real:
        """D theta / dx of each parameter by its own coordinate; (n_parameter,)."""
        rates: Real = self.scale * np.where(self._logarithmic, self.theta(x), 1.0) * self.free
        return rates

    def coordinates(self, theta: Real) -> Real:
        """The x of a theta; of tied parameters the mean; (n_x,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = np.where(self._logarithmic, np.log(theta / self.fixed), theta - self.fixed)
        own = np.where(self.free, moved / self.scale, 0.0)[self.free]
        total = np.bincount(self.member[self.free], own, self.size)
        mean: Real = total / np.bincount(self.member[self.free], minlength=self.size)
        return mean

    def at_bound(self, x: Real) -> Mask:
        """Which parameters are at a bound; (n_parameter,)."""
        return np.append(self.reached(x), False)[self.member]

    def reached(self, x: Real) -> Mask:
        """Which coordinates are at a bound; (n_x,)."""
        reached: Mask = (x <= self.lower + _NEAR) | (x >= self.upper - _NEAR)
        return reached

    def collected(self, gradient: Real, x: Real) -> Real:
        """Derivatives by x of those by theta; (n_parameter,) to (n_x,)."""
        own = (gradient * self.rates(x))[self.free]
        found = np.zeros(self.size)
        np.add.at(found, self.member[self.free], own)
        return found

    def only(self, chosen: Mask, x: Real) -> "Freedom":
        """The same with some coordinates only, the others fixed where x has them."""
        number = np.where(chosen, np.cumsum(chosen) - 1, -1)
        return replace(
            self,
            member=np.append(number, -1)[self.member],
            fixed=self.theta(np.where(chosen, 0.0, x)),
            has_prior=self.has_prior[chosen],
            lower=self.lower[chosen],
            upper=self.upper[chosen],
        )

    def unbounded(self) -> "Freedom":
        """The same, tolerances beyond 2.5 too: their pulls tell where a fault hides.

        Bounds that a user gave stay.
        """
        return replace(
            self,
            lower=np.where(self.has_prior & (self.lower == -BOUND), -np.inf, self.lower),
            upper=np.where(self.has_prior & (self.upper == BOUND), np.inf, self.upper),
        )

    def widened(self, chosen: Mask, bound: float) -> "Freedom":
        """The same, some tolerances as far as another bound; the others, and users' bounds, stay.

        Args:
            chosen: coordinates; (n_x,).
            bound: standard deviations.
        """
        own = chosen & self.has_prior
        return replace(
            self,
            lower=np.where(own & (self.lower == -BOUND), -bound, self.lower),
            upper=np.where(own & (self.upper == BOUND), bound, self.upper),
        )

    def narrowed(self, bound: float) -> "Freedom":
        """The same, tolerances that were widened to a bound within their usual ones again."""
        return replace(
            self,
            lower=np.where(self.has_prior & (self.lower == -bound), -BOUND, self.lower),
            upper=np.where(self.has_prior & (self.upper == bound), BOUND, self.upper),
        )

    def released(self, names: Sequence[str]) -> "Freedom":
        """The same, some tolerances without prior and bounds: what is off there may be any size.

        Args:
            names: of coordinates.
        """
        chosen = np.isin(np.array(self.names), list(names))
        return replace(
            self,
            has_prior=self.has_prior & ~chosen,
            lower=np.where(chosen, -np.inf, self.lower),
            upper=np.where(chosen, np.inf, self.upper),
        )

    def linear(self, names: Sequence[str]) -> "Freedom":
        """The same, some sizes varied by themselves instead of by their logarithm.

        x, (exp(scale x) - 1) / scale before, moves them by as much near the drawing; so do their
        bounds. What makes up for another parameter in a sum does so along a straight line then.

        Args:
            names: of coordinates.
        """
        chosen = np.isin(np.array(self.names), list(names)) & self.is_logarithm
        own = np.append(chosen, False)[self.member]
        scales, sizes = self.scales, zip(self.parameters, own.tolist(), strict=True)
        lower, upper = self.lower.copy(), self.upper.copy()
        for ends in (lower, upper):
            ends[chosen] = np.expm1(scales[chosen] * ends[chosen]) / scales[chosen]
        return replace(
            self,
            parameters=tuple(replace(p, positive=False) if one else p for p, one in sizes),
            scale=np.where(own, self.scale * self.fixed, self.scale),
            lower=lower,
            upper=upper,
        )

    def extended(self, whole: "Freedom") -> "Freedom":
        """The coordinates there are, and after them those of parameters that a model has more.

        Whatever a user wished of the parameters there are holds in that model too.

        Args:
            whole: of a model with all of these parameters by name, and others anywhere among them.
        """
        place = {parameter.name: k for k, parameter in enumerate(self.parameters)}
        old = np.array([place.get(parameter.name, -1) for parameter in whole.parameters], int)
        more = old < 0
        own = whole.free & more
        new = whole.member[own]
        pairs = zip(old.tolist(), whole.parameters, strict=True)
        return Freedom(
            tuple(other if k < 0 else self.parameters[k] for k, other in pairs),
            member=np.where(own, self.size + np.cumsum(own) - 1, np.append(self.member, -1)[old]),
            scale=np.where(more, whole.scale, np.append(self.scale, 1.0)[old]),
            fixed=np.where(more, whole.fixed, np.append(self.fixed, 0.0)[old]),
            has_prior=np.append(self.has_prior, whole.has_prior[new]),
            lower=np.append(self.lower, whole.lower[new]),
            upper=np.append(self.upper, whole.upper[new]),
        )

    def following(self, ties: Mapping[str, str]) -> "Freedom":
        """The same, some parameters with the value of others, fixed where those are.

        Args:
            ties: name of the other parameter, of the same unit, by name.
        """
        place = {parameter.name: k for k, parameter in enumerate(self.parameters)}
        member, scale, fixed = self.member.copy(), self.scale.copy(), self.fixed.copy()
        for name, other in ties.items():
            own, leader = place[name], place[other]
            member[own], scale[own] = member[leader], scale[leader]
            fixed[own] = fixed[leader]
        kept = np.unique(member[member >= 0])
        number = np.full(self.size + 1, -1)
        number[kept] = np.arange(len(kept))
        return replace(
            self,
            member=number[member],
            scale=scale,
            fixed=fixed,
            has_prior=self.has_prior[kept],
            lower=self.lower[kept],
            upper=self.upper[kept],
        )

    @cached_property
    def is_logarithm(self) -> Mask:
        """Which coordinates are logarithms of sizes; (n_x,)."""
        found = np.zeros(self.size, bool)
        found[self.member[self.free]] = self._logarithmic[self.free]
        return found

    @cached_property
    def scales(self) -> Real:
        """Scale of each coordinate; (n_x,)."""
        found = np.ones(self.size)
        found[self.member[self.free]] = self.scale[self.free]
        return found

    @property
    def is_stated(self) -> Mask:
        """Coordinates with bounds that are no default of tolerances; (n_x,)."""
        usual = (self.lower == -BOUND) & (self.upper == BOUND)
        stated: Mask = ~(self.has_prior & usual)
        return stated
