"""Families of restoring laws: the parameters of each effect, where they begin, and their law."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from diagnosis.levels.restoring_laws import CubicLaw, GapLaw, RestoringLaw, SlidingLaw
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Real
from mbmodel import Addition, Edit, Parameter
from mbmodel.nonlinear_joints.laws import GapSpring, JenkinsElement, PolynomialSpring

Value = float | tuple[float, ...]


@dataclass(frozen=True, eq=False)
class LawFamily:
    """Laws of one effect at one joint direction.

    Args:
        effect: as the verdict calls it.
        parameters: names and units of its parameters; the last one may be the joint's stiffness.
        is_size: whether each is a positive size; sizes vary by their logarithm.
        starts: values at which a fit may begin, for the joint's stiffness and the largest stretch
            of the linear machine under a hit of the middle level.
        bounds: lowest and highest value of each parameter, for that stiffness and the largest
            stretch of the linear machine under any hit; infinite where nothing bounds it.
        stuck: stiffness of the element at rest, beside the joint's spring, for its parameters.
        law: law beside the linear machine with that stiffness, for its parameters.
        similarity: a parameter by its number, and a power p: hits that are s times as strong show
            what usual ones do if that parameter is s^p times as large.
        state: parameters of the verdict.
        write: elements of an MJCF that hold the law at a joint, by its name, for its parameters.
        follows_stiffness: whether the last parameter follows the fitted stiffness of the joint.
        softest_is_linear: whether the joint is linear where it is softest: it stiffens with the
            level; the others are linear where they are stiffest.
    """

    effect: str
    parameters: tuple[tuple[str, str], ...]
    is_size: tuple[bool, ...]
    starts: Callable[[float, float], tuple[tuple[float, ...], ...]]
    bounds: Callable[[float, float], tuple[tuple[float, float], ...]]
    stuck: Callable[[Real], float]
    law: Callable[[Real], RestoringLaw]
    similarity: tuple[int, float]
    state: Callable[[Real], dict[str, Value]]
    write: Callable[[str, Real], tuple[Edit | Addition, ...]]
    follows_stiffness: bool = False
    softest_is_linear: bool = False

    @property
    def is_force(self) -> tuple[bool, ...]:
        """Whether each parameter scales with forces, by its unit."""
        return tuple(unit.startswith("N") for _, unit in self.parameters)

    @property
    def count(self) -> int:
        """Number of parameters besides the joint's stiffness."""
        return len(self.parameters) - int(self.follows_stiffness)

    def complete(self, values: Real, stiffness: float) -> Real:
        """Return all parameters; (n_parameter,).

        Args:
            values: those besides the joint's stiffness; (count,).
            stiffness: of the joint.
        """
        return np.append(values, stiffness) if self.follows_stiffness else values

    def parameters_at(self, prefix: str, start: tuple[float, ...]) -> tuple[Parameter, ...]:
        """Return the parameters of a Part whose nominal values are a start.

        Args:
            prefix: begins their names.
            start: value of each.
        """
        return tuple(
            Parameter(f"{prefix}.{name}", value, unit, positive=size)
            for (name, unit), size, value in zip(self.parameters, self.is_size, start, strict=True)
        )


def _friction_starts(stiffness: float, stretch: float) -> tuple[tuple[float, ...], ...]:
    """Return starts: the element has part of the stiffness at rest, and slides early or late."""
    return tuple(
        (share * stiffness, limit * share * stiffness * stretch)
        for share, limit in product(LEVEL_SETTINGS.element_shares, LEVEL_SETTINGS.slip_shares)
    )


def _friction_bounds(stiffness: float, stretch: float) -> tuple[tuple[float, float], ...]:
    force = stiffness * stretch
    (softest, stiffest), (least, most) = LEVEL_SETTINGS.element_ends, LEVEL_SETTINGS.slip_ends
    return (softest * stiffness, stiffest * stiffness), (least * force, most * force)


def _cubic_starts(sign: float) -> Callable[[float, float], tuple[tuple[float, ...], ...]]:
    """Return starts of |k3|: the spring is stiffer by a share of its stiffness at the stretch."""

    def starts(stiffness: float, stretch: float) -> tuple[tuple[float, ...], ...]:
        chosen = LEVEL_SETTINGS
        shares = chosen.stiffening_shares if sign > 0 else chosen.softening_shares
        return tuple((share * stiffness / stretch**2, stiffness) for share in shares)

    return starts


def _cubic_bounds(sign: float) -> Callable[[float, float], tuple[tuple[float, float], ...]]:
    """Return bounds of |k3|; a softening spring keeps half its tangent under the largest hit."""
    chosen = LEVEL_SETTINGS
    least, most = chosen.stiffening_ends if sign > 0 else chosen.softening_ends

    def bounds(stiffness: float, stretch: float) -> tuple[tuple[float, float], ...]:
        unit = stiffness / stretch**2
        return (least * unit, most * unit), (0.0, np.inf)

    return bounds


def _gap_bounds(stiffness: float, stretch: float) -> tuple[tuple[float, float], ...]:
    del stiffness
    shortest, longest = LEVEL_SETTINGS.gap_ends
    return (shortest * stretch, longest * stretch), LEVEL_SETTINGS.centre_ends, (0.0, np.inf)


def _gap_starts(centre: float) -> Callable[[float, float], tuple[tuple[float, ...], ...]]:
    def starts(stiffness: float, stretch: float) -> tuple[tuple[float, ...], ...]:
        return tuple((share * stretch, centre, stiffness) for share in LEVEL_SETTINGS.gap_shares)

    return starts


def _loose_gap_starts(stiffness: float, stretch: float) -> tuple[tuple[float, ...], ...]:
    """Return starts of gaps that the motion does not leave at the lowest level."""
    return tuple((share * stretch, 0.0, stiffness) for share in LEVEL_SETTINGS.loose_gap_shares)


def _cubic_law(sign: float, theta: Real) -> RestoringLaw:
    return CubicLaw(sign * float(theta[0]))


def _state_cubic(sign: float, theta: Real) -> dict[str, Value]:
    return {"k3": sign * float(theta[0])}


def _write_friction(joint: str, theta: Real) -> tuple[Edit | Addition, ...]:
    return JenkinsElement(joint, float(theta[0]), float(theta[1])).changes(0.0)


def _write_cubic(sign: float, joint: str, theta: Real) -> tuple[Edit | Addition, ...]:
    return PolynomialSpring(joint, float(theta[1]), 0.0, sign * float(theta[0])).changes(0.0)


def _write_gap(joint: str, theta: Real) -> tuple[Edit | Addition, ...]:
    """Return the gap spring; a centre below zero rests against its upper side."""
    gap, ratio, stiffness = theta.tolist()
    preload = -np.sign(ratio) * stiffness * gap * max(abs(ratio) - 1, 0.0)
    return GapSpring(joint, stiffness, gap, float(preload)).changes(0.0)


def _state_gap(theta: Real) -> dict[str, Value]:
    gap, ratio, stiffness = theta
    preload = stiffness * gap * max(abs(ratio) - 1, 0.0)
    return {"gap": float(gap), "preload": float(preload)}


def _build_friction() -> LawFamily:
    """Return a spring and a slider in series beside the joint's spring."""
    return LawFamily(
        "friction",
        (("k", "N/m or N m/rad"), ("limit", "N or N m")),
        (True, True),
        _friction_starts,
        _friction_bounds,
        stuck=lambda theta: float(theta[0]),
        law=lambda theta: SlidingLaw(float(theta[0]), float(theta[1])),
        similarity=(1, -1.0),
        state=lambda theta: {"k": float(theta[0]), "limit": float(theta[1])},
        write=_write_friction,
    )


FRICTION = (_build_friction(),)


def _build_cubic(sign: float) -> LawFamily:
    """Return stiffening springs, or softening ones if the sign is negative."""
    return LawFamily(
        "hardening",
        (("k3", "N/m^3 or N m/rad^3"), ("stiffness", "N/m or N m/rad")),
        (True, True),
        _cubic_starts(sign),
        _cubic_bounds(sign),
        stuck=lambda theta: 0.0,
        law=partial(_cubic_law, sign),
        similarity=(0, 2.0),
        state=partial(_state_cubic, sign),
        write=partial(_write_cubic, sign),
        follows_stiffness=True,
        softest_is_linear=sign > 0,
    )


HARDENING = tuple(map(_build_cubic, LEVEL_SETTINGS.cubic_signs))


def _build_gap(starts: Callable[[float, float], tuple[tuple[float, ...], ...]]) -> LawFamily:
    """Return gaps whose fits begin at some starts."""
    return LawFamily(
        "backlash",
        (("gap", "m or rad"), ("centre", "of the gap"), ("stiffness", "N/m or N m/rad")),
        (True, False, True),
        starts,
        _gap_bounds,
        stuck=lambda theta: 0.0,
        law=lambda theta: GapLaw(float(theta[2]), float(theta[0]), float(theta[0] * theta[1])),
        similarity=(0, -1.0),
        state=_state_gap,
        write=_write_gap,
        follows_stiffness=True,
    )


BACKLASH = tuple(_build_gap(_gap_starts(centre)) for centre in LEVEL_SETTINGS.gap_centres)
LOOSE_GAP = _build_gap(_loose_gap_starts)
FAMILIES = {family[0].effect: family for family in (FRICTION, HARDENING, BACKLASH)}
