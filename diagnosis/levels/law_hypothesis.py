"""Hypothesis of a law at a joint direction: a Part for each kind of hit, about one linear machine.

A refit moves the machine about which the law was simulated, so that the Parts are built again about
each refit until nothing changes (``refit_laws``). Peak, duration and scatter of the hits are
estimates (``hammer_pulse``): the peak of each kind of hit, and the duration and
variance of all, are tolerances that are fitted with the law.

Part of a restoring law in the tests with equal hits.

The law acts on the lines of a test as the complex stiffness that it shows under a hit of that
test's level (``joint_transient``). It is simulated about one linear machine. All set-ups of one
level and hammer point have equal hits, and one Part, so that one evaluation answers them all.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.law_simulation import compute_peak_stretch
from diagnosis.levels.law_table import LawTable
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from diagnosis.stated_values import Value
from identification.words import TOLERANCE_BOUND_SIGMA, Complex, Condition, Real
from mbmodel import Addition, Change, Edit, Parameter, PartContext


def build_law_hypothesis(
    scene: Scene,
    joint: JointDirection,
    family: LawFamily,
    start: tuple[float, ...],
    hits: Mapping[str, float] | None = None,
) -> Hypothesis:
    """Return a law of a joint direction about the linear machine of a scene.

    Args:
        scene: fit about which the law is simulated.
        start: values at which its parameters begin.
        hits: values at which the tolerances of the hits begin, by their names; 1 if None.
    """
    tested = TestedJoint.of_scene(scene, joint)
    prefix = f"{joint.spring}.{family.effect}"
    tolerances = dict(hits or {})
    first = family.parameters_at(prefix, start)
    followers = _list_followers(scene, tested, joint, family, prefix)
    linear = tuple(parameter.drawn for parameter in followers.values())
    duration = tolerances.get(f"{prefix}.hit_duration", 1.0)
    table = LawTable(tested, family, (*start, *linear, duration), tuple(followers))
    shared = (
        *first,
        *followers.values(),
        Parameter(f"{prefix}.hit_duration", 1.0, "of the estimated one"),
        Parameter(f"{prefix}.hit_variance", 1.0, "of the usual one"),
    )
    follow = {p.name: f"{joint.spring}.{kind}" for kind, p in followers.items()}
    if family.follows_stiffness:
        follow[first[-1].name] = f"{joint.spring}.stiffness"
    deviations = LEVEL_SETTINGS.duration_sigma, LEVEL_SETTINGS.variance_sigma
    parts, believed = [], {p.name: sigma for p, sigma in zip(shared[-2:], deviations, strict=True)}
    place = tested.group_equal_hits()
    tests = scene.session.campaign.tests
    for number in sorted({int(np.argmax(place == group)) for group in place}):
        parameters = shared
        if number:
            parameters = tuple(replace(p, name=f"{p.name}@{number}") for p in shared)
            follow |= {p.name: q.name for p, q in zip(parameters, shared, strict=True)}
        peak = Parameter(f"{prefix}.hit_peak@{number}", 1.0, "of the estimated one")
        believed[peak.name] = LEVEL_SETTINGS.peak_sigma
        conditions = frozenset(tests[k].condition for k in np.flatnonzero(place == place[number]))
        location = f"joint:{joint.stage}"
        parts.append(
            LawPart(location, (*parameters, peak), table, number, conditions, joint.spring)
        )
    stretch = float(compute_peak_stretch(tested.transient(), tested.hits).max())
    ends = family.bounds(tested.stiffness, stretch)
    names = tuple(parameter.name for parameter in first)

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        return {**family.state(np.array([fitted[name] for name in names]))}

    return Hypothesis(
        family.effect,
        f"joint:{joint.stage}",
        joint.dof,
        parts=tuple(parts),
        begin=dict(zip(names, start, strict=True)) | dict.fromkeys(believed, 1.0) | tolerances,
        bounds=_convert_bounds(first, ends) | _bound_tolerances(believed),
        believed=believed,
        follow=follow,
        state=state,
    )


def _list_followers(
    scene: Scene, tested: TestedJoint, joint: JointDirection, family: LawFamily, prefix: str
) -> dict[str, Parameter]:
    """Return a parameter for the joint's spring or damper that varies beside those of the law."""
    tuned = {parameter.name for parameter in scene.model.parameters}
    spring = ("stiffness", tested.stiffness, "N/m or N m/rad")
    damper = ("damping", tested.damping, "N s/m or N m s/rad")
    return {
        kind: Parameter(f"{prefix}.linear_{kind}", value, unit)
        for kind, value, unit in ((damper,) if family.follows_stiffness else (spring, damper))
        if f"{joint.spring}.{kind}" in tuned and value > 0
    }


def _convert_bounds(
    parameters: tuple[Parameter, ...], ends: tuple[tuple[float, float], ...]
) -> dict[str, tuple[float, float]]:
    """Return bounds of coordinates: of a size, of the logarithm of its ratio to its start."""
    bounds: dict[str, tuple[float, float]] = {}
    for parameter, pair in zip(parameters, ends, strict=True):
        if np.isfinite(pair).all():
            start, values = parameter.drawn, np.array(pair)
            low, high = np.log(values / start) if parameter.positive else values - start
            bounds[parameter.name] = float(min(low, 0.0)), float(max(high, 0.0))
    return bounds


def _bound_tolerances(believed: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return the bounds of tolerances by their standard deviations."""
    return {
        name: (-TOLERANCE_BOUND_SIGMA * sigma, TOLERANCE_BOUND_SIGMA * sigma)
        for name, sigma in believed.items()
    }


@dataclass(frozen=True, eq=False)
class LawPart:
    """A law in tests with equal hits, as a complex stiffness of the joint direction.

    Args:
        location: joint.
        parameters: of the law, in the order of the family; relative duration, variance and peak of
            the hits.
        table: of all tests.
        number: of the first of these tests.
        conditions: of the tests.
        spring: joint of the direction.
    """

    location: str
    parameters: tuple[Parameter, ...]
    table: LawTable
    number: int
    conditions: frozenset[Condition]
    spring: str

    def acts(self, condition: Condition | None) -> float:
        """Return whether a test is one of the Part's own."""
        return float(condition in self.conditions)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the stiffness at theta."""
        if not self.acts(context.condition):
            return ()
        middle, slopes = self.table.at(theta[:-1])
        values = middle[self.number] + np.log(theta[-1]) * slopes[-1, self.number]
        return (self._change(values, np.eye(3)[0, :, None, None]),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the stiffness by each parameter."""
        if not self.acts(context.condition):
            return ()
        derivatives = self.table.at(theta[:-1])[1][:, self.number].copy()
        derivatives[-1] /= theta[-1]
        cores = np.zeros((len(theta), len(theta), 3, 1, 1))
        cores[np.arange(len(theta)), np.arange(len(theta)), 0] = 1.0
        return tuple(self._change(row, core) for row, core in zip(derivatives, cores, strict=True))

    def write(self, theta: Real) -> tuple[Edit | Addition, ...]:
        """Return the law as elements of an MJCF; the Part of the first test writes it for all."""
        if self.number:
            return ()
        count = len(self.table.family.parameters)
        return self.table.family.write(self.spring, theta[:count])

    def select_held(self, theta: Real) -> Real:
        """Return theta: the MJCF holds the law."""
        return theta

    def _change(self, values: Complex, core: Real) -> Change:
        column = self.table.joint.direction[:, None]
        shape = partial(_look_up, self.table.joint.freq_hz, values)
        return Change("joint", column, column, core, shape=shape)


def _look_up(freq_hz: Real, values: Complex, laplace: Complex) -> Complex:
    """Return a table's values at the nearest lines; conjugate below the real axis."""
    wanted = np.abs(laplace.imag) / (2 * np.pi)
    after = np.clip(np.searchsorted(freq_hz, wanted), 1, max(len(freq_hz) - 1, 1))
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(freq_hz) - 1)
    is_after = np.abs(freq_hz[after] - wanted) < np.abs(freq_hz[before] - wanted)
    nearest = values[np.where(is_after, after, before)]
    return np.where(laplace.imag < 0, nearest.conj(), nearest)
