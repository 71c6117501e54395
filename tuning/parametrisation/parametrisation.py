"""Coordinates x in which the parameters theta vary, their priors and bounds.

A size (stiffness, mass, gain) varies by its logarithm, any other parameter linearly:

    theta = nominal exp(scale x)    or    theta = nominal + scale x.

A parameter with a tolerance has the tolerance's standard deviation as its scale. Its coordinate x
then counts standard deviations, its prior is the normal density exp(-x^2 / 2), and x is called its
pull. It is bounded to 2.5 standard deviations, because unbounded tolerances absorb a fault: those
of a sensor that is turned by 20 degrees would leave no gap at all.

Stiffness and damping are known to a factor q only (3 and 4, unless a campaign states it). Their
scale is 1, so that x is the logarithm of k / k_drawn, with the prior exp(-d x^2 / 2) of the
precision d = (ln q)^-2 and bounds a factor of 100 away. What the data do not determine stays at the
drawing. A parameter that the nominal model does not know at all has no prior (d = 0).

Damping that a drawing leaves out is never negative, and usually of a known order c_u: its scale is
c_u, its bound 0 and its prior half-normal, exp(-x^2 / 2) for x >= 0. Searches begin at c_u.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.words import TOLERANCE_BOUND_SIGMA, Integers, Mask, Real
from mbmodel import Parameter

# Of a factor on a nominal value, in nats: searches that go astray keep finite numbers beyond it.
_MAX_LOGARITHM = 100.0
_BOUND_MARGIN = 1e-6  # distance in x below which a coordinate counts as at its bound


def _is_undrawn(parameter: Parameter) -> bool:
    """Return whether a parameter is damping that the drawing leaves out."""
    return parameter.known == "undrawn_damping"


@dataclass(frozen=True, eq=False)
class Parametrisation:
    """Coordinates x of a model's parameters theta.

    Args:
        parameters: parameters of the model; n_parameter.
        coordinate_of: index of each parameter's coordinate, -1 for a fixed one; (n_parameter,).
        scale: change of each parameter (of its logarithm, for a size) per unit of x;
            (n_parameter,).
        fixed: value of each parameter at x = 0 [SI]; fixed parameters keep it; (n_parameter,).
        is_tolerance: whether each coordinate counts standard deviations of a tolerance, with
            d = 1 and bounds; (n_x,).
        precision: d, precision of the normal prior of each coordinate; 0 without one; (n_x,).
        lower: lower bounds of x; (n_x,).
        upper: upper bounds of x; (n_x,).
    """

    parameters: tuple[Parameter, ...]
    coordinate_of: Integers
    scale: Real
    fixed: Real
    is_tolerance: Mask
    precision: Real
    lower: Real
    upper: Real

    @property
    def start(self) -> Real:
        """Parameters at which searches begin: the nominal ones, with usual damping [SI]."""
        undrawn = np.array([_is_undrawn(parameter) for parameter in self.parameters], bool)
        return np.where(self.free & undrawn, self.fixed + self.scale, self.fixed)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.lower)

    @cached_property
    def free(self) -> Mask:
        """Whether each parameter varies; (n_parameter,)."""
        return self.coordinate_of >= 0

    @cached_property
    def _logarithmic(self) -> Mask:
        """Whether each parameter varies by its logarithm; (n_parameter,)."""
        return np.array([parameter.positive for parameter in self.parameters], bool)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of each coordinate: the name of its first parameter."""
        numbers, first = np.unique(self.coordinate_of, return_index=True)
        return tuple(self.parameters[index].name for index in first[numbers >= 0].tolist())

    def _displacement(self, x: Real) -> Real:
        """Return ``scale x`` of each parameter, zero for a fixed one; (n_parameter,)."""
        return np.where(self.free, self.scale * np.append(x, 0.0)[self.coordinate_of], 0.0)

    def theta(self, x: Real) -> Real:
        """Return the parameters at x [SI]; (n_parameter,)."""
        displacement, log = self._displacement(x), self._logarithmic
        growth = np.clip(displacement, -_MAX_LOGARITHM, _MAX_LOGARITHM)
        theta: Real = np.where(log, self.fixed * np.exp(np.where(log, growth, 0.0)), self.fixed)
        return theta + np.where(log, 0.0, displacement)

    def rates(self, x: Real) -> Real:
        """Return d theta / dx of each parameter by its own coordinate; (n_parameter,)."""
        return self.scale * np.where(self._logarithmic, self.theta(x), 1.0) * self.free

    def coordinates(self, theta: Real) -> Real:
        """Return the x of a theta; tied parameters give the mean of their values; (n_x,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            displacement = np.where(
                self._logarithmic, np.log(theta / self.fixed), theta - self.fixed
            )
        values = np.where(self.free, displacement / self.scale, 0.0)[self.free]
        total = np.bincount(self.coordinate_of[self.free], values, self.size)
        return total / np.bincount(self.coordinate_of[self.free], minlength=self.size)

    def parameters_at_bound(self, x: Real) -> Mask:
        """Return whether each parameter is at a bound; (n_parameter,)."""
        return np.append(self.coordinates_at_bound(x), False)[self.coordinate_of]

    def coordinates_at_bound(self, x: Real) -> Mask:
        """Return whether each coordinate is at a bound; (n_x,)."""
        return (x <= self.lower + _BOUND_MARGIN) | (x >= self.upper - _BOUND_MARGIN)

    def coordinates_within_bounds(self, x: Real) -> Mask:
        """Return whether each coordinate is within its bounds, or at one; (n_x,)."""
        return (x >= self.lower - _BOUND_MARGIN) & (x <= self.upper + _BOUND_MARGIN)

    def gradient_by_coordinates(self, gradient: Real, x: Real) -> Real:
        """Return a gradient by x from one by theta (chain rule).

        Args:
            gradient: derivatives by theta; (n_parameter,).
            x: coordinates; (n_x,).

        Returns:
            Derivatives by x; (n_x,).
        """
        terms = (gradient * self.rates(x))[self.free]
        total = np.zeros(self.size)
        np.add.at(total, self.coordinate_of[self.free], terms)
        return total

    def restrict(self, kept: Mask, x: Real) -> "Parametrisation":
        """Return a parametrisation of some coordinates; the others stay fixed at x.

        Args:
            kept: whether each coordinate stays; (n_x,).
            x: coordinates; (n_x,).
        """
        number = np.where(kept, np.cumsum(kept) - 1, -1)
        return replace(
            self,
            coordinate_of=np.append(number, -1)[self.coordinate_of],
            fixed=self.theta(np.where(kept, 0.0, x)),
            is_tolerance=self.is_tolerance[kept],
            precision=self.precision[kept],
            lower=self.lower[kept],
            upper=self.upper[kept],
        )

    def lift_bounds(self) -> "Parametrisation":
        """Return a parametrisation without the 2.5-sigma bounds of tolerances.

        The pulls of such a fit show where a fault hides. Bounds that a user gave stay.
        """
        return replace(
            self,
            lower=np.where(
                self.is_tolerance & (self.lower == -TOLERANCE_BOUND_SIGMA), -np.inf, self.lower
            ),
            upper=np.where(
                self.is_tolerance & (self.upper == TOLERANCE_BOUND_SIGMA), np.inf, self.upper
            ),
        )

    def widen_bounds(self, chosen: Mask, bound: float) -> "Parametrisation":
        """Return a parametrisation in which some tolerances have a wider bound.

        Other tolerances keep their bounds, and so do coordinates with bounds from the user.

        Args:
            chosen: whether each coordinate's bounds are widened; (n_x,).
            bound: new bound [standard deviations].
        """
        widened = chosen & self.is_tolerance
        return replace(
            self,
            lower=np.where(widened & (self.lower == -TOLERANCE_BOUND_SIGMA), -bound, self.lower),
            upper=np.where(widened & (self.upper == TOLERANCE_BOUND_SIGMA), bound, self.upper),
        )

    def release_priors(self, names: Sequence[str]) -> "Parametrisation":
        """Return a parametrisation in which some tolerances have neither prior nor bounds.

        A fault behind such a tolerance may then have any size.
        """
        chosen = np.isin(np.array(self.names), list(names))
        return replace(
            self,
            is_tolerance=self.is_tolerance & ~chosen,
            precision=np.where(chosen, 0.0, self.precision),
            lower=np.where(chosen, -np.inf, self.lower),
            upper=np.where(chosen, np.inf, self.upper),
        )

    def vary_linearly(self, names: Sequence[str]) -> "Parametrisation":
        """Return a parametrisation in which some sizes vary linearly instead of by their logarithm.

        The new coordinate is (exp(scale x) - 1) / scale of the old one, so that both move the size
        equally near the nominal model; bounds are converted. If a sum of two parameters is
        constant, the misfit's valley is straight in these coordinates.
        """
        chosen = np.isin(np.array(self.names), list(names)) & self.is_logarithmic
        is_chosen = np.append(chosen, False)[self.coordinate_of]
        scales, pairs = self.scales, zip(self.parameters, is_chosen.tolist(), strict=True)
        lower, upper = self.lower.copy(), self.upper.copy()
        for ends in (lower, upper):
            ends[chosen] = np.expm1(scales[chosen] * ends[chosen]) / scales[chosen]
        return replace(
            self,
            parameters=tuple(
                replace(parameter, positive=False) if is_linear else parameter
                for parameter, is_linear in pairs
            ),
            scale=np.where(is_chosen, self.scale * self.fixed, self.scale),
            lower=lower,
            upper=upper,
        )

    def extend(self, whole: "Parametrisation") -> "Parametrisation":
        """Return a parametrisation with the additional parameters of a larger model.

        The coordinates of this parametrisation come first and keep whatever a user specified; those
        of the additional parameters follow.

        Args:
            whole: parametrisation of a model that has all parameters of this one (by name) and
                further ones in any order.
        """
        index_of = {parameter.name: index for index, parameter in enumerate(self.parameters)}
        old = np.array([index_of.get(parameter.name, -1) for parameter in whole.parameters], int)
        is_new = old < 0
        added = whole.free & is_new
        coordinates = whole.coordinate_of[added]
        pairs = zip(old.tolist(), whole.parameters, strict=True)
        return Parametrisation(
            tuple(parameter if index < 0 else self.parameters[index] for index, parameter in pairs),
            coordinate_of=np.where(
                added, self.size + np.cumsum(added) - 1, np.append(self.coordinate_of, -1)[old]
            ),
            scale=np.where(is_new, whole.scale, np.append(self.scale, 1.0)[old]),
            fixed=np.where(is_new, whole.fixed, np.append(self.fixed, 0.0)[old]),
            is_tolerance=np.append(self.is_tolerance, whole.is_tolerance[coordinates]),
            precision=np.append(self.precision, whole.precision[coordinates]),
            lower=np.append(self.lower, whole.lower[coordinates]),
            upper=np.append(self.upper, whole.upper[coordinates]),
        )

    def tie_parameters(self, ties: Mapping[str, str]) -> "Parametrisation":
        """Return a parametrisation in which some parameters take the value of others.

        A parameter that follows a fixed one is fixed too; one that follows a linear one is linear.

        Args:
            ties: name of the parameter to follow, of equal unit, by name of the follower.
        """
        index_of = {parameter.name: k for k, parameter in enumerate(self.parameters)}
        member, scale, fixed = self.coordinate_of.copy(), self.scale.copy(), self.fixed.copy()
        parameters = list(self.parameters)
        for name, followed in ties.items():
            follower, leader = index_of[name], index_of[followed]
            member[follower], scale[follower] = member[leader], scale[leader]
            fixed[follower] = fixed[leader]
            is_size = parameters[leader].positive
            parameters[follower] = replace(parameters[follower], positive=is_size)
        kept = np.unique(member[member >= 0])
        number = np.full(self.size + 1, -1)
        number[kept] = np.arange(len(kept))
        return replace(
            self,
            parameters=tuple(parameters),
            coordinate_of=number[member],
            scale=scale,
            fixed=fixed,
            is_tolerance=self.is_tolerance[kept],
            precision=self.precision[kept],
            lower=self.lower[kept],
            upper=self.upper[kept],
        )

    @cached_property
    def is_logarithmic(self) -> Mask:
        """Whether each coordinate is the logarithm of a size; (n_x,)."""
        logarithmic = np.zeros(self.size, bool)
        logarithmic[self.coordinate_of[self.free]] = self._logarithmic[self.free]
        return logarithmic

    @cached_property
    def scales(self) -> Real:
        """Scale of each coordinate; (n_x,)."""
        scales = np.ones(self.size)
        scales[self.coordinate_of[self.free]] = self.scale[self.free]
        return scales

    @property
    def has_user_bounds(self) -> Mask:
        """Whether the bounds of each coordinate differ from the default of its kind; (n_x,)."""
        is_default = (self.lower == -TOLERANCE_BOUND_SIGMA) & (self.upper == TOLERANCE_BOUND_SIGMA)
        is_undrawn = np.isin(self.names, [p.name for p in self.parameters if _is_undrawn(p)])
        return ~(self.is_tolerance & is_default) & ~is_undrawn
