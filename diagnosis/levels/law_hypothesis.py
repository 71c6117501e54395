"""Hypothesis of a law at a joint direction: a Part for each kind of hit, about one linear machine.

Peak, duration and scatter of the hits are estimates (``hammer_pulse``): the peak of each kind of
hit, and the duration and variance of all, are tolerances that are fitted with the law.

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
    *,
    table: LawTable | None = None,
    radius: float = LEVEL_SETTINGS.largest_start_step,
) -> Hypothesis:
    """Return a law of a joint direction about the linear machine of a scene.

    Args:
        scene: fit about which the law is simulated.
        start: values at which its parameters begin.
        hits: values at which the tolerances of the hits begin, by their names; 1 if None.
        table: the law as it was simulated there; None to simulate it.
        radius: largest change of a coordinate of the law, and of the joint's spring and damper.
    """
    if table is None:
        table = LawTable.simulate(*plan_simulation(scene, joint, family, start, hits))
    tested, prefix, tolerances = table.joint, _name_law(joint, family), dict(hits or {})
    first = family.parameters_at(prefix, start)
    followers = _list_followers(scene, tested, joint, family, prefix)
    shared = (
        *first,
        *followers.values(),
        Parameter(f"{prefix}.hit_duration", 1.0, "of the estimated one"),
        Parameter(f"{prefix}.hit_variance", 1.0, "of the usual one"),
    )
    follow = {p.name: _name_followed(joint, kind) for kind, p in followers.items()}
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
        bounds=_convert_bounds(first, ends, radius)
        | _bound_linear(scene, joint, radius)
        | _bound_tolerances(believed),
        believed=believed,
        follow=follow,
        state=state,
    )


def plan_simulation(
    scene: Scene,
    joint: JointDirection,
    family: LawFamily,
    start: tuple[float, ...],
    hits: Mapping[str, float] | None,
) -> tuple[TestedJoint, LawFamily, tuple[float, ...], tuple[str, ...]]:
    """Return the arguments of ``LawTable.simulate`` for those of ``build_law_hypothesis``."""
    tested, prefix = TestedJoint.of_scene(scene, joint), _name_law(joint, family)
    followers = _list_followers(scene, tested, joint, family, prefix)
    linear = (parameter.drawn for parameter in followers.values())
    duration = (hits or {}).get(f"{prefix}.hit_duration", 1.0)
    return tested, family, (*start, *linear, duration), tuple(followers)


def _name_law(joint: JointDirection, family: LawFamily) -> str:
    """Return the prefix of a law's parameters."""
    return f"{joint.spring}.{family.effect}"


def _list_followers(
    scene: Scene, tested: TestedJoint, joint: JointDirection, family: LawFamily, prefix: str
) -> dict[str, Parameter]:
    """Return a parameter for the joint's spring, damper or mass that varies beside the law's."""
    tuned = dict(zip((p.name for p in scene.model.parameters), scene.theta.tolist(), strict=True))
    spring = ("stiffness", tested.stiffness, "N/m or N m/rad")
    damper = ("damping", tested.damping, "N s/m or N m s/rad")
    mass = ("mass", tuned.get(_name_followed(joint, "mass"), 0.0), "kg")
    kinds = (damper, mass) if family.follows_stiffness else (spring, damper, mass)
    return {
        kind: Parameter(f"{prefix}.linear_{kind}", value, unit)
        for kind, value, unit in kinds
        if _name_followed(joint, kind) in tuned and value > 0
    }


def _name_followed(joint: JointDirection, kind: str) -> str:
    """Return the parameter of the machine that one of a law follows."""
    return f"{joint.stage if kind == 'mass' else joint.spring}.{kind}"


def _convert_bounds(
    parameters: tuple[Parameter, ...], ends: tuple[tuple[float, float], ...], radius: float
) -> dict[str, tuple[float, float]]:
    """Return bounds of coordinates: of a size, of the logarithm of its ratio to its start."""
    bounds: dict[str, tuple[float, float]] = {}
    for parameter, pair in zip(parameters, ends, strict=True):
        start, values = parameter.drawn, np.array(pair)
        with np.errstate(divide="ignore"):
            low, high = np.log(values / start) if parameter.positive else values - start
        low, high = max(float(low), -radius), min(float(high), radius)
        bounds[parameter.name] = min(low, 0.0), max(high, 0.0)
    return bounds


def _bound_linear(
    scene: Scene, joint: JointDirection, radius: float
) -> dict[str, tuple[float, float]]:
    """Return the bounds of the joint's own spring and damper about the scene."""
    varies = scene.session.parametrisation
    x, bounds = varies.coordinates(scene.theta), {}
    for name in (f"{joint.spring}.stiffness", f"{joint.spring}.damping"):
        if name in varies.names:
            k = varies.names.index(name)
            reach = radius / float(varies.scale[varies.coordinate_of == k][0])
            low, high = max(varies.lower[k], x[k] - reach), min(varies.upper[k], x[k] + reach)
            bounds[name] = float(low), float(high)
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
        values, _ = self.table.at(theta, self.number)
        return (self._change(values, np.eye(3)[0, :, None, None]),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the derivatives of the stiffness by each parameter."""
        if not self.acts(context.condition):
            return ()
        _, derivatives = self.table.at(theta, self.number)
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
