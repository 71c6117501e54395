"""A force channel or drive with a gain beyond its tolerance: a wrong calibration value.

The gain multiplies all FRFs of its tests: H_measured = gain H. A machine with all masses, springs
and dampers divided by the gain has equal FRFs. Only the tolerances of the masses, or a test with a
known mass, tell both apart.
"""

from collections.abc import Iterator
from dataclasses import replace

from diagnosis.effects.scales import GAIN_ENDS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import release_hammers


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Return one for each hammer or drive whose gain has a tolerance."""
    if scene.session.campaign.unknown_gains.hammers:
        return iter(())
    return (
        replace(released, bounds=dict.fromkeys(released.release, GAIN_ENDS))
        for released in release_hammers(scene, "hammer_gain", "gain")
    )


EFFECT = Effect(
    propose,
    noun="a wrong gain of the force channel",
    means="the force channel of {place} is wrong by a factor; absolute stiffness rests on it",
    confirm=(
        "hit a freely hung body of known mass with the hammer of {place}, or add a known mass to "
        "the machine and repeat: absolute stiffness rests on the calibration of the hammer"
    ),
)
