r"""What a test shows of every effect at every place, from the linear information alone.

An effect of size d changes the whitened FRFs by d r. Tuning follows a part of it, and what remains,

    g(d) = min_x  |d r - J x|^2 + sum_tolerances x^2 / 2,

is the gain in log likelihood of a fit that knows the effect, over one that does not [nats]: values
are complex with the variance 1, tolerances are real. Effects i and j have the Gram matrix

    G_ij = e_i^T e_j + sum_tolerances x_i x_j / 2,   x = N^-1 J^T r,   e = r - J x,

so that a fit with j instead of i gains the part G_ij^2 / (G_ii G_jj) of it. The slope r is taken at
a size whose change is about the noise, where FRFs are linear. A refit follows larger changes by
further steps, so that they stay linear beside its parameters.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from truth.campaign.linearised_test import LinearisedTest
from truth.campaign.tolerance_shift import ToleranceShift, list_without_tolerance, shift_of
from truth.effects import NONLINEAR, Draw, Effect, Scene
from truth.effects.places import hammer_site
from truth.errors import TruthError
from truth.machine.station import Mask, Real
from truth.random_streams import stream

_SHAPES_PER_DIRECTION = 4  # of an effect at each place, for each direction: a vector needs three
_MAX_SHAPE_DRAWS = 16  # of direction and shape
_MAX_SIZE_TRIALS = 6  # sizes that are tried
_NEAR = 3.0  # factor on the size within which it is near enough
_PRIOR = 0.5  # of the square of a tolerance in -ln L
_CHANGE = 1.0  # r^T r at the size of the slope
_SOLUTION_REFINEMENTS = 3  # of the solution of the normal equations, which loses digits
_NORMAL_MATRIX_RIDGE = 1e-12  # of the diagonal: for a spring that no sensor sees


@dataclass(frozen=True, eq=False)
class Signature:
    """One effect at one place, with one shape, at one size.

    Args:
        effect: its name.
        location: as in an answer, with the names ``acc<node>``.
        dof: as in an answer.
        drawn: the effect as it is drawn.
        change: r, per unit of the size, or of an effect that is there or not; (2 n_value,).
        followed: x, the parameters that follow it; (n_parameter,).
        left: e and the tolerances of x over sqrt(2), whose squares sum up to the gain.
        shift: of tolerances, if the effect is on what has some.
    """

    effect: str
    location: str
    dof: str
    drawn: Effect
    change: Real
    followed: Real
    left: Real
    shift: ToleranceShift

    @property
    def family(self) -> tuple[str, str, str]:
        """Effect, place and direction, which several shapes share."""
        return self.effect, self.location, self.dof


@dataclass(frozen=True, eq=False)
class Information:
    """The linear information of a whole test.

    Args:
        normal: N; (n_parameter, n_parameter).
        bounded: which parameters are tolerances; (n_parameter,).
    """

    normal: Real
    bounded: Mask

    def covariance(self) -> Real:
        """Return the inverse of N of the tolerances; (n_tolerance, n_tolerance)."""
        scale = np.sqrt(np.diag(self.normal))
        scale[scale == 0] = 1.0
        inner = self.normal / np.outer(scale, scale)
        inner[np.diag_indices_from(inner)] += _NORMAL_MATRIX_RIDGE
        inverse = np.linalg.inv(inner) / np.outer(scale, scale)
        tolerances: Real = inverse[np.ix_(self.bounded, self.bounded)]
        return tolerances


def find_signatures(
    test: LinearisedTest, effects: Mapping[str, Draw], places: Sequence[str], *, seed: int = 0
) -> tuple[list[Signature], Information]:
    """Return the signatures of effects at all places that can have them, and the information.

    Places that the test does not read or hit are left out, changes that no channel sees, and
    effects on what has no tolerance, which no diagnosis proposes.

    Args:
        test: the test of the machine without effects.
        effects: functions that draw them, by name. Those of the time domain are left out.
        places: locations; empty for all.
        seed: of directions and shapes.
    """
    project, without_tolerance = _Projection(test), list_without_tolerance(test.refit.tolerance)
    signatures = []
    for name, draw in effects.items():
        if name == "none" or name in NONLINEAR or name in without_tolerance:
            continue
        for place in places or list_places(test.scene):
            signatures += _signatures_at(project, name, draw, place, seed)
    return signatures, Information(project.normal, test.refit.bounded)


def _signatures_at(
    project: "_Projection", name: str, draw: Draw, place: str, seed: int
) -> list[Signature]:
    """Return an effect at a place in some shapes of each direction."""
    signatures: list[Signature] = []
    drawn: Counter[str] = Counter()
    for number in range(_MAX_SHAPE_DRAWS):
        random = stream(seed, f"signature.{name}.{place}.{number}")
        try:
            effect = draw(random, project.scene, place)
            if effect is None:
                break
            dof = effect.answer().dof
            if drawn[dof] >= (1 if effect.size is None else _SHAPES_PER_DIRECTION):
                continue
            drawn[dof] += 1
            signature = project.signature(name, effect)
        except (TruthError, np.linalg.LinAlgError):
            break  # the place cannot have this effect
        if signature is None:
            drawn[dof] = _MAX_SHAPE_DRAWS  # no channel sees this direction
        else:
            signatures.append(signature)
    return signatures


def list_places(scene: Scene) -> list[str]:
    """Return all locations of a machine and its test, as in answers."""
    names = [stage.name for stage in scene.station.stages]
    hits = sorted({occasion.node for occasion in scene.occasions if occasion.node >= 0})
    return [
        *(f"body:{name}" for name in names),
        *(f"joint:{name}" for name in names),
        *(f"sensor:acc{sensor.node}" for _, sensor in scene.station.sensors()),
        *(f"hammer:{hammer_site(scene.station, node)}" for node in hits),
        *(f"pair:{a}-{b}" for number, a in enumerate(names) for b in names[number + 1 :]),
    ]


def gram_matrix(signatures: Sequence[Signature]) -> Real:
    """Return G of signatures per unit of their sizes [nats]; (n, n)."""
    left = np.array([signature.left for signature in signatures])
    gram: Real = left @ left.T
    return gram


def families(signatures: Sequence[Signature]) -> Iterator[tuple[tuple[str, str, str], list[int]]]:
    """Go through effect, place and direction, with the numbers of their signatures."""
    known: dict[tuple[str, str, str], list[int]] = {}
    for number, signature in enumerate(signatures):
        known.setdefault(signature.family, []).append(number)
    yield from known.items()


class _Projection:
    """Whitened changes of a test, and the part that its parameters follow."""

    def __init__(self, test: LinearisedTest) -> None:
        self.refit, self.scene, self.lines = test.refit, test.scene, np.sqrt(test.scale)
        prior = np.diag(test.refit.bounded.astype(float))
        self.normal = test.scale * (test.refit.normal - prior) + _PRIOR * prior
        scale = np.sqrt(np.diag(self.normal))
        scale[scale == 0] = 1.0
        inner = self.normal / np.outer(scale, scale)
        inner[np.diag_indices_from(inner)] += _NORMAL_MATRIX_RIDGE
        self.scale = scale
        self.factor = scipy.linalg.cho_factor(inner)

    def signature(self, name: str, effect: Effect) -> Signature | None:
        """Return the signature of an effect; None if no channel sees it."""
        slope = self._slope(effect)
        if not slope.any():
            return None
        bounded = self.refit.bounded
        followed, left = np.zeros(len(bounded)), slope
        for _ in range(_SOLUTION_REFINEMENTS):
            right = self.lines * self.refit.adjoint(left) - _PRIOR * bounded * followed
            step = scipy.linalg.cho_solve(self.factor, right / self.scale) / self.scale
            followed = followed + step
            left = slope - self.lines * self.refit.whitened_motion(followed)
        answer = effect.answer()
        both = np.concatenate([left, np.sqrt(_PRIOR) * followed[bounded]])
        shift = shift_of(effect, self.refit.tolerance)
        return Signature(name, answer.location, answer.dof, effect, slope, followed, both, shift)

    def _slope(self, effect: Effect) -> Real:
        """Return the whitened change per unit of the size, where the FRFs are linear."""
        tried, size = effect, effect.size
        change = self._change(tried)
        for _ in range(_MAX_SIZE_TRIALS):
            if size is None or effect.limits is None or not change.any():
                break
            factor = float(np.sqrt(_CHANGE / (change @ change)))
            if 1 / _NEAR < factor < _NEAR:
                break
            size *= factor
            tried = effect.sized(size)
            change = self._change(tried)
        return change / (size or 1.0)

    def _change(self, effect: Effect) -> Real:
        change = self.refit.change(replace(self.refit.machine, effects=(effect,)))
        return np.asarray(self.lines * self.refit.whiten(change))
