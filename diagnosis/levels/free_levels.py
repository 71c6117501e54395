"""Joint directions whose stiffness and damping are free at each level: what a law would explain.

A law of friction, a gap or a cubic spring makes a joint's stiffness and damping depend on the level
of the hits. Before any law is tried, every sprung direction is scored with a stiffness and a
damping of its own at each level but the lowest,

    K + dk_l,   C + dc_l   at level l,

2 (L - 1) numbers for L levels, linear and with exact slopes. All three effects propose them, where
the residuals depend on the level; ``refit_laws`` then fits the laws.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from diagnosis.hypothesis import Hypothesis, JointDirection, Scene
from diagnosis.inference.calibration import find_variance_source, load_calibration
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.refits.level_dependence import measure_level_dependence
from diagnosis.scene_points import find_middle_frequency, find_sprung_stages
from identification.words import Campaign, Condition
from mbmodel import AddedPart, Change, Parameter
from tuning import predict, thin_lines

LAW_EFFECTS = ("friction", "backlash", "hardening")  # they depend on the level


def list_levels(campaign: Campaign) -> tuple[float, ...]:
    """Return the levels of a campaign, the lowest first; empty if a test does not state its own.

    Laws are simulated about one machine: tests with models or poses of their own show no levels.
    """
    if len(campaign.variants) > 1:
        return ()
    levels = {test.condition.level_n for test in campaign.tests}
    return () if None in levels else tuple(sorted(level for level in levels if level is not None))


def list_sprung_directions(scene: Scene) -> Iterator[JointDirection]:
    """Return the joint directions with a spring along one axle."""
    machine = scene.model.machine
    springs = {spring.name for spring in machine.springs}
    tuned = {parameter.name for parameter in scene.model.parameters}
    for stage in find_sprung_stages(machine):
        for axle in machine.axles:
            is_tuned = axle.joint in springs and f"{axle.joint}.stiffness" in tuned
            if axle.stage == stage and is_tuned:
                yield JointDirection(stage, axle.dof, axle.joint)


def free_each_level(scene: Scene, joint: JointDirection, effect: str) -> Hypothesis:
    """Return a joint direction whose stiffness and damping are free at each level.

    Args:
        scene: fit about which it is proposed.
        joint: the direction.
        effect: as the hypothesis is called.
    """
    machine = scene.model.machine
    direction = {spring.name: spring.direction for spring in machine.springs}[joint.spring]
    column = direction[:, None]
    middle = find_middle_frequency(scene)
    stiffness = LEVEL_SETTINGS.level_unit * float(scene.find_stiffness((joint.spring,))[0])
    cores = np.zeros((2, 3, 1, 1))
    cores[0, 0], cores[1, 1] = stiffness, stiffness / middle
    parts = []
    for number, level in enumerate(list_levels(scene.session.campaign)[1:], 1):
        parameters = tuple(
            Parameter(f"{joint.spring}.{effect}.level{number}.{kind}", 0.0, unit, positive=False)
            for kind, unit in (("stiffness", f"{stiffness:g} N/m"), ("damping", "per rad/s"))
        )
        when = partial(_is_at_level, level)
        slopes = (Change("joint", column, column, cores),)
        parts.append(AddedPart.linear(f"joint:{joint.stage}", parameters, slopes, when))
    return Hypothesis(effect, f"joint:{joint.stage}", joint.dof, parts=tuple(parts), spring=joint)


def propose_law(effect: str, scene: Scene) -> Iterator[Hypothesis]:
    """Propose an effect that depends on the level, at each sprung joint direction.

    Args:
        effect: its name.
        scene: fit about which it is proposed, whose residuals may depend on the level.
    """
    levels = list_levels(scene.session.campaign)
    if len(levels) > 1 and not _lags_behind_input(scene) and _depends_on_level(scene):
        for joint in list_sprung_directions(scene):
            yield free_each_level(scene, joint, effect)


def _lags_behind_input(scene: Scene) -> bool:
    """Return whether a motor with a state drives a test: laws are simulated under forces alone."""
    motors = scene.model.machine.motors
    gains = (motors.get(test.condition.reference.point) for test in scene.session.campaign.tests)
    return any(gain is not None and gain.activation is not None for gain in gains)


def _depends_on_level(scene: Scene) -> bool:
    """Return whether residuals depend on the level by more than a badly known variance hides.

    Where no point was hit at several levels, they may.
    """
    campaign = thin_lines(scene.session.campaign, scene.settings.score_stride)
    excess = measure_level_dependence(predict(scene.model, scene.theta, campaign), campaign)
    return (
        excess is None
        or excess > load_calibration().hidden[find_variance_source(scene.session.campaign)]
    )


def _is_at_level(level: float, condition: Condition) -> float:
    return float(condition.level_n == level)
