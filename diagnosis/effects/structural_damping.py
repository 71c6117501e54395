"""A joint whose loss does not grow with frequency: K += i sign(w) eta k."""

from collections.abc import Iterator, Mapping

from diagnosis.effects.spring_laws import Law
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages
from diagnosis.stated_values import Value
from mbmodel.parts.spring_laws import ConstantLoss


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint."""
    machine = scene.model.machine
    for stage in find_sprung_stages(machine):
        place = f"joint:{stage}"
        loss = Law.for_springs(
            scene, place, find_own_springs(machine, stage), f"{stage}.loss", ConstantLoss()
        )

        def state(fitted: Mapping[str, float], spring_law: Law = loss) -> dict[str, Value]:
            return {"loss_factor": spring_law.read_size(fitted)}

        yield from loss.propose("structural_damping", None, state)


EFFECT = Effect(
    propose,
    noun="a loss that does not grow with frequency",
    means="the loss in the joint of {place} does not grow with frequency: rubber, cables",
    confirm="repeat at another level: friction in {place} changes, the loss of a material stays",
)
