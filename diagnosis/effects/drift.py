"""A joint whose stiffness differs in one test or set-up: the machine warmed up in between.

All springs of the joint are multiplied by one factor there, K += (factor - 1) k, with k as fitted
to all tests. A test is one reference of one file, a set-up all tests of that name.
"""

from collections.abc import Iterator, Mapping

from diagnosis.effects.points import find_own_springs, find_sprung_stages, list_references
from diagnosis.effects.spring_laws import Law, evaluate_constant
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Condition


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint and each reference or set-up, where there are several."""
    machine = scene.model.machine
    conditions = [test.condition for test in scene.session.campaign.tests]
    setups = sorted({condition.setup for condition in conditions if condition.setup is not None})
    labels = [str(reference) for reference in list_references(scene)]
    whens = [*(labels if len(labels) > 1 else ()), *(setups if len(setups) > 1 else ())]
    for stage in find_sprung_stages(machine):
        springs, place = find_own_springs(machine, stage), f"joint:{stage}"
        for when in whens:

            def acts(condition: Condition, at: str = when) -> bool:
                return at in (str(condition.reference.positive), condition.setup)

            drift = Law.for_springs(
                scene, place, springs, f"{stage}.drift({when})", evaluate_constant, acts
            )

            def state(fitted: Mapping[str, float], spring_law: Law = drift) -> dict[str, Value]:
                return {"factor": 1 + fitted[spring_law.size]}

            yield from drift.propose("drift", when, state, signed=False)


EFFECT = Effect(
    propose,
    noun="another stiffness in one test",
    means="the joint of {place} was softer or stiffer in the {direction}: warm, or clamped anew",
    confirm="repeat the {direction} directly before or after the others: {place} differs no more",
    undoes=True,
)
