"""A joint whose stiffness differs in one test, set-up or level: the machine warmed up in between.

One factor multiplies all springs of the joint in that test: K += (factor - 1) k, with the k fitted
to all tests. A test is one reference of one file. A set-up is all tests of one name.

Where tests were made at several levels, a joint may also drift from visit to visit,

    k_v = k (1 + s (d_2 + ... + d_v)),   d >= 0,   s = 1 or -1,

in all its springs or in one. It always drifts one way, so that it differs at a level that returns,
which a law that depends on the level does not. Without a return it is the rival of such laws.
"""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from diagnosis.effects.spring_laws import Law, evaluate_constant
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.labels import LEVELS
from diagnosis.levels.free_levels import list_levels
from diagnosis.scene_points import find_own_springs, find_sprung_stages, list_references
from diagnosis.stated_values import Value
from identification.level_check import group_visits
from identification.words import Complex, Condition


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint and each reference or set-up, if there are several."""
    machine = scene.model.machine
    conditions = [test.condition for test in scene.session.campaign.tests]
    setups = sorted({condition.setup for condition in conditions if condition.setup is not None})
    labels = [str(reference) for reference in list_references(scene)]
    whens = [*(labels if len(labels) > 1 else ()), *(setups if len(setups) > 1 else ())]
    visits = _list_visits(scene)
    for stage in find_sprung_stages(machine):
        springs, place = find_own_springs(machine, stage), f"joint:{stage}"
        for when in whens:

            def acts(condition: Condition, at: str = when) -> bool:
                return at in (str(condition.reference.positive), condition.setup)

            drift = Law.for_springs(
                scene, place, springs, f"{stage}.drift({when})", evaluate_constant, acts
            )

            def state(fitted: Mapping[str, float], spring_law: Law = drift) -> dict[str, Value]:
                return {"factor": 1 + fitted[spring_law.size_name]}

            yield from drift.propose("drift", when, state, signed=False)
        if len(visits) > 1:
            yield from _propose_between_levels(scene, stage, springs, visits)


def _list_visits(scene: Scene) -> list[frozenset[Condition]]:
    """Return the conditions of each visit to a level, in the order of the campaign."""
    campaign = scene.session.campaign
    if len(list_levels(campaign)) < 2:
        return []
    return [
        frozenset(test.condition for test in visited.tests) for _, visited in group_visits(campaign)
    ]


def _propose_between_levels(
    scene: Scene, stage: str, springs: tuple[str, ...], visits: list[frozenset[Condition]]
) -> Iterator[Hypothesis]:
    """Yield a joint that becomes stiffer or softer from each visit to a level to the next."""
    tuned = {parameter.name for parameter in scene.model.parameters}
    sprung = tuple(spring for spring in springs if f"{spring}.stiffness" in tuned)
    shapes = [sprung, *((spring,) for spring in sprung)] if len(sprung) > 1 else [sprung]
    for shape in filter(None, shapes):
        for sign in (1, -1):
            yield _drift_one_way(scene, stage, shape, visits, sign)


def _drift_one_way(
    scene: Scene,
    stage: str,
    springs: tuple[str, ...],
    visits: list[frozenset[Condition]],
    sign: int,
) -> Hypothesis:
    """Return springs of a joint that drift from visit to visit.

    Args:
        springs: those that drift.
        visits: conditions of each visit, in order.
        sign: 1 for stiffer, -1 for softer.
    """

    def start_at(first: int) -> Callable[[Condition], bool]:
        later = frozenset[Condition]().union(*visits[first:])
        return lambda condition: condition in later

    def evaluate_sign(laplace: Complex) -> Complex:
        return sign * evaluate_constant(laplace)

    along = springs[0] if len(springs) == 1 else stage
    words = "stiffer" if sign > 0 else "softer"
    place = f"joint:{stage}"
    steps = [
        Law.for_springs(
            scene,
            place,
            springs,
            f"{along}.{words}(visit {first + 1})",
            evaluate_sign,
            start_at(first),
        )
        for first in range(1, len(visits))
    ]

    def state(fitted: Mapping[str, float]) -> dict[str, Value]:
        changes = np.cumsum([fitted[step.size_name] for step in steps])
        return {
            f"factor_{visit}": float(1 + sign * change) for visit, change in enumerate(changes, 2)
        }

    return Hypothesis(
        "drift",
        place,
        LEVELS,
        parts=tuple(step.part for step in steps),
        scored=tuple(step.size_name for step in steps),
        follow={name: spring for step in steps for name, spring in step.follow.items()},
        signed=True,
        state=state,
    )


EFFECT = Effect(
    propose,
    noun="another stiffness in one test",
    means="the joint of {place} was softer or stiffer in the {direction}: warm, or clamped anew",
    confirm="repeat the {direction} directly before or after the others: {place} differs no more",
    undoes=True,
)
