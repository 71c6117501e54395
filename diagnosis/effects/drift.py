"""A joint whose stiffness differs in one test or set-up: the machine warmed up in between.

One factor multiplies all springs of the joint in that test: K += (factor - 1) k, with the k fitted
to all tests. A test is one reference of one file. A set-up is all tests of one name.
"""

from collections.abc import Iterator, Mapping

from diagnosis.effects.points import find_own_springs, find_sprung_stages, list_references
from diagnosis.effects.spring_laws import Law, evaluate_constant
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Condition


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint and each reference or set-up, if there are several."""
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
                return {"factor": 1 + fitted[spring_law.size_name]}

            yield from drift.propose("drift", when, state, signed=False)


EFFECT = Effect(
    propose,
    noun="another stiffness in one test",
    means="the joint of {place} was softer or stiffer in the {direction}: warm, or clamped anew",
    confirm="repeat the {direction} directly before or after the others: {place} differs no more",
    undoes=True,
)
